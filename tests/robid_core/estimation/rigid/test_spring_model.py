"""Resonances without kernels against those of the linear model that kernels make."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from robid_core import ConfigurationError, Robot
from robid_core.estimation.rigid.spring_model import (
    spring_model,
    spring_resonances,
    spring_response,
)

ARMS = ("one_axis", "six_axis", "scara", "universal_arm", "seven_axis")


def compiled(robot: Robot, angle: np.ndarray) -> np.ndarray:
    model = robot.second_order(angle[None])
    return np.sqrt(np.maximum(scipy.linalg.eigvalsh(model.stiffness[0], model.mass[0]), 0.0)) / (2 * np.pi)


@pytest.mark.parametrize("name", ARMS)
def test_resonances_are_those_of_the_linear_model(name: str) -> None:
    """Without gravity the same numbers; with it within a percent above the pendulums."""
    robot = Robot.load(name)
    angle = np.random.default_rng(1).uniform(-0.4, 0.4, robot.n_axis)
    found = spring_resonances(robot.mechanism, robot.spring_arrays()[0], angle)
    floating = Robot(robot.description.model_copy(update={"gravity": (0.0, 0.0, 0.0)}))
    there = compiled(floating, angle)
    np.testing.assert_allclose(found, there, rtol=1e-8, atol=1e-4 * there[-1])
    loaded = compiled(robot, angle)
    above = loaded > 2.0
    np.testing.assert_allclose(found[above], loaded[above], rtol=0.01)


@pytest.mark.parametrize("name", ARMS)
def test_matrices_are_those_of_the_linear_model(name: str) -> None:
    """Without gravity."""
    robot = Robot.load(name)
    robot = Robot(robot.description.model_copy(update={"gravity": (0.0, 0.0, 0.0)}))
    angle = np.random.default_rng(2).uniform(-0.4, 0.4, robot.n_axis)
    viscous = np.linspace(1e-3, 2e-3, robot.n_axis)
    found = spring_model(robot.mechanism, *robot.spring_arrays(), angle, viscous)
    model = robot.second_order(angle[None], viscous[None])
    for ours, theirs in zip(found, (model.mass[0], model.damping[0], model.stiffness[0]), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-11 * np.abs(theirs).max())


@pytest.mark.parametrize("hold", ["continuous", "zero_order_hold"])
@pytest.mark.parametrize("name", ["one_axis", "scara", "universal_arm"])
def test_responses_are_those_of_kernels(name: str, hold: str) -> None:
    """Without gravity."""
    robot = Robot.load(name)
    robot = Robot(robot.description.model_copy(update={"gravity": (0.0, 0.0, 0.0)}))
    angle = np.random.default_rng(3).uniform(-0.4, 0.4, robot.n_axis)
    viscous, frequency = np.linspace(1e-3, 2e-3, robot.n_axis), np.array([0.7, 5.0, 21.0, 93.0])
    theirs = robot.response(angle[None], frequency, viscous[None], hold)[0]
    step = robot.sample_time_s if hold == "zero_order_hold" else None
    ours = spring_response(
        robot.mechanism, *robot.spring_arrays(), angle, viscous, 2 * np.pi * frequency, step
    )
    largest = np.abs(theirs).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(ours / largest, theirs / largest, rtol=0, atol=1e-9)


def test_modes_of_flexible_links_are_refused() -> None:
    robot = Robot.load("six_axis_flex")
    with pytest.raises(ConfigurationError, match="flexible link"):
        spring_resonances(robot.mechanism, robot.spring_arrays()[0], np.zeros(robot.n_axis))
