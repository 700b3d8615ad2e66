"""Friction between the samples: what is said not to be resolved is as large as what is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.robots import changed, with_exact_encoders

from robid_core import Robot
from robid_core.estimation.torque.periodic import periodic_motion_of
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.windowed import windowed_motion_of
from robid_core.parameters import FreeParameters
from robid_core.residual import PeriodicBlock, WindowedBlock

T, N, COULOMB = 1e-3, 2000, 0.1
SETTLE = 12  # periods


def robot_of(width: float, rotor: float) -> Robot:
    """One axis whose friction turns within so many rad/s."""
    friction = {"coulomb": COULOMB, "viscous": 2e-4, "speed": width}
    controller = {"speed_gain": 150 * rotor, "integral_gain": 600 * rotor, "position_gain": 1.0}
    return changed(
        with_exact_encoders(Robot.load("one_axis")),
        every_axis={"friction": friction, "controller": controller, "rotor_inertia": rotor},
    )


def left_and_unresolved(width: float, rotor: float, periodic: bool) -> tuple[float, float]:
    """Rms of what the true robot leaves above 20 Hz, and of what is said not to be resolved, of the Coulomb level.

    As torques of single samples would leave it; without noise, simulated with steps that follow the friction.
    """
    robot, generator, time = robot_of(width, rotor), np.random.default_rng(4), T * np.arange(N)
    lines = np.unique(np.geomspace(7, 159, 60).astype(int))
    speed = 9 * np.sin(2 * np.pi * time / (N * T)) + 0.7 * sum(
        np.sin(2 * np.pi * line / (N * T) * time + generator.uniform(0, 6)) for line in lines
    )
    run = robot.simulate(np.tile(speed[:, None], (1, SETTLE + 2, 1)), np.array([[0.4]]), step=1e-5)
    quiet = robot.with_parameters({"friction.axis_1.coulomb": 0.0})
    laws = SpeedFunctions.of_widths((width,), 1)
    position, torque = (
        values[:, SETTLE * N :].reshape(1, 1, 1, 2, N, 1) for values in (run.position, run.torque)
    )
    block: PeriodicBlock | WindowedBlock
    if periodic:
        block = PeriodicBlock.of_record(quiet, periodic_motion_of(position, torque, T, lines, 100.0), laws)
    else:
        noisy = changed(quiet, every_axis={"sensors": {"torque_noise": 1e-6, "position_noise": 1e-12}})
        whole = (values.reshape(1, 1, 2 * N, 1) for values in (position, torque))
        block = WindowedBlock.of_record(noisy, windowed_motion_of(*whole, T, 100.0), laws)
    free = FreeParameters.of_robot(quiet, ("friction.axis_1.viscous",))
    coefficient = np.array([[COULOMB], [0.0], [0.0]])
    for _ in range(3):
        block.renew(free, np.zeros(1))
    block.renew_friction(block.robot, coefficient)
    residual = block.residual(block.predicted(block.robot, np.zeros(1), coefficient), np.zeros(1))
    which = block.motion.frequency_hz > 20
    power = (np.abs(residual[:, :, which]) ** 2).mean(), np.abs(block.unresolved[which]).mean()
    left, unresolved = np.sqrt(np.array(power) * block.motion.n_sample) / COULOMB
    return left, unresolved


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("width", [0.1, 0.06])
def test_sharp_friction_of_a_light_motor_is_not_resolved_and_that_is_said(
    width: float, periodic: bool
) -> None:
    """It is followed within a twentieth of a sample: by up to six times too much, not too little."""
    left, unresolved = left_and_unresolved(width, 5e-5, periodic)
    assert left > 2e-3
    assert 0.9 < unresolved / left < 6


@pytest.mark.parametrize(("periodic", "most"), [(True, 4e-4), (False, 3e-3)])
def test_friction_of_a_heavy_motor_is_resolved(periodic: bool, most: float) -> None:
    """It is followed over five samples; what is left is that of finite steps, and of the window."""
    left, unresolved = left_and_unresolved(0.5, 1e-3, periodic)
    assert unresolved < 1e-4
    assert left < most
