"""Motors so light that they follow their friction within a sample: default steps of the simulation resolve it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import robid_core as robid
from robid_core import Robot
from robid_core.robot.file.clock import FOLLOWING, LONGEST_STEP_S


def quieter(robot: Robot, step_s: float) -> Robot:
    """The robot with a tenth of its torques' noise, simulated in steps of some length."""
    axes = {
        name: axis.model_copy(
            update={
                "sensors": axis.sensors.model_copy(update={"torque_noise": 0.1 * axis.sensors.torque_noise})
            }
        )
        for name, axis in robot.description.axes.items()
    }
    return replace(robot, description=robot.description.model_copy(update={"axes": axes, "step_s": step_s}))


@pytest.mark.parametrize(("step_s", "resolved"), [(None, True), (LONGEST_STEP_S, False)])
def test_friction_is_simulated_as_the_file_has_it(step_s: float | None, resolved: bool) -> None:
    """Functions of the speed, which know nothing of steps, explain the torque of a SCARA's shoulder to the noise; in
    steps of half the time in which its motor follows they leave twice the noise's power, at least."""
    robot = Robot.load("scara")
    plant = quieter(robot, robot.step_s if step_s is None else step_s)
    where = robid.use("design.candidates", count=2)(robot, seed=44)
    excitation = robid.use(
        "excitation.multisine",
        band_hz=[3, 60], lines=80, period_s=3, blocks=1, slow_sine_rad_s=6, beyond_limits="scale",
    )(robot, where, seed=45)  # fmt: skip
    record = robid.use("acquisition.simulated", periods=2)(where, excitation, plant, seed=46)
    fit = robid.use("fit.torque_residual")(record, robot)
    assert fit.misfit_table is not None
    shoulder = np.nanmean(fit.misfit_table.other[0])
    deviation = np.sqrt(2 / np.sum(fit.misfit_table.other_freedom[0]))
    assert shoulder < 1 + 5 * deviation if resolved else shoulder > 2


def test_steps_are_halved_until_motors_follow() -> None:
    """0.5 ms at the SCARA's first axes: half of the longest step; no other packaged arm has such light motors."""
    for name in ("six_axis", "one_axis", "universal_arm", "seven_axis", "scara"):
        robot = Robot.load(name)
        drives, elastic = robot.drives, robot.mechanism.elastic_gear
        following = (drives.rotor_inertia * drives.friction_speed / drives.coulomb)[elastic].min()
        assert robot.step_s <= following / FOLLOWING
        assert robot.step_s == (LONGEST_STEP_S / 2 if name == "scara" else LONGEST_STEP_S)
        assert np.isclose(robot.sample_time_s / robot.step_s % 1, 0)
