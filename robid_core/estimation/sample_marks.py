"""Marks of samples by what they hold, by which data are known again: was a record, or a part of one, fitted already?

A mark is a hash of the motor angles at four samples in a row; of all marks the smallest are kept, a sample of the data
that any part of them shares (Broder, On the resemblance and containment of documents, 1997). Torques do not count,
since compensations change them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from robid_core.arrays import IntArray
from robid_core.artifacts import Record

KEPT = 4096  # marks of a fit
SHINGLE = 4  # samples in a row
FEWEST = 5  # marks to tell by
MOST = 0.5  # of the marks: quantised angles of another run may share some

_Hashes = npt.NDArray[np.uint64]


def sample_marks(records: Sequence[Record]) -> IntArray:
    """Return the marks of records that are kept, rising, (n_mark,)."""
    return np.sort(_marks(records))[:KEPT]


def have_been_seen(records: Sequence[Record], seen: IntArray) -> bool | None:
    """Whether records are among those of which marks were kept; None where there are too few marks to tell."""
    if not len(seen):
        return None
    own = _marks(records)
    low = own[own <= seen[-1]]
    return bool(np.isin(low, seen).mean() > MOST) if len(low) >= FEWEST else None


def _marks(records: Sequence[Record]) -> IntArray:
    """Return all marks, each once, (n_mark,); samples at which nothing moves have none."""
    found = [np.empty(0, dtype=np.uint64)]
    for run in (run for record in records for run in record.runs if "motor_position" in run.channels):
        for angle in run.lanes("motor_position"):
            n = len(angle) - SHINGLE + 1
            if n < 1:
                continue
            rows = _mixed(np.ascontiguousarray(angle + 0.0).view(np.uint64))
            row = _mixed(np.bitwise_xor.reduce(rows * _odd(rows.shape[1]), axis=1))
            parts = np.stack([row[i : i + n] for i in range(SHINGLE)], axis=1)
            moving = (parts != parts[:, :1]).any(axis=1)
            found.append(_mixed(np.bitwise_xor.reduce(parts * _odd(SHINGLE), axis=1))[moving])
    result: IntArray = np.unique(np.concatenate(found) >> np.uint64(1)).astype(np.int64)
    return result


def _odd(n: int) -> _Hashes:
    """Return odd numbers that tell places apart, (n,)."""
    result: _Hashes = _mixed(np.arange(1, n + 1, dtype=np.uint64)) | np.uint64(1)
    return result


def _mixed(values: _Hashes) -> _Hashes:
    """Scramble the bits of numbers: the finaliser of splitmix64 (Steele, Lea and Flood 2014)."""
    mixed = values ^ (values >> np.uint64(30))
    mixed = mixed * np.uint64(0xBF58476D1CE4E5B9)
    mixed ^= mixed >> np.uint64(27)
    mixed = mixed * np.uint64(0x94D049BB133111EB)
    result: _Hashes = mixed ^ (mixed >> np.uint64(31))
    return result
