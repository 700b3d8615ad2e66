"""Signals that cannot be what they are said to be: angles that jump as a counter does, torques that a limit cut off."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid_core import DataRejected, FloatArray, Record

POSITIONS = ("motor_position", "joint_position")
TORQUES = ("motor_torque", "joint_torque")
JUMP = 0.4  # of all that an angle spans, within one sample
STEPS = 20.0  # times the largest of all other steps, but for one in a hundred
SHORTEST = 50  # samples: in fewer a jump may be a motion
NEAR = 0.05  # of a torque's range, below its largest value
CUT = 3.0  # times as many samples at the largest value as at any near it: noise repeats none, coarse values alike
SHARE = 0.005  # of all samples


def refuse_jumps(record: Record) -> None:
    """Raise DataRejected where an angle jumps by a large part of all that it spans: a counter that wraps."""
    for run in record.runs:
        for name in POSITIONS:
            if name not in run.channels:
                continue
            channel = run.channel(name)
            for values in run.lanes(name):
                for axis, own in zip(record.axis_names, values.T, strict=True):
                    jumps = _jumps(own[np.isfinite(own)])
                    if len(jumps):
                        raise DataRejected(
                            f"{name} of {axis} jumps by {jumps[0]:.4g} {channel.unit_symbol} from one sample to the "
                            f"next, {len(jumps)} times: it wraps; say at what (wrap, in the unit of the file), or cut "
                            "the recording there"
                        )


def doubts_of_limits(record: Record) -> Iterator[str]:
    """Say which torques stay at their largest or smallest value, as those do that a limit has cut off."""
    for name in TORQUES:
        for k, axis in enumerate(record.axis_names):
            lanes = [run.lanes(name)[..., k] for run in record.runs if name in run.channels]
            values = np.concatenate([lane.ravel() for lane in lanes]) if lanes else np.empty(0)
            values = values[np.isfinite(values)]
            share = max((_cut_share(values), _cut_share(-values))) if len(values) else 0.0
            if share > SHARE:
                unit = record.runs[0].channel(name).unit_symbol
                yield (
                    f"{name} of {axis} stays at its largest value, {np.abs(values).max():.4g} {unit}, in "
                    f"{100 * share:.2g} % of the samples: a limit has cut it off, and what is estimated from it is too "
                    "small; record smaller motions, or leave these samples out (enable, gaps: split)"
                )


def _jumps(values: FloatArray) -> FloatArray:
    """Sizes of steps that no motion makes, (n_jump,)."""
    if len(values) < SHORTEST:
        return np.empty(0)
    steps = np.diff(values)
    size = np.abs(steps)
    jumps = (size > JUMP * np.ptp(values)) & (size > STEPS * float(np.quantile(size, 0.99)))
    back = jumps[1:] & jumps[:-1] & (steps[1:] * steps[:-1] < 0)  # spikes, which return at once
    jumps[1:] &= ~back
    jumps[:-1] &= ~back
    result: FloatArray = size[jumps]
    return result


def _cut_share(values: FloatArray) -> float:
    """Share of samples at the largest value, where far more have it than any value near it; else zero."""
    most, span = float(values.max()), float(np.ptp(values))
    if span == 0:
        return 0.0
    near = np.round((most - values[values >= most - NEAR * span]) / (1e-9 * span))
    _, count = np.unique(near, return_counts=True)  # from the largest value on
    return count[0] / len(values) if count[0] > CUT * count[1:].max(initial=1) else 0.0
