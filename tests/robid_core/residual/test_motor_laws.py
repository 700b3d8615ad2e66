"""Laws on motors see the speed between samples: friction stated as an effect leaves what functions of speed leave."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from oracles.robots import changed, with_exact_encoders

from robid_core import Robot
from robid_core.estimation.torque.periodic import periodic_motion_of
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.windowed import windowed_motion_of
from robid_core.parameters import FreeParameters
from robid_core.residual import PeriodicBlock, WindowedBlock
from robid_core.residual.motor_laws import motor_terms

T, N, COULOMB, VISCOUS, WIDTH, ROTOR = 1e-3, 2000, 0.6, 2e-3, 0.3, 1e-3
SETTLE, KEPT = 6, 3  # periods


@functools.cache
def machine() -> Robot:
    """One axis whose friction turns within a third of what a sample changes its speed by."""
    friction = {"coulomb": COULOMB, "viscous": VISCOUS, "speed": WIDTH}
    controller = {"speed_gain": 150 * ROTOR, "integral_gain": 600 * ROTOR, "position_gain": 1.0}
    axes = {"friction": friction, "controller": controller, "rotor_inertia": ROTOR}
    return changed(with_exact_encoders(Robot.load("one_axis")), every_axis=axes)


@functools.cache
def measured(noise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lines, angles (1, 1, 1, KEPT, N, 1) with noise, rad, and torques."""
    generator, time = np.random.default_rng(4), T * np.arange(N)
    lines = np.unique(np.geomspace(7, 159, 60).astype(int))
    speed = 9 * np.sin(2 * np.pi * time / (N * T)) + 0.7 * sum(
        np.sin(2 * np.pi * line / (N * T) * time + generator.uniform(0, 6)) for line in lines
    )
    run = machine().simulate(np.tile(speed[:, None], (1, SETTLE + KEPT, 1)), np.array([[0.4]]), step=1e-5)
    position, torque = (
        values[:, SETTLE * N :].reshape(1, 1, 1, KEPT, N, 1) for values in (run.position, run.torque)
    )
    return lines, position + noise * generator.standard_normal(position.shape), torque


def block_of(stated: bool, periodic: bool, noise: float) -> PeriodicBlock | WindowedBlock:
    """A block at the truth: friction is an effect where it is stated, else a function of speed."""
    lines, position, torque = measured(noise)
    robot = machine().with_parameters({"friction.axis_1.coulomb": 0.0})
    if stated:
        values = {"coulomb": COULOMB, "viscous": VISCOUS, "speed": WIDTH}
        robot = robot.with_parameters({"friction.axis_1.viscous": 0.0})
        robot = robot.with_effect("rubbing", "friction.coulomb_viscous", "axis_1", values=values)
    laws = SpeedFunctions.of_widths((WIDTH,), 1)
    block: PeriodicBlock | WindowedBlock
    if periodic:
        block = PeriodicBlock.of_record(robot, periodic_motion_of(position, torque, T, lines, 100.0), laws)
    else:
        noisy = changed(robot, every_axis={"sensors": {"torque_noise": 1e-6, "position_noise": 1e-12}})
        whole = (values.reshape(1, 1, KEPT * N, 1) for values in (position, torque))
        block = WindowedBlock.of_record(noisy, windowed_motion_of(*whole, T, 100.0), laws)
    free = FreeParameters.of_robot(block.robot, ("gear_stiffness.axis_1",))
    for _ in range(3):
        block.renew(free, np.zeros(1))
    block.renew_friction(block.robot, coefficient(stated))
    return block


def coefficient(stated: bool) -> np.ndarray:
    return np.array([[0.0 if stated else COULOMB], [0.0], [0.0]])


def left(block: PeriodicBlock | WindowedBlock, stated: bool) -> float:
    """Rms of what the true robot leaves above 20 Hz, N m of single samples, of the Coulomb level."""
    predicted = block.predicted(block.robot, np.zeros(1), coefficient(stated))
    residual = block.residual(predicted, np.zeros(1))[:, :, block.motion.frequency_hz > 20]
    return float(np.sqrt((np.abs(residual) ** 2).mean() * block.motion.n_sample)) / COULOMB


@pytest.mark.parametrize(("periodic", "times", "near"), [(True, 1.2, 1e-4), (False, 2.0, 1e-3)])
def test_friction_as_an_effect_leaves_what_functions_of_speed_leave(
    periodic: bool, times: float, near: float
) -> None:
    """Prescribed motions, in steps in which the speed changes by the width, left 4e-3.

    Of motions that do not repeat effects see the speed that is smooth between the samples.
    """
    as_function, as_effect = (block_of(stated, periodic, 0.0) for stated in (False, True))
    assert left(as_effect, True) < times * left(as_function, False)
    assert left(as_effect, True) < 4e-4
    predicted = [
        block.predicted(block.robot, np.zeros(1), coefficient(stated))
        for block, stated in ((as_function, False), (as_effect, True))
    ]
    assert np.abs(predicted[1] - predicted[0]).max() < near * np.abs(predicted[0]).max()


def test_noise_of_the_angles_comes_through_an_effect_as_through_functions_of_speed() -> None:
    """Periods of a noise that is a fifth of the width in speed: 24 differences about each bin, 20 % in all of them."""
    blocks = [block_of(stated, True, 2e-5) for stated in (False, True)]
    noise = [
        block.measured_noise(block.robot, coefficient(stated))[1:, 0, 0].real.mean()
        for block, stated in zip(blocks, (False, True), strict=True)
    ]
    assert noise[1] == pytest.approx(noise[0], rel=0.05)
    second = blocks[1]
    assert isinstance(second, PeriodicBlock)
    second.law_deviation = None
    assert second.measured_noise(second.robot, coefficient(True))[1:, 0, 0].real.mean() < 0.7 * noise[0]


def test_laws_with_a_memory_or_behind_the_gear_are_no_laws_of_the_motor() -> None:
    robot = machine()
    assert not motor_terms(robot.with_effect("a", "friction.dahl", "axis_1"))
    assert not motor_terms(robot.with_effect("a", "friction.stribeck", "axis_1", side="arm"))
    ((term, axis),) = motor_terms(robot.with_effect("a", "friction.stribeck", "axis_1"))
    assert (term.label, axis) == ("a", 0)
