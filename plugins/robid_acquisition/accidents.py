"""Accidents in recorded signals: spikes, lost counts, lost rows. They stand out from all other samples."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from robid_core import FloatArray, Record

POSITION, TORQUE = "motor_position", "motor_torque"
# Times all but one in a hundred: of a million normal values the largest reaches 2, of exponential ones 3, and of motion
# that was recorded 4; twice that is none of these.
OUT = 8.0
SHARE = (
    0.003  # of the samples: each spoils three second differences, and a hundredth of them moves the quantile
)
SHORTEST = 100  # samples
NEAR = 3  # samples: nearer, accidents are one
BESIDE = 10  # samples on each side of a step, from which the speed there is taken
STAYS = 0.5  # of a step, after it: a spike returns at once
ALIKE = 0.25  # of the mean: numbers of lost rows by two axes that differ by less agree


@dataclass(frozen=True)
class Accident:
    """A sample of one axis that no motion makes."""

    experiment: int
    sample: int
    size: float
    """In the unit of the channel."""


def accidents_in(lanes: dict[str, list[FloatArray]], record: Record) -> Iterator[str]:
    """Say where an angle does what no acceleration makes, and where single samples of a torque lie beside all others.

    Parameters
    ----------
    lanes
        Experiments without holes by channel, (n_sample, n_axis) each.
    record
        Of which they are.
    """
    step, n_axis = record.runs[0].sample_time_s, len(record.axis_names)
    angles = _accidents(lanes[POSITION], n_axis, _bends)
    rows = _lost_rows(lanes[POSITION], angles)
    if rows:
        (_, first), number = min(rows.items())
        places = "one place" if len(rows) == 1 else f"{len(rows)} places"
        many = f" (about {number:.0f} samples)" if np.isfinite(number) else ""
        yield (
            f"rows are missing at {places}, the first at {first * step:.4g} s of its experiment: several angles step "
            f"there at once, as if time had passed{many}; give the column of the time (time_column), with gaps: mask "
            "or split, or cut the recording there (start_s, stop_s)"
        )
    for name, found in ((POSITION, angles), (TORQUE, _accidents(lanes[TORQUE], n_axis, _lonely))):
        for of, own in zip(record.axis_names, found, strict=True):
            left = [one for one in own if name == TORQUE or not _is_near(one, rows)]
            if left:
                sort = "spike" if len(left) == 1 else "spikes"
                other = "" if name == TORQUE else ", or lost counts"
                yield (
                    f"{name} of {of} has {len(left)} {sort}{other}, the first by {left[0].size:.3g} "
                    f"{record.runs[0].channel(name).unit_symbol} at {left[0].sample * step:.4g} s of its experiment: "
                    "look at the cable and the counter, and leave them out (NaN, with gaps: mask or split)"
                )


def _accidents(
    lanes: list[FloatArray], n_axis: int, measure: Callable[[FloatArray], FloatArray]
) -> list[list[Accident]]:
    """Accidents of each axis."""
    return [
        [
            Accident(number, *place)
            for number, lane in enumerate(lanes)
            if len(lane) > SHORTEST
            for place in _places(measure(lane[:, axis]), lane[:, axis])
        ]
        for axis in range(n_axis)
    ]


def _lost_rows(lanes: list[FloatArray], found: list[list[Accident]]) -> dict[tuple[int, int], float]:
    """Where rows are missing, after a sample of an experiment, and how many, NaN where axes do not agree about it.

    Angles of two axes and more step there at once, and stay. An axis that goes on at its own speed has lost the time
    that its step takes.
    """
    rows = dict[tuple[int, int], float]()
    for place in sorted({(one.experiment, one.sample) for own in found for one in own}):
        number, sample = place
        axes = [a for a, own in enumerate(found) if any(_is_near(one, [place]) for one in own)]
        steps = [_step_at(lanes[number][:, a], sample) for a in axes]
        counts = [count for stays, count in steps if stays]
        if len(counts) > 1 and not _is_near(Accident(number, sample, 0.0), rows):
            mean = float(np.mean(counts))
            rows[place] = mean if mean > 1 and np.ptp(counts) < ALIKE * mean else np.nan
    return rows


def _is_near(one: Accident, places: Iterable[tuple[int, int]]) -> bool:
    return any(number == one.experiment and abs(sample - one.sample) <= NEAR for number, sample in places)


def _step_at(values: FloatArray, sample: int) -> tuple[bool, float]:
    """Whether an angle stays where it stepped to, and the step there over the mean step beside it, less one."""
    steps = np.diff(values)
    near = steps[max(0, sample - 1) : sample + 2]
    beside = np.concatenate((steps[max(0, sample - 1 - BESIDE) : sample - 1], steps[sample + 2 :][:BESIDE]))
    usual = float(np.mean(beside)) if len(beside) else 0.0
    largest = float(near[np.argmax(np.abs(near))])
    lasting = float(near.sum()) - len(near) * usual
    return abs(lasting) > STAYS * abs(largest - usual), largest / usual - 1 if usual else 0.0


def _bends(values: FloatArray) -> FloatArray:
    """Second difference, (n_sample - 2,)."""
    result: FloatArray = np.diff(values, 2)
    return result


def _lonely(values: FloatArray) -> FloatArray:
    """By how much a sample lies beyond both its neighbours, (n_sample - 2,): what rises over several is no spike."""
    before, after = np.diff(values)[:-1], -np.diff(values)[1:]
    result: FloatArray = np.where(before * after > 0, np.minimum(np.abs(before), np.abs(after)), 0.0)
    return result


def _places(measure: FloatArray, values: FloatArray) -> list[tuple[int, float]]:
    """Samples at which a measure stands out, one for each accident, and by how much."""
    size = np.abs(measure)
    steps = np.abs(np.diff(values))
    count = float(steps[steps > 0].min(initial=np.inf))
    usual = max(float(np.quantile(size, 0.99)), 2 * count if np.isfinite(count) else 0.0)
    out = np.flatnonzero(size > OUT * usual)
    if not len(out):
        return []
    first = out[np.concatenate(([True], np.diff(out) > NEAR))]
    if len(first) > SHARE * len(size):
        return []
    return [(int(k) + 1, float(size[k])) for k in first]
