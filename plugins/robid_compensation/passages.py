"""Motors of a record without excited lines, ready for order analysis: the rigid robot taken off their torque."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from robid_core import DataRejected, FloatArray, Record, Robot
from robid_core.estimation.distortion.angle_passage import FILTER_ORDER, Passage, kept_samples, passage_of
from robid_core.estimation.rigid.regression import differentiate, smooth
from robid_core.estimation.rigid.rigid_torque import RigidDrives, motor_inertia, motor_torque
from robid_core.residual import rigid_drives

TORQUE, POSITION = "motor_torque", "motor_position"
HELD = "zero_order_hold"
HIGHEST_HZ, OF_RATE = 100.0, 0.2
BELOW = 0.5  # of the lowest resonance: there the arm moves as a rigid one
SLOWEST_HZ = 2.0  # resonances below are pendulums, not springs
ROWS = 2000  # of inverse dynamics at once: its regressor is large
PLACES = 20  # along a motion at which the inertia is taken
FEWEST_PERIODS = 20  # of the low-pass, in an experiment


def passages_by_configuration(
    record: Record, robot: Robot, highest_hz: float | None, discard: int
) -> list[list[list[Passage]]]:
    """Passages of each configuration and axis, one for each experiment, periods joined.

    Raises
    ------
    DataRejected
        Where samples are missing, or an experiment is too short.
    """
    run, drives = record.run, rigid_drives(robot)
    nothing = np.zeros(robot.n_axis)
    drives = replace(drives, viscous=nothing, coulomb=nothing, offset=nothing)
    cutoff = rigid_band_hz(record, robot) if highest_hz is None else highest_hz
    angle, torque = (run.values(name)[:, :, :, discard:] for name in (POSITION, TORQUE))
    if not (np.isfinite(angle).all() and np.isfinite(torque).all() and run.valid[:, :, :, discard:].all()):
        raise DataRejected(
            "compensate.ripple: angle or torque has holes; cut the recording there, or read it with gaps: split"
        )
    n_sample = angle.shape[3] * angle.shape[4]
    if n_sample * run.sample_time_s * cutoff < FEWEST_PERIODS:
        raise DataRejected(
            f"compensate.ripple: an experiment of {n_sample * run.sample_time_s:.3g} s is too short for order analysis "
            f"below {cutoff:g} Hz; record longer, or raise the upper edge of band_hz"
        )
    result = []
    for c in range(len(angle)):
        axes: list[list[Passage]] = [[] for _ in range(robot.n_axis)]
        for index in np.ndindex(*angle.shape[1:3]):
            q, u = (x[c][index].reshape(n_sample, -1) for x in (angle, torque))
            passages = _of_experiment(
                q, u, drives, robot, run.sample_time_s, cutoff, record.torque_hold == HELD
            )
            for own, passage in zip(axes, passages, strict=True):
                own.append(passage)
        result.append(axes)
    return result


def rigid_band_hz(record: Record, robot: Robot) -> float:
    """Edge of the band in which inverse dynamics of the rigid robot hold, Hz."""
    model = robot.second_order(record.angle[:1])
    squares = scipy.linalg.eigvalsh(model.stiffness[0], model.mass[0])
    resonances = np.sqrt(squares[squares > 0]) / (2 * np.pi)
    springs = resonances[resonances > SLOWEST_HZ]
    highest = min(HIGHEST_HZ, OF_RATE / record.run.sample_time_s)
    return float(min(highest, BELOW * springs.min())) if len(springs) else highest


def _of_experiment(
    angle: FloatArray,
    torque: FloatArray,
    drives: RigidDrives,
    robot: Robot,
    sample_time_s: float,
    cutoff_hz: float,
    held: bool,
) -> list[Passage]:
    """Every axis in one experiment, angle and torque (n_sample, n_axis)."""
    kept = kept_samples(len(angle), sample_time_s, cutoff_hz)
    position = smooth(angle, sample_time_s, cutoff_hz, FILTER_ORDER)
    velocity = differentiate(position, sample_time_s)
    acceleration = differentiate(velocity, sample_time_s)
    q, v, a = position[kept], velocity[kept], acceleration[kept]
    rigid = np.concatenate(
        [
            motor_torque(drives, q[k : k + ROWS], v[k : k + ROWS], a[k : k + ROWS])
            for k in range(0, len(q), ROWS)
        ]
    )
    inertia = motor_inertia(drives, q[:: max(len(q) // PLACES, 1)]).mean(axis=0)
    joint = robot.joint_angle(q)
    beside = np.concatenate([np.cos(joint), np.sin(joint)], axis=1)
    return [
        passage_of(
            angle[:, axis],
            torque[:, axis],
            rigid[:, axis],
            beside,
            float(inertia[axis]),
            sample_time_s,
            cutoff_hz,
            held,
        )
        for axis in range(robot.n_axis)
    ]
