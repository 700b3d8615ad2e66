"""Experiments that are not like the others of a record: copies, and those that fit the robot file far worse."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from robid_acquisition.below_resonance import left_of_experiments
from robid_acquisition.plausible import sentence, slips_of
from robid_core import FloatArray, Record, Robot
from robid_core.estimation.copies import fingerprints, overlaps

Place = tuple[int, int, int]

WORSE = 10.0  # times what the other experiments leave of a torque's variance, their median
FEW = 0.2  # of all experiments, at most, that are called odd
MUCH = 0.1  # of that variance, at least: an experiment that leaves less is as it should be


@dataclass(frozen=True)
class Odd:
    """An experiment that fits the robot file far worse than the others of its record."""

    words: str
    is_slip: bool
    """Whether a slip in this experiment alone explains it."""


def copies_in(record: Record, names: Mapping[Place, str]) -> list[str]:
    """Say which of the named experiments hold the samples of another one to the last digit: noise does not repeat.

    A copy counts as a measurement of its own: what is noise in it looks like a cause, and standard errors shrink.
    """
    first: dict[bytes, str] = {}
    found = []
    for place, mark in fingerprints(record.run) if names else ():
        if mark in first:
            found.append(f"{names[place]} holds the samples of {first[mark]} to the last digit")
        first.setdefault(mark, names[place])
    return found


def parts_in(record: Record, names: Mapping[Place, str]) -> list[str]:
    """Say which of the named experiments hold a part of another file: what overlaps counts twice, and tests nothing."""
    return [
        f"{names[other]} holds a part of {names[place]} to the last digit, moved by {abs(move)} samples"
        for place, other, move in (overlaps(record.run) if names else ())
        if names[place] != names[other]
    ]


def odd_experiments(record: Record, robot: Robot, names: Mapping[Place, str]) -> Iterator[Odd]:
    """Say which of the named experiments fit the robot far worse than the others, and which slip explains that.

    The others are those of the same variant: another load may leave more of every torque. Where many are odd, it is no
    mistake in a file: motions differ, and what the robot lacks shows in some more than in others.
    """
    if not names:
        return
    left = left_of_experiments(record, robot)
    variants = record.variants or ("",) * len(record.angle)
    found = dict[Place, tuple[FloatArray, FloatArray]]()
    for place, own in left.items():
        alike = [there for there in left if there != place and variants[there[0]] == variants[place[0]]]
        if alike:
            usual = np.median([left[there] for there in alike], axis=0)
            if ((own > MUCH) & (own > WORSE * usual)).any():
                found[place] = own, usual
    if len(found) > max(1.0, FEW * len(left)):
        return
    for place, (own, usual) in found.items():
        alone = np.zeros(record.run.valid.shape[:3], dtype=bool)
        alone[place] = True
        slips = slips_of(record.part(alone), robot)
        if slips:
            yield Odd(f"{names[place]}: {sentence(slips)}", True)
            continue
        worst = int(np.argmax(np.where(own > WORSE * usual, own, 0.0)))
        yield Odd(
            f"{names[place]} is not like the others: the robot file leaves {_percent(own, worst)} % of the torque of "
            f"{record.axis_names[worst]} there, and {_percent(usual, worst)} % in the others; look at its channels",
            False,
        )


def _percent(share: FloatArray, axis: int) -> str:
    """Return a share of a variance as one of the rms, in percent."""
    return f"{100 * np.sqrt(share[axis]):.2g}"
