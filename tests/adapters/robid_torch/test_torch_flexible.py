"""Flexible links in torch: the same numbers as the compiled kernels, bent and turned at random."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Robot
from robid_core.mechanics import dynamics

torch = pytest.importorskip("torch")

from robid_torch.trees import tensor, terms_at, tree_of  # noqa: E402

CPU = torch.device("cpu")


def test_terms_of_flexible_links_are_those_of_the_kernel() -> None:
    """Sums of some hundred products of numbers below the largest: rounding of 1e-14 of it."""
    chain = Robot.load("six_axis_flex").chain
    rng = np.random.default_rng(5)
    # deflections a hundred times those of the robot, so that what they change is seen
    q = np.where(chain.joint_type == 2, 0.3, 1.0) * rng.normal(size=(6, chain.n_coordinate))
    expected, got = dynamics(chain, q), terms_at(tree_of(chain, CPU), tensor(q, CPU))
    for ours, theirs in (
        (got.mass, expected.mass),
        (got.gravity_torque, expected.bias),
        (got.gravity_stiffness, expected.gravity_stiffness),
    ):
        np.testing.assert_allclose(ours.numpy(), theirs, rtol=0, atol=1e-14 * abs(theirs).max())


def test_equilibria_and_responses_of_flexible_links_agree() -> None:
    robots = []
    for dynamics_name in ("kernel", "torch"):
        robot = Robot.load("six_axis_flex", dynamics=dynamics_name)
        robots.append(Robot(robot.description.model_copy(update={"effects": {}}), dynamics_name))
    angle = np.random.default_rng(6).uniform(-0.8, 0.8, (3, 6))
    torques = [robot.gravity_torque(angle) for robot in robots]
    np.testing.assert_allclose(torques[1], torques[0], rtol=0, atol=1e-11 * abs(torques[0]).max())
    frequency = np.array([5.0, 16.0, 60.0])
    responses = [robot.response(angle, frequency) for robot in robots]
    np.testing.assert_allclose(responses[1], responses[0], rtol=1e-8, atol=1e-12 * abs(responses[0]).max())
