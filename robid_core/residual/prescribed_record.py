"""A record made again by inverse dynamics: the torque that the recorded motion takes of a robot.

The twin of `simulate_record` without the loop: nothing corrects a wrong model, and no controller need be known. What is
behind the motors rings on from before the first sample: how, the recorded torque tells, two numbers a spring.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.artifacts import Channel, DenseRun, Record, frozen
from robid_core.errors import DataRejected
from robid_core.estimation.torque.spectra import Hold
from robid_core.estimation.torque.windowed import WindowedMotion, windowed_motion_of
from robid_core.residual.free_vibration import deviation_of, free_vibration, rms_vibration, state_at_first
from robid_core.residual.measured import hold_of
from robid_core.residual.signals import commanded_torque, reported_torque, true_motion
from robid_core.residual.vibration_along_motion import moves_far, vibration_along
from robid_core.robot import Robot
from robid_core.robot.sampling import check_sampling

HIGHEST_HZ = 100.0  # of what tells how the arm rings at the first sample
ROUNDS = 6  # of prescribed motions that find it, at most
BETTER = 0.9  # of what was left: a round that leaves more was the last
MODEL_ERROR = 0.01  # of the rms torque: what else than ringing may be wrong


def prescribe_record(robot: Robot, record: Record) -> Record:
    """Return the record with the motor torques that its motion takes of a robot, as the drives would report them.

    Parameters
    ----------
    robot
        With everything that acts on it: springs, bodies, friction, effects.
    record
        Motor position and motor torque of every axis; it need not repeat. The motion above 480 Hz counts as noise.

    Returns
    -------
    The same runs with another motor torque; all other channels stay.

    Raises
    ------
    ConfigurationError
        If the record and the robot file are not sampled alike.
    DataRejected
        If a sample is missing, or a law on signals cannot be taken off.
    SimulationDiverged
        Where an experiment leaves all bounds.
    """
    runs = tuple(_prescribed(robot, run, hold_of(record)) for run in record.runs)
    return record.replace(source=f"{record.source}, torque of {robot.name}", runs=runs)


def _prescribed(robot: Robot, run: DenseRun, torque_hold: Hold) -> DenseRun:
    check_sampling(run.sample_time_s, robot)
    if not run.valid.all():
        raise DataRejected(
            "samples are missing in the record; cut the recording there, or read it with gaps: split"
        )
    channel = run.channel("motor_torque")
    lanes = (run.lanes(name) for name in ("motor_position", "motor_torque"))
    position, torque = (values.reshape(len(run.valid), -1, *values.shape[1:]) for values in lanes)
    highest = min(HIGHEST_HZ, 0.4 / run.sample_time_s)
    measured = windowed_motion_of(position, torque, run.sample_time_s, highest, torque_hold)
    motion = true_motion(robot, measured)

    def means(omega: FloatArray) -> ComplexArray:
        return motion.mean_share(omega, robot.step_s)[:, None]

    acting = motion.divided(_ringing_as_recorded(robot, motion), means)
    commanded = commanded_torque(robot, replace(motion, torque=acting))
    reported = reported_torque(robot, replace(motion, torque=commanded))
    values = frozen(reported.reshape(channel.values.shape))
    return run.replace(
        channels={**run.channels, "motor_torque": Channel("motor", channel.unit_symbol, values)}
    )


def _ringing_as_recorded(robot: Robot, motion: WindowedMotion) -> FloatArray:
    """Torque that a motion takes, from the initial state with which it is nearest to the recorded one."""
    moved, shape = motion.motor_motion(robot.step_s), motion.angle.shape
    middle = 0.5 * (motion.angle.max(axis=(1, 2)) + motion.angle.min(axis=(1, 2)))
    rms = np.sqrt((motion.torque**2).mean(axis=(0, 1, 2)))
    n_bin, n_axis = len(motion.bin), len(rms)
    whitener = np.zeros((n_bin, n_axis, n_axis), dtype=np.complex128)
    whitener[:] = np.diag(np.sqrt(n_bin) / (MODEL_ERROR * rms))
    prior = rms_vibration(robot, robot.joint_angle(middle), motion)
    along = bool(robot.bending_forces) or moves_far(robot, motion)

    def torque_from(deviation: FloatArray) -> FloatArray:
        state = state_at_first(robot, moved.angle, moved.speed, deviation)
        return robot.prescribe(moved, state).torque.reshape(shape)

    vibration = None if along else free_vibration(robot, motion)
    deviation = np.zeros((*shape[:2], prior.shape[1]))
    best, before = motion.torque, np.inf
    for _ in range(ROUNDS):
        torque = torque_from(deviation)
        residual = motion.torque_spectrum - motion.spectrum_of(torque)
        left = float((np.abs(np.matmul(whitener, residual[..., None])) ** 2).sum())
        if left < before:
            best = torque
        if left > BETTER * before or robot.mechanism.n_coordinate == robot.n_axis:
            break
        before = left
        if along:
            vibration = vibration_along(robot, motion, moved, deviation, prior, motion.spectrum_of)
        assert vibration is not None
        deviation = deviation + deviation_of(residual, vibration, whitener, prior)
    return best
