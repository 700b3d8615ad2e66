"""Derivatives of a body's kinetic energy, which is linear in its inertial parameters as torques are, elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import FreeParameters, Robot
from robid_core.residual.body_coordinates import turned_derivatives

STEP = 1e-5  # of a coordinate: central differences err by its square and by rounding over it, 1e-10 each
JOINT = "axis_5"


def energies(free: FreeParameters, point: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """Of the body of a joint, for the velocity of its frame's origin and its turn rate, (n_twist, 2, 3)."""
    values = free.values(point)
    mass, centre = values[f"mass.{JOINT}"], np.array([values[f"centre_of_mass.{JOINT}.{a}"] for a in "xyz"])
    moment = {pair: values[f"inertia.{JOINT}.{pair}"] for pair in ("xx", "yy", "zz", "xy", "xz", "yz")}
    inertia = np.array([[moment["".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
    origin, turn = twist[:, 0], twist[:, 1]
    speed = origin + np.cross(turn, centre)
    return 0.5 * mass * (speed**2).sum(axis=1) + 0.5 * np.einsum("ti,ij,tj->t", turn, inertia, turn)


def differentiated(free: FreeParameters, point: np.ndarray, twist: np.ndarray) -> np.ndarray:
    steps = STEP * np.eye(len(point))
    both = [[energies(free, point + sign * step, twist) for sign in (1, -1)] for step in steps]
    return np.stack([(more - less) / (2 * STEP) for more, less in both], axis=1)


@pytest.fixture
def free() -> FreeParameters:
    """All numbers of the last bodies of the packaged six axes, and a spring between them."""
    robot = Robot.load("six_axis")
    bodies = [
        name
        for name in robot.layout
        if name.split(".")[0] in ("mass", "centre_of_mass", "inertia") and name.split(".")[1] == JOINT
    ]
    return FreeParameters.of_robot(robot, ["gear_stiffness.axis_2", *bodies[:4], "mass.axis_6", *bodies[4:]])


def test_derivatives_elsewhere_are_those_that_were_taken_turned(free: FreeParameters) -> None:
    """With mass, centre of mass and moments a third to a half off."""
    generator = np.random.default_rng(4)
    twist = generator.standard_normal((12, 2, 3))
    point, other = 0.4 * generator.standard_normal((2, len(free.names)))
    here, there = (differentiated(free, one, twist) for one in (point, other))
    turn = turned_derivatives(free, point)
    assert np.allclose(here @ turn(other), there, rtol=0, atol=1e-7 * np.abs(there).max())
    assert not np.allclose(here, there, rtol=0, atol=0.1 * np.abs(there).max())
    assert np.allclose(turn(point), np.eye(len(point)), rtol=0, atol=1e-12)


def test_bodies_of_which_numbers_are_held_and_springs_stay_as_they_are(free: FreeParameters) -> None:
    outside = [i for i, name in enumerate(free.names) if name in ("gear_stiffness.axis_2", "mass.axis_6")]
    point, other = np.random.default_rng(5).standard_normal((2, len(free.names)))
    turned = turned_derivatives(free, point)(other) - np.eye(len(point))
    assert not turned[outside].any()
    assert not turned[:, outside].any()
    assert np.array_equal(turned_derivatives(free, point, {outside[1] + 1})(other), np.eye(len(point)))
    held = free.without(lambda name: name == f"mass.{JOINT}")
    assert np.array_equal(
        turned_derivatives(held, np.zeros(len(held.names)))(np.ones(len(held.names))), np.eye(len(held.names))
    )
