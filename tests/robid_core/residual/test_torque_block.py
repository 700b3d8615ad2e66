"""The torque of a simulated motion, without noise and at the true parameters: what a block leaves of it."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Robot
from robid_core.estimation.torque.periodic import periodic_motion_of
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.parameters import FreeParameters
from robid_core.residual import PeriodicBlock

T, N, STEP = 1e-3, 2000, 6.25e-5  # a plant of four times finer steps than the block's model has
LINES = np.array([9, 21, 47, 95, 139])


@pytest.fixture(scope="module")
def block(ideal: Robot) -> PeriodicBlock:
    """Two experiments of one pose, lines from 4.5 to 70 Hz on a slow sine, the periods after four of settling."""
    generator, time = np.random.default_rng(3), T * np.arange(N)
    speed = 9 * np.sin(2 * np.pi * time / (N * T))[None, :, None] * np.ones((2, 1, 6))
    for line in LINES:
        phase = generator.uniform(0, 2 * np.pi, (2, 1, 6))
        speed = speed + 5 * np.sin(2 * np.pi * line / (N * T) * time[None, :, None] + phase)
    run = ideal.simulate(
        np.tile(speed, (1, 6, 1)), np.tile([0.3, 0.4, -0.3, 0.5, 0.6, 0.2], (2, 1)), step=STEP
    )
    rows = (1, 1, 2, 2, N, 6)
    position, torque = (values[:, 4 * N :].reshape(rows) for values in (run.position, run.torque))
    levels = {
        name: 0.0 for name in ideal.layout if name.endswith(".coulomb") and name.startswith("friction.")
    }
    motion = periodic_motion_of(position, torque, T, LINES, 100.0)
    laws = SpeedFunctions.of_widths((ideal.drives.friction_speed[0],), 6)
    return PeriodicBlock.of_record(ideal.with_parameters(levels), motion, laws)


def left(block: PeriodicBlock, ideal: Robot) -> np.ndarray:
    """Residual over the torque of the lines, rms at lines and at other bins, axis by axis, (2, n_axis)."""
    coefficient = np.zeros((3, 6))
    coefficient[0] = ideal.drives.coulomb
    torque = block.predicted(block.robot, np.zeros(1), coefficient)
    residual, lines = block.residual(torque, 0.0), block.motion.excited
    size = np.sqrt((np.abs(block.motion.torque_spectrum[:, :, lines]) ** 2).mean(axis=(0, 1, 2)))
    other = ~lines & (block.motion.frequency_hz > 25)
    rms = [np.sqrt((np.abs(residual[:, :, which]) ** 2).mean(axis=(0, 1, 2))) for which in (lines, other)]
    return np.stack(rms) / size


def test_a_prescribed_motion_and_friction_give_the_torque_back(block: PeriodicBlock, ideal: Robot) -> None:
    """The linear model leaves parts of a thousand in bins that are no lines, prescribed motion a fifth of that at most.

    At lines, steps of 0.25 ms err by (w h)^2 / 24 = 5e-4 in what springs take at 70 Hz, which is a part of the torque.
    """
    free = FreeParameters.of_robot(block.robot, ("friction.axis_1.viscous",))
    assert ideal.drives.friction_speed == pytest.approx(ideal.drives.friction_speed[0])
    linear = left(block, ideal)
    for _ in range(3):  # each from where the one before ended: until it has rung out
        block.renew(free, np.zeros(1))
    moved = left(block, ideal)
    coefficient = np.zeros((3, 6))
    coefficient[0] = ideal.drives.coulomb
    block.renew_friction(block.robot, coefficient)
    best = left(block, ideal)
    assert (linear[1] > 5 * best[1]).all()
    assert best[0].max() < 5e-4
    assert best[1].max() < 1e-4
    # Heavy motors: at light ones the steps of integration leave more than the jumps of friction do.
    assert (best[1] < 0.95 * moved[1])[:3].all()


def test_derivatives_that_run_together_are_those_of_runs_one_by_one(
    ideal: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of springs beside a nonlinear one, of its law, and of a law with a state; against central differences, too."""
    quiet = ideal.with_parameters({f"friction.{axis}.coulomb": 0.0 for axis in ideal.axis_names})
    robot = quiet.with_effect("hard", "transmission.stiffening", "axis_2", "gear")
    robot = robot.with_effect("hook", "transmission.bouc_wen", "axis_3", "gear")
    names = ("gear_stiffness.axis_2", "gear_damping.axis_4", "effect.hard.cubic", "effect.hook.torque")
    free = FreeParameters.of_robot(robot, names)
    time, n_sample = T * np.arange(2000), 2000
    wave = 0.02 * np.sin(2 * np.pi * 10 * time[:, None] + np.arange(6)) / robot.drives.gear.diagonal()
    angle = wave + robot.motor_angle([0.3, 0.4, -0.3, 0.5, 0.6, 0.2])
    motion = periodic_motion_of(
        np.tile(angle, (1, 1, 1, 2, 1, 1)), np.zeros((1, 1, 1, 2, n_sample, 6)), T, np.array([20]), 60.0
    )
    block, found = PeriodicBlock.of_record(robot, motion, SpeedFunctions.of_widths((0.5,), 6)), []
    block.renew(free, np.zeros(4))
    started = block.state
    for at_once in (32, 1):
        monkeypatch.setattr("robid_core.residual.simulated_columns.LANES_AT_ONCE", at_once)
        block.differentiate(free, np.zeros(4))
        found.append(block.simulated)
    for together, alone in zip(*found, strict=True):
        np.testing.assert_array_equal(together.remainder, alone.remainder)
        np.testing.assert_array_equal(together.linear, alone.linear)
    assert [column.index for column in found[0]] == [0, 1, 2, 3]
    for column in found[0]:
        ends = []
        for step in (-2e-3, 2e-3):
            moved = step * np.eye(4)[column.index]
            block.state = started
            block.renew(free, moved)
            ends.append(block.predicted(block.robot_at(free, moved), moved, np.zeros((3, 6))))
        expected = (ends[1] - ends[0]) / 4e-3
        # One step to one side errs by half of it, 5e-4, times the second derivative over the first: 1 for a power of
        # the number, more for hysteresis with sharp corners. What rings from the start is 200 times that large.
        assert abs(column.remainder + column.linear - expected).max() < 2e-2 * abs(expected).max()


def test_a_gap_has_rung_out_however_short_the_period_is(
    ideal: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second motion after the first changes less than the noise; with a fixed number of periods it is far from that.

    The wrist's gap rings for seconds, and half a second is a period.
    """
    robot = ideal.with_effect("play", "transmission.backlash", "axis_4", "gear", values={"gap": 1e-4})
    generator, time = np.random.default_rng(5), T * np.arange(500)
    wave = 0.02 * np.sin(2 * np.pi * 10 * time[:, None] + np.arange(6)) / robot.drives.gear.diagonal()
    angle = wave + robot.motor_angle([0.3, 0.4, -0.3, 0.5, 0.6, 0.2])
    torque = 0.01 * generator.standard_normal((1, 1, 1, 2, 500, 6))
    motion = periodic_motion_of(np.tile(angle, (1, 1, 1, 2, 1, 1)), torque, T, np.array([5]), 60.0)
    noise = (np.abs(motion.torque_deviation) ** 2).mean(axis=(0, 1, 2, 3))
    free = FreeParameters.of_robot(robot, ("gear_stiffness.axis_4",))

    def moved() -> float:
        """What the second motion changes, of the noise, at the axis where that is most."""
        block, left = PeriodicBlock.of_record(robot, motion, SpeedFunctions.of_widths((0.5,), 6)), []
        for _ in range(2):
            block.renew(free, np.zeros(1))
            left.append(block.remainder)
        change = (np.abs(left[1] - left[0]) ** 2).mean(axis=(0, 1, 2))
        return float(np.sqrt((change / noise).max()))

    rung_out = moved()
    monkeypatch.setattr("robid_core.residual.periodic_block.LONGEST_S", 0.0)
    assert rung_out < 0.5 < 5 < moved()
