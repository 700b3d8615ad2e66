"""What motor and link encoders of one axis tell of its gear: deflection against torque, direction and time.

The link's angle less the motor's (both at the joint) is written as

    e = zero + scale q - d v - T / K + r sign(v) [+ p sign(T)] [+ s sin q + c cos q]

with q, v the motor's angle and speed, T the torque at the gear, less what the rotor takes. A link channel that comes
late by d looks like ``-d v``, and so does damping: these data do not tell them apart, and d is no part of the
stiffness. A friction F at the motor's side makes T too large by ``F sign(v)``, which adds ``F / K`` to r; one behind
the gear does not. An encoder that sits off its centre makes waves of one period a turn, a load by gravity may, too.
Terms in brackets may be there or not, and the load that turns is the torque with or without F: the intervals are those
of all choices together. A stiffness is as sure as the torque's scale, which widens 1/K.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core import FloatArray
from robid_core.estimation.rigid.regression import differentiate, smooth

FINER = 4.0  # times the band: of speed and acceleration, before all columns get the same low-pass
ROUNDS = 6  # of the time shift
SETTLED = 1e-3  # of a sample: the shift stays
SHORTEST = 1e-2  # of a sample: no shift is surer
DIRECTION = 0.01  # of the largest speed: friction has turned there
REVERSED = 0.02  # of the largest torque: likewise, play
TAPS = 3  # samples before and after from which a computed channel may be made
ON_GRID = 0.02  # of a step: values that are rounded miss the grid by no more, others by a quarter
FINEST = 1e-9  # of the travel: nearer values are the same
ROUNDING = 0.35  # of a step: rms error of rounding, 12^-1/2, with some room
TURNS = 0.1  # of the largest torque on either side: play shows
LEVEL = 0.975  # of Student's distribution: 95 %

ZERO, SCALE, SPEED, LOAD, DIRECTED, PLAY = range(6)  # columns


@dataclass(frozen=True, eq=False)
class AxisMotion:
    """Signals of one axis in one experiment, (n_sample,) each, at the joint."""

    motor: FloatArray
    """Angle, rad."""
    link: FloatArray
    """Angle by the link's encoder, rad."""
    torque: FloatArray
    """At the gear, by the motor's torque, N m; what the rotor takes is still in it."""
    rotor: float
    """Inertia of the rotor at the joint, kg m^2."""
    sample_time_s: float


@dataclass(frozen=True)
class Interval:
    """Lower and upper bound of a number."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        """Half way."""
        return 0.5 * (self.low + self.high)

    @property
    def half(self) -> float:
        """Half of its width."""
        return 0.5 * (self.high - self.low)


@dataclass(frozen=True)
class Deflection:
    """What was found at one axis; intervals are of 95 %, over all choices of the model."""

    shift_s: Interval
    """By which the link's channel comes late, s, damping among it."""
    compliance: Interval
    """1/K, rad/(N m)."""
    reversal: Interval
    """By which the link hangs back when the direction turns, rad, whole width; friction may be on either side."""
    play: Interval | None
    """Likewise, when the torque turns; None where it does not."""
    left: float
    """Rms of what nothing of this explains, rad."""
    size: float
    """Rms of the deflection with its shift taken off, rad."""
    own: float
    """Share of the torque's square that angle, speed and direction do not have, too."""


def step_of(values: FloatArray) -> float:
    """Step to which values are rounded; zero where they lie on no grid."""
    each = np.unique(values)
    apart = np.diff(each)
    apart = apart[apart > FINEST * max(np.ptp(values), 1e-300)]
    if len(apart) < TAPS:
        return 0.0
    step = float(apart.min())
    miss = np.abs(apart / step - np.round(apart / step))
    return step if miss.mean() < ON_GRID else 0.0


def is_computed(motor: FloatArray, link: FloatArray) -> bool:
    """Whether a link's angle is the motor's at nearby samples, scaled and summed, to its last digit.

    Such a channel was computed, or its encoder is too coarse to see anything else; neither tells of the gear.
    """
    n = len(motor) - 2 * TAPS
    columns = np.stack([motor[k : k + n] for k in range(2 * TAPS + 1)] + [np.ones(n)], axis=1)
    middle = columns.mean(axis=0)
    middle[-1] = 0.0
    target = link[TAPS : TAPS + n] - link.mean()
    sizes, *_ = np.linalg.lstsq(columns - middle, target, rcond=None)
    left = float(np.std(target - (columns - middle) @ sizes))
    return left <= max(ROUNDING * step_of(link), FINEST * float(np.ptp(link)))


def deflection_of(
    motions: Sequence[AxisMotion],
    highest_hz: float,
    skip_s: float,
    n_block: int,
    friction: float,
    torque_error: float,
) -> Deflection:
    """Fit one axis.

    Parameters
    ----------
    motions
        Experiments.
    highest_hz
        Edge of the low-pass that everything goes through.
    skip_s
        Left out at both ends of each experiment.
    n_block
        Consecutive parts, of which each is left out once: their scatter makes the intervals.
    friction
        Coulomb friction of the motor at the joint, N m, which may act before the gear.
    torque_error
        Share by which all torques may be wrong.
    """
    shift = 0.0
    for _ in range(ROUNDS):
        columns, e = _equations(motions, shift, highest_hz, skip_s, friction)
        size, *_ = np.linalg.lstsq(columns.least, e, rcond=None)
        shift -= float(size[SPEED])
        if abs(size[SPEED]) < SETTLED * motions[0].sample_time_s:
            break
    columns, e = _equations(motions, shift, highest_hz, skip_s, friction)
    turns = bool(min(columns.load.max(), -columns.load.min()) > TURNS * np.abs(columns.load).max())
    plays = (None, 0, 1) if turns else (None,)
    choices = list(itertools.product((False, True), plays))
    found = [_jackknife(columns.chosen(waves, play), e, n_block) for waves, play in choices]
    resolution = max(step_of(one.link) for one in motions) / max(float(np.ptp(columns.load)), 1e-300)
    c = _union([(-value[LOAD], error[LOAD] + resolution) for value, error in found])
    c = Interval(
        *(end * (1 + torque_error * sign * np.sign(end)) for end, sign in ((c.low, -1), (c.high, 1)))
    )
    r = _union([(value[DIRECTED], error[DIRECTED]) for value, error in found])
    least = SHORTEST * motions[0].sample_time_s
    late = _union([(shift - value[SPEED], max(error[SPEED], least)) for value, error in found])
    with_play = [
        (-2 * value[PLAY], 2 * error[PLAY])
        for (value, error), (_, play) in zip(found, choices, strict=True)
        if play is not None
    ]
    load, others = columns.load, np.delete(columns.least, LOAD, axis=1)
    return Deflection(
        shift_s=late,
        compliance=c,
        reversal=Interval(-2 * r.high, 2 * (max(c.high, 0.0) * friction - r.low)),
        play=_union(with_play) if with_play else None,
        left=_left(columns.least, e),
        size=_left(columns.least[:, :LOAD], e),
        own=(_left(others, load) / max(float(np.std(load)), 1e-300)) ** 2,
    )


@dataclass(frozen=True, eq=False)
class _Columns:
    """Columns of the fit, through the low-pass, (n_row, n)."""

    least: FloatArray
    play: FloatArray
    waves: FloatArray

    @property
    def load(self) -> FloatArray:
        return self.least[:, LOAD]

    def chosen(self, waves: bool, play: int | None) -> FloatArray:
        """Return columns: with the encoder's waves or not, with one of the columns of play or none."""
        own = [] if play is None else [self.play[:, play : play + 1]]
        parts = [self.least, *own, *([self.waves] if waves else [])]
        return np.concatenate(parts, axis=1)


def _equations(
    motions: Sequence[AxisMotion], shift: float, highest_hz: float, skip_s: float, friction: float
) -> tuple[_Columns, FloatArray]:
    """Columns, and the deflection with a time shift of the link's channel taken off, (n_row,)."""
    moved = [(_kinematics(one, highest_hz), one) for one in motions]
    fastest = max(float(np.abs(speed).max()) for (_, speed, _), _ in moved)
    loads = [one.torque - one.rotor * acceleration for (_, _, acceleration), one in moved]
    largest = max(float(np.abs(load).max()) for load in loads)
    rows: list[FloatArray] = []
    for ((angle, speed, _), one), load in zip(moved, loads, strict=True):
        time = one.sample_time_s * np.arange(len(angle))
        link = scipy.interpolate.CubicSpline(time, one.link)(time + shift)
        direction = np.tanh(speed / (DIRECTION * fastest))
        columns = [
            np.ones_like(angle), angle, speed, load, direction,
            *(np.tanh((load - own * direction) / (REVERSED * largest)) for own in (0.0, friction)),
            np.sin(angle), np.cos(angle), link - one.motor,
        ]  # fmt: skip
        skip = round((skip_s + abs(shift)) / one.sample_time_s)
        passed = smooth(np.stack(columns, axis=1), one.sample_time_s, highest_hz)
        rows.append(passed[skip : len(angle) - skip])
    whole = np.concatenate(rows)
    return _Columns(whole[:, : DIRECTED + 1], whole[:, PLAY : PLAY + 2], whole[:, -3:-1]), whole[:, -1]


def _kinematics(one: AxisMotion, highest_hz: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angle, speed and acceleration of the motor."""
    highest = min(FINER * highest_hz, 0.4 / one.sample_time_s)
    angle = smooth(one.motor, one.sample_time_s, highest)
    speed = differentiate(angle, one.sample_time_s)
    return angle, speed, differentiate(speed, one.sample_time_s)


def _jackknife(columns: FloatArray, e: FloatArray, n_block: int) -> tuple[FloatArray, FloatArray]:
    """Sizes of columns, and half widths of their intervals: each of consecutive blocks is left out once."""
    scale = np.sqrt((columns**2).mean(axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    blocks = np.array_split(np.arange(len(e)), n_block)
    rows = columns / scale
    matrices = np.stack([rows[own].T @ rows[own] for own in blocks])
    gradients = np.stack([rows[own].T @ e[own] for own in blocks])
    whole = np.linalg.lstsq(matrices.sum(axis=0), gradients.sum(axis=0), rcond=None)[0]
    without = np.stack(
        [
            np.linalg.lstsq(matrices.sum(axis=0) - m, gradients.sum(axis=0) - g, rcond=None)[0]
            for m, g in zip(matrices, gradients, strict=True)
        ]
    )
    error = np.sqrt((n_block - 1) * without.var(axis=0))
    wide = float(scipy.stats.t.ppf(LEVEL, n_block - 1))
    return whole / scale, wide * error / scale


def _left(columns: FloatArray, values: FloatArray) -> float:
    """Rms of what columns do not explain of some values."""
    size, *_ = np.linalg.lstsq(columns, values, rcond=None)
    return float(np.std(values - columns @ size))


def _union(found: Sequence[tuple[float, float]]) -> Interval:
    """Return the interval that holds those of all choices."""
    return Interval(
        float(min(value - half for value, half in found)), float(max(value + half for value, half in found))
    )
