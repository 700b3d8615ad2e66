"""Motions at constant speeds, to and fro, for friction: the speed profile, and its plateaus found again in a reference.

At constant speed the motor's torque is friction and gravity; a sweep to and one fro over the same angles have the
same gravity, and half their difference is friction (Armstrong-Helouvry, Dupont and Canudas de Wit 1994, section 5).
A plateau of whole motor turns averages out what repeats with the motor angle. Ramps have no step in acceleration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray

SETTLE_S = 0.4  # cut off at both ends of a plateau: three time constants of a speed loop at 8 rad/s
SETTLE_RAD = (
    2.5  # and this angle: until a reversed motor breaks away, its reference runs 2 Coulomb / integral gain
)
EVEN = 1e-9  # relative change of speed between samples of one plateau: any ramp changes more


@dataclass(frozen=True)
class Sweep:
    """One speed of the ladder: samples of each ramp, of the settling at both ends, and of what is measured."""

    speed: float
    n_ramp: int
    n_settle: int
    n_measured: int
    whole_turns: int
    """Motor turns in what is measured; 0 where it is no whole number."""

    def travel(self, sample_time_s: float) -> float:
        """Angle from end to end, rad; both ramps together have half their samples' speed."""
        return self.speed * (self.n_ramp - 1 + 2 * self.n_settle + self.n_measured) * sample_time_s

    def profile(self) -> FloatArray:
        """Speed from rest to rest, rad/s, shape (2 n_ramp - 2 + plateau,); settling and measuring are one plateau."""
        up = self.speed * smooth_step(self.n_ramp)
        return np.concatenate([up, np.full(2 * self.n_settle + self.n_measured, self.speed), up[::-1]])


def smooth_step(n_ramp: int) -> FloatArray:
    """Rise from 0 to 1 in `n_ramp` samples, ends not included: ``x - sin(2 pi x) / (2 pi)``, shape (n_ramp - 1,).

    Zero slope and zero second derivative at the ends' speeds: peak slope is twice the mean one, and the jerk is finite.
    """
    x = np.arange(1, n_ramp) / n_ramp
    result: FloatArray = x - np.sin(2 * np.pi * x) / (2 * np.pi)
    return result


def shift(angle: float, n_sample: int, sample_time_s: float) -> FloatArray:
    """Speed of a move by `angle` from rest to rest in `n_sample` samples, ``1 - cos``; its samples add up exactly."""
    bump = 1.0 - np.cos(2 * np.pi * np.arange(1, n_sample) / n_sample)
    result: FloatArray = bump * (angle / (n_sample * sample_time_s))
    return result


@dataclass(frozen=True)
class SweepTimes:
    """What decides how long a sweep takes, s; `acceleration` is the peak of the ramps, rad/s^2.

    Settling takes a time, and an angle on top.
    """

    sample_time_s: float
    acceleration: float
    shortest_ramp_s: float
    measured_s: float
    longest_s: float
    settle_s: float = SETTLE_S
    settle_rad: float = SETTLE_RAD


def plan_sweep(speed: float, times: SweepTimes, room: float) -> Sweep | None:
    """A sweep at a speed within `room` rad from end to end; None where even the shortest does not fit.

    Measured are as many whole motor turns as the shortest time asks for, unless they take longer than the longest
    time or more room than there is: then fewer, in no less than half the shortest time, and at last the shortest time
    with no whole turn. With whole turns the speed is moved by half a sample's share at most: they end on a sample.

    Parameters
    ----------
    speed
        Motor speed, rad/s, positive.
    times
        Times and the acceleration of the ramps.
    room
        Angle from end to end, rad.
    """
    step = times.sample_time_s
    turn_s = 2 * np.pi / speed
    wanted = int(np.ceil(times.measured_s / turn_s - 1e-9))
    choices = [(round(turns * turn_s / step), turns) for turns in range(wanted, 0, -1)]
    choices = [
        (n, turns)
        for n, turns in choices
        if n >= 2 and times.measured_s <= 2 * n * step <= 2 * times.longest_s
    ]
    for n_measured, turns in [*choices, (max(int(np.ceil(times.measured_s / step)), 2), 0)]:
        moved = turns * 2 * np.pi / (n_measured * step) if turns else speed
        ramp_s = max(2 * moved / times.acceleration, times.shortest_ramp_s)
        n_settle = _settling(moved, step, times.settle_s, times.settle_rad)
        sweep = Sweep(moved, max(int(np.ceil(ramp_s / step)), 2), n_settle, n_measured, turns)
        if sweep.travel(step) <= room:
            return sweep
    return None


def _settling(speed: float, sample_time_s: float, settle_s: float, settle_rad: float) -> int:
    """Samples that settling takes at a speed, rad/s."""
    return int(np.ceil((settle_s + settle_rad / speed) / sample_time_s - 1e-6))


def highest_speed(times: SweepTimes, room: float) -> float:
    """Speed whose shortest sweep just fits into `room` rad, rad/s; 0 where none does.

    ``v (2 v / a + T) = room`` with T the time of the plateau, or ``v (shortest ramp + T) = room`` where that is less;
    the angles of settling are taken off the room.
    """
    room = max(room - 2 * times.settle_rad, 0.0)
    plateau = 2 * times.settle_s + times.measured_s + 5 * times.sample_time_s  # samples are rounded up
    by_ramp = 0.25 * times.acceleration * (np.sqrt(plateau**2 + 8 * room / times.acceleration) - plateau)
    return float(min(by_ramp, room / (plateau + times.shortest_ramp_s)))


def sweeps_reference(
    sweeps: list[Sweep], sample_time_s: float, rest_s: float, acceleration: float
) -> FloatArray:
    """Speed of all sweeps after one another, each to and fro, rad/s, shape (n_sample,).

    Every sweep goes from half its travel below the middle to half above and back over the same angles; between them
    a short move brings the motor to where the next one begins. It starts and ends at rest in the middle.

    Parameters
    ----------
    sweeps
        In the order in which they are made.
    sample_time_s
        Time between samples.
    rest_s
        Standstill at every turning point.
    acceleration
        Peak acceleration of the moves between the sweeps, rad/s^2; they are no faster than the fastest sweep.
    """
    rest = np.zeros(max(int(np.ceil(rest_s / sample_time_s)), 2))
    parts, place, fastest = [rest[:1]], 0.0, max(sweep.speed for sweep in sweeps)

    def move_to(target: float) -> None:
        nonlocal place
        if target != place:
            # `shift` reaches the speed 2 |angle| / T and the acceleration 2 pi |angle| / T^2.
            angle = abs(target - place)
            duration = max(np.sqrt(2 * np.pi * angle / acceleration), 2 * angle / fastest)
            n_shift = max(int(np.ceil(duration / sample_time_s)), 2)
            parts.extend([shift(target - place, n_shift, sample_time_s), rest])
            place = target

    for sweep in sweeps:
        move_to(-0.5 * sweep.travel(sample_time_s))
        parts += [sweep.profile(), rest, -sweep.profile(), rest]
    move_to(0.0)
    return np.concatenate(parts)


@dataclass(frozen=True)
class Plateau:
    """Samples `first` to `last` - 1 of one experiment, during which one axis is asked for a constant speed."""

    axis: int
    first: int
    last: int
    speed: float
    """rad/s, with its sign."""

    @property
    def samples(self) -> slice:
        """For indexing the samples of an experiment."""
        return slice(self.first, self.last)


def plateaus(
    reference: FloatArray,
    sample_time_s: float,
    settle_s: float = SETTLE_S,
    settle_rad: float = SETTLE_RAD,
    shortest_s: float = 0.05,
) -> tuple[Plateau, ...]:
    """Samples at constant speed, found in a speed reference alone; standstill is none.

    A plateau are neighbouring samples of the same speed within EVEN; settling is cut off at both ends, so that a
    sweep to and one fro cover the same angles. What is left is cut to whole motor turns where it has one, the same
    at both ends: a reference that went through a drive's increments may have a few equal samples more.

    Parameters
    ----------
    reference
        Speed of the motors, rad/s, shape (n_sample, n_axis).
    sample_time_s
        Time between samples.
    settle_s, settle_rad
        Time and, on top, angle cut off at both ends of a plateau; those with which the sweeps were made.
    shortest_s
        Plateaus that are shorter after that are left out.

    Returns
    -------
    In the order of axes, then of time.
    """
    found = []
    for axis, speed in enumerate(reference.T):
        even = np.abs(np.diff(speed)) <= EVEN * np.abs(speed[1:])
        even &= speed[1:] != 0
        edges = np.flatnonzero(np.diff(np.concatenate([[False], even, [False]]).astype(np.int8)))
        for first, last in zip(edges[::2].tolist(), (edges[1::2] + 1).tolist(), strict=True):
            middle = float(np.median(speed[first:last]))
            n_settle = _settling(abs(middle), sample_time_s, settle_s, settle_rad)
            begin, end = whole_turns(first + n_settle, last - n_settle, abs(middle) * sample_time_s)
            if (end - begin) * sample_time_s >= shortest_s:
                found.append(Plateau(axis, begin, end, middle))
    return tuple(found)


def whole_turns(first: int, last: int, angle: float) -> tuple[int, int]:
    """Middle part of samples that is whole turns at `angle` rad per sample; all of them where there is none."""
    turns = int((last - first + 0.5) * angle / (2 * np.pi))  # whole within half a sample
    if turns < 1:
        return first, last
    surplus = last - first - round(turns * 2 * np.pi / angle)
    return first + surplus // 2, last - (surplus - surplus // 2)
