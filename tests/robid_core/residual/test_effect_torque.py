"""Torque that effects would add along a motion, against motions prescribed to robots that have them."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import FreeParameters, Robot
from robid_core.estimation.torque.periodic import PeriodicMotion, periodic_motion_of
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.residual import EffectTorque, PeriodicBlock
from robid_core.residual.columns import passive_motion
from robid_core.robot.effects import BoundEffect

T, N = 1e-3, 2000
POSE = np.array([[0.3, 0.4, -0.3, 0.5, 0.6, 0.2]])
ROUNDS = 4  # of periods until bearings have rung out: 20 s
SMALL = 1e-3  # of an effect's size: then what it does to the motion itself is of second order

BY_LOAD = {"coulomb": 0.0, "load_coulomb": 0.05, "load_excess": 0.0, "speed": 2.0}
SIZES = ("coulomb", "load_coulomb", "cubic", "stiffness", "damping", "viscous")
PLACES = {
    "motor": ("friction.coulomb_tanh", "axis_2", None, {"coulomb": 0.3, "speed": 2.0}),
    "by load": ("friction.load_dependent", "axis_3", None, BY_LOAD),
    "gear": ("transmission.stiffening", "axis_3", None, {"cubic": 1e10}),
    "bearing": ("friction.viscous", "axis_1_x", "bearing", {"viscous": 50.0}),
    "joint": ("load.cable_spring", "axis_4", None, {"stiffness": 20.0, "damping": 3.0, "rest_angle": 0.5}),
}  # fmt: skip


@pytest.fixture(scope="module")
def robot() -> Robot:
    nominal = Robot.load("six_axis")
    return nominal.with_parameters({n: 0.0 for n in nominal.layout if n.endswith((".coulomb", ".offset"))})


@pytest.fixture(scope="module")
def block(robot: Robot) -> PeriodicBlock:
    """Six motors on three lines each; torques are those that this motion takes of the robot."""
    generator, time = np.random.default_rng(1), T * np.arange(N)
    angle = np.zeros((1, 1, 1, 2, N, robot.n_axis)) + robot.motor_angle(POSE)
    for bin_ in (5, 21, 70):
        phase = generator.uniform(0, 2 * np.pi, robot.n_axis)
        angle += 4.0 / bin_ * np.sin(2 * np.pi * bin_ / (N * T) * time[:, None] + phase)
    motion: PeriodicMotion = periodic_motion_of(angle, np.zeros_like(angle), T, np.array([5, 21, 70]), 80.0)
    block = PeriodicBlock.of_record(robot, motion, SpeedFunctions.of_widths((0.5,), 6))
    (torque,) = block.simulated_rows([robot], final=True)
    moved = motion.with_signals(motion.angle, motion.over_time(torque))
    block = PeriodicBlock.of_record(robot, moved, block.laws)
    for _ in range(ROUNDS):
        block.simulated_rows([robot], final=True)
    return block


def bound_at(robot: Robot, place: str, share: float) -> tuple[Robot, BoundEffect]:
    use, on, side, values = PLACES[place]
    scaled = {name: value * share if name in SIZES else value for name, value in values.items()}
    changed = robot.with_effect("extra", use, on, side, scaled)
    return changed, changed.effects[-1]


@pytest.mark.parametrize("place", PLACES)
def test_an_effect_adds_what_a_prescribed_motion_takes_more(
    robot: Robot, block: PeriodicBlock, place: str
) -> None:
    """Torques of all motors, within 2 % of the largest: the transfer is that of the linear model at rest; a
    joint is bent by no mean torque, which would move the arm."""
    changed, bound = bound_at(robot, place, SMALL)
    plain, _ = bound_at(robot, place, 0.0)
    before, after = block.simulated_rows([plain, changed], final=False)
    expected = (after - before)[:, :, 1:]
    along = EffectTorque(block, robot, np.zeros_like(block.motion.torque_spectrum), np.zeros(1))
    found = along.of_effect(bound)[:, :, 1:]
    held = block.motion.mean_share(block.motion.omega[1:], robot.step_s)[:, None]
    error = abs(found - expected / held).max() / abs(expected).max()
    assert error < 0.02


def test_a_changed_structure_adds_what_its_spring_does(robot: Robot, block: PeriodicBlock) -> None:
    """The product of a new spring's deflections, up to what holding the torque folds back: half a percent."""
    values = {"axis_x": 0.0, "axis_y": 0.0, "axis_z": 1.0, "stiffness": 3e5, "damping": 100.0}
    changed = robot.with_effect("extra", "structure.elastic_coordinate", "axis_4", values=values)
    stiffer = changed.with_parameters({"effect.extra.stiffness": 3e5 * 1.00001})
    along = EffectTorque(block, changed, np.zeros_like(block.motion.torque_spectrum), np.zeros(1))
    (more,) = along.of_structure(stiffer)[0]
    passive = passive_motion(changed, block.angle, block.motion.omega[1:])[0]
    spring = changed.mechanism.spring_directions[changed.spring_names.index("bearing_stiffness.extra")]
    per_motor = np.einsum("n,fna->fa", spring, passive)
    bent = (per_motor * block.motion.angle_spectrum[0, 0, 1:]).sum(axis=1)
    expected = 3.0 * bent[:, None] * per_motor / block.motion.hold[1:, None]
    np.testing.assert_allclose(more[1:], expected, atol=5e-3 * abs(expected).max())


def test_passes_differentiate_a_structure_by_its_linear_model(robot: Robot, block: PeriodicBlock) -> None:
    """The derivative for the new spring is the product of its deflections; no motion is prescribed for it."""
    values = {"axis_x": 0.0, "axis_y": 0.0, "axis_z": 1.0, "stiffness": 3e5, "damping": 100.0}
    changed = robot.with_effect("extra", "structure.elastic_coordinate", "axis_4", values=values)
    own = PeriodicBlock.of_record(changed, block.motion, block.laws)
    free = FreeParameters.of_robot(changed, ["effect.extra.stiffness", "gear_stiffness.axis_2"])
    own.renew(free, np.zeros(2))
    own.differentiate(free, np.zeros(2))
    (column,) = own.simulated
    assert column.index == 0
    assert not column.remainder.any()
    slope = np.log(1.001)  # of the logarithm, its natural scale
    stiffer = changed.with_parameters({"effect.extra.stiffness": 3e5 * 1.001})
    more = own.linear_torque(stiffer) - own.linear_torque(changed)
    np.testing.assert_allclose(column.linear, more / slope, atol=2e-3 * abs(more / slope).max())
