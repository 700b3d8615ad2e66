"""Derivatives by inertial parameters: against central differences of the linear model, and kept near by."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Robot
from robid_core.parameters import FreeParameters
from robid_core.residual.columns import ALIKE, BodyDerivatives, body_derivatives

ANGLE = np.array([[0.3, 0.4, -0.3, 0.5, 0.6, 0.2], [-0.8, 0.9, 0.4, -0.5, 1.1, 0.0]])
BODY_ERROR = 1e-3  # of a derivative per unit of natural scale: one-sided steps of 1e-4, and rounding


@pytest.fixture(scope="module")
def robot() -> Robot:
    """As packaged."""
    return Robot.load("six_axis")


@pytest.fixture(scope="module")
def free(robot: Robot) -> FreeParameters:
    """Some bodies, all rotors, gears and their dampers."""
    names = [name for name in robot.layout if name.startswith(("mass.", "rotor_inertia.", "gear_"))]
    return FreeParameters.of_robot(robot, tuple(names))


def derivatives(
    free: FreeParameters, robot: Robot, point: np.ndarray, known: BodyDerivatives | None = None
) -> BodyDerivatives:
    """At the poses of this file."""
    return body_derivatives(free, robot, point, ANGLE, known)


def test_they_are_central_differences_of_the_linear_model(free: FreeParameters, robot: Robot) -> None:
    """Steps ten times as long: central differences err by the square of them."""
    found = derivatives(free, robot, np.zeros(len(free.names)))
    assert [free.names[i].split(".")[0] for i in found.index].count("rotor_inertia") == 6
    for k, i in enumerate(found.index):
        ends = []
        for step in (1e-3, -1e-3):
            point = np.zeros(len(free.names))
            point[i] = step
            moved = free.set_on(robot, point)
            model = moved.second_order(ANGLE)
            ends.append((model.mass, model.stiffness, moved.gravity_torque(ANGLE)))
        for kept, up, down in zip((found.mass, found.stiffness, found.weight), *ends, strict=True):
            slope = (up - down) / 2e-3
            assert (
                np.abs(kept[..., k] - slope).max()
                <= BODY_ERROR * np.abs(slope).max() + 1e-8 * np.abs(up).max()
            )


def test_they_are_kept_where_bodies_and_springs_have_hardly_moved(free: FreeParameters, robot: Robot) -> None:
    """Dampers may go anywhere; what is kept is then wrong by no more than the way that bodies went."""
    here = derivatives(free, robot, np.zeros(len(free.names)))
    kinds = np.array([robot.parameter_kind(name) for name in free.names])
    near = np.where(kinds == "damping", 1.0, 0.9 * ALIKE)
    kept, fresh = derivatives(free, robot, near, here), derivatives(free, robot, near)
    assert kept.mass is here.mass
    off = np.abs(kept.mass - fresh.mass).max(axis=(0, 1, 2)) / np.abs(fresh.mass).max(axis=(0, 1, 2))
    assert 0 < off.max() < 2 * ALIKE
    far = near.copy()
    far[np.flatnonzero(kinds == "stiffness")[0]] = 1.1 * ALIKE
    assert np.array_equal(derivatives(free, robot, far, here).mass, derivatives(free, robot, far).mass)


def test_those_of_another_structure_are_not_taken(free: FreeParameters, robot: Robot) -> None:
    """A base that rocks has more coordinates; its stiffness counts as a spring's does."""
    here = derivatives(free, robot, np.zeros(len(free.names)))
    rocking = robot.with_effect("base", "structure.foundation")
    names = (*free.names, *(name for name in rocking.layout if name.startswith("effect.base.")))
    more = FreeParameters.of_robot(rocking, names)
    point = np.zeros(len(names))
    found = derivatives(more, rocking, point, here)
    assert found.mass.shape[1] > here.mass.shape[1]
    point[names.index("gear_stiffness.axis_1")] = 0.5 * ALIKE
    assert derivatives(more, rocking, point, found).mass is found.mass
    point[-1] = 1.1 * ALIKE
    assert derivatives(more, rocking, point, found).mass is not found.mass
