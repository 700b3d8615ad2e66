"""Experiments that could come next: recorded motions in other configurations and of other amplitudes, simulated.

A robot is driven in closed loop by the recorded speeds, or, where no reference was recorded, by those that the motors
had. Periods scatter as the recorded ones did, so that noise is that of the drives. What leaves the robot's limits or
reaches that of a torque is no experiment.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core import (
    BoolArray,
    Channel,
    DenseRun,
    FloatArray,
    IntArray,
    Record,
    RobidError,
    Robot,
    mean_travel,
)

DRAWN = 12  # configurations
KEPT = 4  # recorded configurations, of all
AMPLITUDES = (0.5, 1.0, 2.0)  # of the recorded speeds
MARGIN = 0.05  # of a joint's range, free at either end
HELD = 0.5  # of a motor's torque limit: what holding the arm may take
SETTLING_S = 1.0  # run before a period, in whole periods
ALIKE = 1e-3  # of a sampling time: a record whose drives controlled at another rate cannot be simulated
FULL = 0.98  # of a torque limit: it is reached


@dataclass(frozen=True, eq=False)
class Proposals:
    """Experiments of one amplitude after one record, each in a configuration of its own."""

    record: Record
    """As the robot is expected to give it, (n_lane, 1, 1, n_period, n_sample, n_axis)."""
    amplitude: float
    reference: FloatArray
    """rad/s at the motors, (n_lane, n_sample, n_axis)."""
    recorded: BoolArray
    """Which stand where they stood, (n_lane,); with an amplitude of one these are repeats."""
    n_settling: int
    """Periods before those that count."""
    duration_s: float
    """Of each, settling included."""


@dataclass(frozen=True, eq=False)
class _Lanes:
    """Experiments of a record: what is asked of the motors, how periods scatter, where."""

    reference: FloatArray
    """rad/s, (n_lane, n_sample, n_axis)."""
    position: FloatArray
    """Of each period less their mean, rad, (n_lane, n_period, n_sample, n_axis)."""
    torque: FloatArray
    """Likewise, N m."""
    middle: FloatArray
    """Motor angle about which it moved, (n_lane, n_axis)."""


def proposals(
    records: Sequence[Record], robot: Robot, discard: int, generator: np.random.Generator
) -> Iterator[Proposals]:
    """Yield what could be measured next with a robot that was measured, simulated with that robot.

    Each record and amplitude makes one of them; each drawn configuration goes to one record. What diverges is left out.
    """
    drawn = np.array_split(drawn_configurations(robot, DRAWN, generator), len(records))
    for record, elsewhere in zip(records, drawn, strict=True):
        if abs(record.run.sample_time_s / robot.sample_time_s - 1) > ALIKE:
            continue
        lanes = _lanes(record, discard)
        n_kept = min(max(KEPT // len(records), 1), len(lanes.middle))
        kept = np.unique(np.linspace(0, len(lanes.middle) - 1, n_kept).round().astype(int))
        source = np.concatenate((kept, np.arange(len(elsewhere)) % len(lanes.middle)))
        angle = np.concatenate((robot.joint_angle(lanes.middle[kept]), elsewhere))
        recorded = np.arange(len(angle)) < len(kept)
        for amplitude in AMPLITUDES:
            try:
                found = _simulated(record, robot, lanes, source, angle, recorded, amplitude)
            except RobidError:
                continue
            if found is not None:
                yield found


def drawn_configurations(robot: Robot, count: int, generator: np.random.Generator) -> FloatArray:
    """Configurations within the limits that the motors can hold, (at most count, n_axis)."""
    lower = np.where(np.isfinite(robot.drives.lower), robot.drives.lower, -np.pi)
    upper = np.where(np.isfinite(robot.drives.upper), robot.drives.upper, np.pi)
    sampler = scipy.stats.qmc.LatinHypercube(robot.n_axis, rng=generator)
    angle = lower + (MARGIN + (1 - 2 * MARGIN) * sampler.random(2 * count)) * (upper - lower)
    torque = np.abs(robot.equilibrium(angle, partial=True).torque)  # NaN where the arm has no stable rest
    found: FloatArray = angle[(torque <= HELD * robot.drives.torque_limit).all(axis=1)][:count]
    return found


def _lanes(record: Record, discard: int) -> _Lanes:
    """Experiments of a record, periods apart."""
    run = record.run

    def periods(name: str) -> FloatArray:
        values = run.values(name)[:, :, :, discard:]
        whole = (1, values.shape[3] * values.shape[4], values.shape[5])
        return values.reshape(-1, *(whole if record.line is None else values.shape[3:]))

    position, torque = periods("motor_position"), periods("motor_torque")
    mean = position.mean(axis=1)
    if "speed_reference" in run.channels and np.isfinite(run.values("speed_reference")).all():
        reference = periods("speed_reference").mean(axis=1)
        if record.line is not None:  # periods come back to where they began, to the last digit
            reference = reference - reference.mean(axis=1, keepdims=True)
    elif record.line is None:
        reference = np.gradient(mean, run.sample_time_s, axis=1)
    else:
        omega = 2 * np.pi * np.fft.rfftfreq(mean.shape[1], run.sample_time_s)
        reference = np.fft.irfft(1j * omega[:, None] * np.fft.rfft(mean, axis=1), mean.shape[1], axis=1)
    return _Lanes(
        reference, position - mean[:, None], torque - torque.mean(axis=1, keepdims=True), mean.mean(axis=1)
    )


def _simulated(
    record: Record,
    robot: Robot,
    lanes: _Lanes,
    source: IntArray,
    angle: FloatArray,
    recorded: BoolArray,
    amplitude: float,
) -> Proposals | None:
    """Simulate some lanes elsewhere; None where all leave the limits."""
    run, reference = record.run, amplitude * lanes.reference[source]
    n_sample = reference.shape[1]
    before = 0 if record.line is None else max(1, int(np.ceil(SETTLING_S / (n_sample * run.sample_time_s))))
    start = robot.motor_angle(angle) - mean_travel(reference, run.sample_time_s)
    done = robot.simulate(np.tile(reference, (1, before + 1, 1)), robot.joint_angle(start))
    good = _within_limits(robot, done.position, done.torque, run.sample_time_s)
    if not good.any():
        return None
    channels = {}
    for name, values, scatter in (
        ("motor_position", done.position, lanes.position),
        ("motor_torque", done.torque, lanes.torque),
    ):
        last = values[good][:, -n_sample:]
        each = last[:, None] + scatter[source][good]
        channels[name] = Channel("motor", run.channel(name).unit_symbol, each[:, None, None])
    n_period = lanes.position.shape[1]
    time = run.sample_time_s * np.arange(n_sample, dtype=np.float64)
    shape = (int(good.sum()), 1, 1, n_period, n_sample)
    dense = DenseRun(run.sample_time_s, channels, time, np.ones(shape, dtype=bool))
    expected = Record(
        record.axis_names, "expected", record.torque_hold, (dense,), angle[good], line=record.line
    )
    seconds = (before + n_period) * n_sample * run.sample_time_s
    return Proposals(expected, amplitude, reference[good], recorded[good], before, seconds)


def _within_limits(robot: Robot, position: FloatArray, torque: FloatArray, sample_time_s: float) -> BoolArray:
    """Which lanes stay within the limits of angle, speed and torque, (n_lane,)."""
    limits = robot.limits
    speed = np.abs(np.diff(position, axis=1)) / sample_time_s
    good: BoolArray = np.logical_and.reduce(
        (
            ((position >= limits.lower) & (position <= limits.upper)).all(axis=(1, 2)),
            (speed <= limits.speed).all(axis=(1, 2)),
            (np.abs(torque) < FULL * robot.drives.torque_limit).all(axis=(1, 2)),
        )
    )
    return good
