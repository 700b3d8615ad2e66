"""Experiments that are not like the others of a record: copies, and those that fit the robot file far worse."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from robid_acquisition.plausible import CHANNELS, left_of_experiments, sentence, slips_of
from robid_core import FloatArray, Record, Robot

Place = tuple[int, int, int]

WORSE = 10.0  # times what the other experiments leave of a torque's variance, their median
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
    for place, name in names.items():
        own = [record.run.values(channel)[place] for channel in CHANNELS if channel in record.run.channels]
        known = np.isfinite(own[-1]) if own else np.zeros(1, dtype=bool)
        if not known.any() or np.ptp(own[-1][known]) == 0:
            continue
        digest = hashlib.sha256(b"".join(np.ascontiguousarray(one).tobytes() for one in own)).digest()
        if digest in first:
            found.append(f"{name} holds the samples of {first[digest]} to the last digit")
        first.setdefault(digest, name)
    return found


def odd_experiments(record: Record, robot: Robot, names: Mapping[Place, str]) -> Iterator[Odd]:
    """Say which experiments fit the robot far worse than the others, and which slip in them alone explains that.

    The others are those of the same variant: another load may leave more of every torque.
    """
    left = left_of_experiments(record, robot)
    variants = record.variants or ("",) * len(record.angle)
    for place, own in left.items():
        alike = [there for there in left if there != place and variants[there[0]] == variants[place[0]]]
        others = np.array([left[there] for there in alike])
        if not len(others):
            continue
        usual = np.median(others, axis=0)
        odd = (own > MUCH) & (own > WORSE * usual)
        if not odd.any():
            continue
        alone = np.zeros(record.run.valid.shape[:3], dtype=bool)
        alone[place] = True
        name = names.get(
            place, "experiment {2} of block {1}, configuration {0}".format(*(i + 1 for i in place))
        )
        slips = slips_of(record.part(alone), robot)
        if slips:
            yield Odd(f"{name}: {sentence(slips)}", True)
            continue
        worst = int(np.argmax(np.where(odd, own, 0.0)))
        yield Odd(
            f"{name} is not like the others: the robot file leaves {_percent(own, worst)} % of the torque of "
            f"{record.axis_names[worst]} there, and {_percent(usual, worst)} % in the others; look at its channels",
            False,
        )


def _percent(share: FloatArray, axis: int) -> str:
    """Return a share of a variance as one of the rms, in percent."""
    return f"{100 * np.sqrt(share[axis]):.2g}"
