"""The torque that a recorded motion takes of a robot: the recorded one where the robot is right, another where not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy

from robid_core import Channel, ConfigurationError, DataRejected, DenseRun, Record, Robot
from robid_core.estimation.torque.windowed import windowed_motion_of
from robid_core.residual import prescribe_record

T, N_SAMPLE = 1e-3, 6000
LOW_PASS = scipy.signal.butter(4, 100.0, fs=1 / T, output="sos")
MIDDLE = slice(500, -500)  # the state at the first sample is told by what is under a window
FINE = 2**40  # counts a turn: an encoder that tells everything


def sharp(name: str) -> Robot:
    """A robot whose sensors tell what is."""
    robot = Robot.load(name)
    silent = {n: 0.0 for n in robot.layout if n.startswith("sensors.") and n.endswith("_noise")}
    return robot.with_parameters(silent | {n: FINE for n in robot.layout if n.endswith("encoder_counts")})


def record_of(robot: Robot, n_lane: int, speed: float) -> Record:
    """Two sines and a slow one in closed loop, of which the first half second is cut off: all is under way."""
    generator, time = np.random.default_rng(4), T * np.arange(N_SAMPLE + 500)
    waves = sum(
        size * np.sin(2 * np.pi * hz * time[:, None] + generator.uniform(0, 6, (n_lane, 1, robot.n_axis)))
        for size, hz in ((1.0, 0.7), (0.3, 11.0), (0.2, 31.0))
    )
    poses = generator.uniform(-0.8, 0.8, (n_lane, robot.n_axis))
    run = robot.simulate(speed * waves, poses)
    shape = (n_lane, 1, 1, 1, N_SAMPLE, robot.n_axis)
    channels = {
        "motor_position": Channel("motor", "rad", run.position[:, 500:].reshape(shape)),
        "motor_torque": Channel("motor", "N m", run.torque[:, 500:].reshape(shape)),
    }
    dense = DenseRun(T, channels, T * np.arange(N_SAMPLE), np.ones(shape[:-1], dtype=bool))
    return Record(robot.axis_names, "simulated", "zero_order_hold", (dense,), poses, None)


def torque(record: Record) -> np.ndarray:
    return scipy.signal.sosfiltfilt(LOW_PASS, record.run.lanes("motor_torque"), axis=1)[:, MIDDLE]


def error(record: Record, robot: Robot) -> np.ndarray:
    """Relative to what was recorded, of each axis."""
    theirs, ours = torque(record), torque(prescribe_record(robot, record))
    return np.sqrt(((ours - theirs) ** 2).mean(axis=(0, 1)) / (theirs**2).mean(axis=(0, 1)))


EFFECTS: dict[str, Callable[[Robot], Robot]] = {
    "nothing": lambda robot: robot,
    "backlash": lambda robot: robot.with_effect(
        "play", "transmission.backlash", "axis_1", values={"gap": 5e-4}
    ),
    "lugre": lambda robot: robot.with_effect("stick", "friction.lugre", "axis_1"),
    "ripple": lambda robot: robot.with_effect(
        "wave", "drive.torque_ripple", "axis_1", "torque", {"amplitude": 0.05, "order": 6.0}
    ),
    "lag": lambda robot: robot.with_effect("lag", "drive.current_loop", "axis_1", "torque"),
    "gain": lambda robot: robot.with_effect(
        "much", "sensing.gain_error", "axis_1", "torque_measurement", {"error": 0.1}
    ),
    "resolver": lambda robot: robot.with_effect(
        "bent", "sensing.resolver_ripple", "axis_1", "position", {"amplitude": 1e-3, "order": 4.0}
    ),
}


@pytest.mark.parametrize("name", EFFECTS)
def test_a_robot_gives_its_own_torque_back_whatever_acts_on_it(name: str) -> None:
    """Without the law it does not: by the least of these laws the torque is 0.7 % another."""
    bare = sharp("one_axis_true")
    robot = EFFECTS[name](bare)
    record = record_of(robot, 2, 30.0)
    # A law on the commanded torque acts between the samples, at angles that a band of 480 Hz leaves a little unsure.
    between = robot.signals and robot.signals[0].channel == "torque"
    assert error(record, robot).max() < (2e-3 if between else 1e-4)
    if name != "nothing":
        assert error(record, bare).min() > 5e-3


def test_what_rings_on_behind_the_motors_is_known_from_the_torque() -> None:
    """Bearings swing for seconds after what was before the record: taken as at rest, an axis is percents off."""
    robot = sharp("six_axis_true")
    record = record_of(robot, 2, 10.0)
    assert error(record, robot).max() < 1e-3
    still = windowed_motion_of(
        *(record.run.lanes(n)[None] for n in ("motor_position", "motor_torque")), T, 100.0
    )
    at_rest = robot.prescribe(still.motor_motion(robot.step_s)).torque
    off = scipy.signal.sosfiltfilt(LOW_PASS, at_rest, axis=1)[:, MIDDLE] - torque(record)
    assert np.sqrt((off**2).mean(axis=(0, 1)) / (torque(record) ** 2).mean(axis=(0, 1))).max() > 1e-2


def test_an_arm_that_nothing_bends_while_it_stands_begins_where_the_torque_says() -> None:
    """Without gravity an arm stands in the middle of a gap, where the spring is none; under way it lies at one side.

    Begun with the vibration of the linear model there, which has no spring, 2.7 % of the torque is left.
    """
    robot = sharp("one_axis_true")
    level = robot.with_parameters({n: 0.0 for n in robot.layout if n.startswith("centre_of_mass.")})
    slack = level.with_parameters({"gear_damping.axis_1": 0.3 * level.parameter("gear_damping.axis_1")})
    robot = slack.with_effect("play", "transmission.backlash", "axis_1", values={"gap": 1e-4})
    record = record_of(robot, 2, 30.0)
    assert error(record, robot).max() < 1.2e-2 < 0.1 < error(record, slack).min()


def test_what_cannot_be_prescribed_is_refused() -> None:
    robot = sharp("one_axis_true")
    record = record_of(robot, 1, 30.0)
    (run,) = record.runs
    valid = run.valid.copy()
    valid[0, 0, 0, 0, 7] = False
    with pytest.raises(DataRejected, match="samples are missing"):
        prescribe_record(robot, record.replace(runs=(run.replace(valid=valid),)))
    slower = run.replace(sample_time_s=2 * T, time_s=2 * run.time_s)
    with pytest.raises(
        ConfigurationError, match=r"sampled every 0.002 s and the drives of one_axis_true every 0.001 s"
    ):
        prescribe_record(robot, record.replace(runs=(slower,)))
