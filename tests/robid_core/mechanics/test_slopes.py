"""Derivatives along changes of a mechanism: against whole models a little further on, and against transfer vectors."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import FloatArray, FreeParameters, Robot, mechanism_change
from robid_core.mechanics import response, response_slopes, second_order_slopes, torque_slopes

OMEGA = 2 * np.pi * np.geomspace(4, 80, 5)
HOLD = 1e-3
STEP = 3e-4  # in natural scales: at a resonance of 1 % damping differences of fourth order err by (STEP / 2 %)^4 / 30
WEIGHTS = ((1, 8 / 12), (-1, -8 / 12), (2, -1 / 12), (-2, 1 / 12))
NAMES = ("mass.", "centre_of_mass.", "inertia.", "rotor_inertia.", "gear_ratio.", "coupling.")


def rigid_gears(robot: Robot) -> Robot:
    """Return a robot whose second axis has no spring in its gear."""
    axes = dict(robot.description.axes)
    axes["axis_2"] = axes["axis_2"].model_copy(update={"gear": None})
    return Robot(robot.description.model_copy(update={"axes": axes}))


ROBOTS = {
    "one axis": lambda: Robot.load("one_axis"),
    "six axes": lambda: Robot.load("six_axis"),
    "one rigid gear": lambda: rigid_gears(Robot.load("six_axis")),
}


def poses(robot: Robot, seed: int) -> FloatArray:
    d = robot.drives
    return np.random.default_rng(seed).uniform(0.8 * d.lower, 0.8 * d.upper, (2, robot.n_axis))


@pytest.mark.parametrize("name", ROBOTS)
def test_they_are_differences_of_whole_models(name: str) -> None:
    """Bodies, rotors and gears, each model at its own rest, with an impedance at the motors.

    Two models differ by 1e-13 of their size from rounding and from where Newton's method stopped, their difference
    over a step by 1e-10; springs make stiffnesses a thousand times as large as what bodies change of them.
    """
    robot = ROBOTS[name]()
    names = tuple(n for n in robot.layout if n.startswith(NAMES))
    free = FreeParameters.of_robot(robot, names)
    rng = np.random.default_rng(4)
    point, angle = 0.02 * rng.standard_normal(len(names)), poses(robot, 5)
    here = free.set_on(robot, point)
    impedance = 0.1 * rng.standard_normal((2, len(OMEGA), robot.n_axis)) * (1 + 1j)
    change = mechanism_change(free, robot, point, range(len(names)))
    rest = here.equilibrium(angle).position
    slopes = second_order_slopes(here.mechanism, *here.spring_arrays(), rest, change)
    plain = response_slopes(here.second_order(angle), slopes, OMEGA, HOLD)
    loaded = response_slopes(here.second_order(angle), slopes, OMEGA, None, impedance)

    def at(step: float, number: int) -> list[np.ndarray]:
        moved = point.copy()
        moved[number] += step
        other = free.set_on(robot, moved)
        model = other.second_order(angle)
        motors = np.linalg.inv(response(model, OMEGA)) * (-(OMEGA**2))[:, None, None]
        motors[:, :, range(robot.n_axis), range(robot.n_axis)] += impedance
        with_impedance = -(OMEGA**2)[:, None, None] * np.linalg.inv(motors)
        torque = other.gravity_torque(angle)
        return [
            model.mass, model.damping, model.stiffness, torque, response(model, OMEGA, HOLD), with_impedance
        ]  # fmt: skip

    found = slopes.mass, slopes.damping, slopes.stiffness, slopes.torque, plain, loaded
    for number in range(0, len(names), 1 if len(names) < 20 else 3):
        ends = [(weight, at(way * STEP, number)) for way, weight in WEIGHTS]
        for k, kept in enumerate(found):
            expected = sum(weight * parts[k] for weight, parts in ends) / STEP
            size = abs(ends[0][1][k]).max()
            assert np.abs(kept[..., number] - expected).max() <= 1e-8 * abs(expected).max() + 1e-9 * size, (
                names[number],
                k,
            )


def test_those_of_springs_are_products_of_transfer_vectors() -> None:
    """Springs, dampers and friction at the motors, as `response_with_gradient` has them."""
    robot = Robot.load("six_axis")
    names = tuple(n for n in robot.layout if "stiffness" in n or "damping" in n or n.endswith(".viscous"))
    free = FreeParameters.of_robot(robot, names)
    angle = poses(robot, 6)
    change = mechanism_change(free, robot, np.zeros(len(names)), range(len(names)))
    rest = robot.equilibrium(angle).position
    slopes = second_order_slopes(robot.mechanism, *robot.spring_arrays(), rest, change)
    assert not len(change.of_mechanism())
    assert not slopes.stiffness.any()
    found = response_slopes(robot.second_order(angle), slopes, OMEGA, HOLD)
    vectors = robot.response_with_gradient(angle, OMEGA / (2 * np.pi))
    rate = 1j * OMEGA[:, None, None]
    for number, name in enumerate(names):
        if name in robot.stiffness_names:
            x = vectors.spring_vectors[:, :, robot.stiffness_names.index(name)]
            factor: complex | np.ndarray = -1.0
        elif name in robot.damping_names:
            x = vectors.spring_vectors[:, :, robot.damping_names.index(name)]
            factor = -rate
        else:
            x = vectors.motor_vectors[:, :, robot.axis_names.index(name.split(".")[1])]
            factor = -rate
        expected = robot.parameter(name) * factor * x[..., :, None] * x[..., None, :]
        # tangents by steps of 1e-5: 1e-11
        assert np.abs(found[..., number] - expected).max() <= 1e-9 * np.abs(expected).max(), name


def test_torque_and_response_are_two_sides_of_one_model() -> None:
    """``T = -w^2 G^-1 Q`` without hold, so ``dT = w^2 G^-1 dG G^-1 Q``: ten digits are left of two inverses."""
    robot = Robot.load("six_axis")
    names = tuple(n for n in robot.layout if n.startswith(("mass.", "gear_stiffness.", "bearing_damping.")))
    free = FreeParameters.of_robot(robot, names)
    angle, rng = poses(robot, 7), np.random.default_rng(8)
    change = mechanism_change(free, robot, np.zeros(len(names)), range(len(names)))
    rest = robot.equilibrium(angle).position
    slopes = second_order_slopes(robot.mechanism, *robot.spring_arrays(), rest, change)
    model = robot.second_order(angle)
    swing = rng.standard_normal((2, len(OMEGA), 3, 6, 2)) @ (1, 1j)
    found = torque_slopes(model, slopes, OMEGA, swing)
    assert found.shape == (2, len(OMEGA), 3, 6, len(names))
    inverse = np.linalg.inv(response(model, OMEGA))
    turned = np.einsum(
        "cfab,cfbdp,cfde,cfxe->cfxap", inverse, response_slopes(model, slopes, OMEGA), inverse, swing
    )
    expected = (OMEGA**2)[:, None, None, None] * turned
    size = np.abs(expected).max(axis=(0, 1, 2, 3))
    assert (np.abs(found - expected).max(axis=(0, 1, 2, 3)) <= 1e-8 * size).all()
