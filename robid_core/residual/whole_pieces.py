"""Pieces of records between gaps, as records of their own, for stages that need every sample.

What `gaps: mask` leaves out of a motion that does not repeat parts it into pieces that are whole; unlike those of
`gaps: split` they need not be equally long, so that nothing but short ones is lost. Of a motion that repeats a hole
spoils a period, and pieces would no longer be periods: such records stay as they are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid_core.artifacts import DenseRun, Record, frozen
from robid_core.errors import DataRejected
from robid_core.estimation.stretches import stretches


def whole_pieces(records: Sequence[Record], shortest_s: float, stage: str, remedy: str) -> tuple[Record, ...]:
    """Return records without holes: whole ones as they are, of others each piece between gaps as a record.

    Parameters
    ----------
    records
        That a stage works on.
    shortest_s
        Pieces that are shorter are left out.
    stage, remedy
        Who asks, and by what settings it takes shorter pieces, for messages.

    Raises
    ------
    DataRejected
        If no piece of a record with holes is long enough.
    """
    found = list[Record]()
    for record in records:
        if not _has_gaps(record):
            found.append(record)
            continue
        pieces = [piece for run in record.runs for piece in _pieces(record, run, shortest_s)]
        if not pieces:
            raise DataRejected(
                f"{stage}: no piece of {record.source} between its gaps lasts {shortest_s:.3g} s; {remedy}, or leave "
                "the recording out"
            )
        found += pieces
    return tuple(found)


def words_of_pieces(records: Sequence[Record], pieces: Sequence[Record]) -> str:
    """Say how many pieces records became, and how much is left of them; empty where none has a gap."""
    if not any(_has_gaps(record) for record in records):
        return ""
    whole, runs = _duration(records), [run for record in pieces for run in record.runs]
    count = sum(run.valid[..., 0, 0].size for run in runs)
    shortest = min(run.valid[0, 0, 0].size * run.sample_time_s for run in runs)
    return (
        f"takes the pieces between the gaps: {count} of {shortest:.3g} s and more, "
        f"{100 * _duration(pieces) / whole:.3g} % of what was recorded"
    )


def _has_gaps(record: Record) -> bool:
    """Whether samples are missing in a motion that does not repeat."""
    return record.line is None and not all(run.valid.all() for run in record.runs)


def _duration(records: Sequence[Record]) -> float:
    return sum(run.valid.size * run.sample_time_s for record in records for run in record.runs)


def _pieces(record: Record, run: DenseRun, shortest_s: float) -> Iterator[Record]:
    """Yield the whole pieces of each experiment of a run, its periods joined."""
    for place in np.ndindex(*run.valid.shape[:3]):
        c, b, e = (slice(one, one + 1) for one in place)
        n_sample = run.valid[place].size
        for first, stop in stretches(run.valid[place].reshape(-1)):
            if (stop - first) * run.sample_time_s < shortest_s:
                continue
            channels = {
                name: one.replace(
                    values=frozen(one.values[place].reshape(1, 1, 1, 1, n_sample, -1)[..., first:stop, :])
                )
                for name, one in run.channels.items()
            }
            piece = run.replace(
                channels=channels,
                time_s=frozen(np.arange(stop - first) * run.sample_time_s),
                valid=frozen(np.ones((1, 1, 1, 1, stop - first), dtype=bool)),
                test=None if run.test is None else run.test[c, b, e],
                constants=None if run.constants is None else run.constants[c, b, e],
            )
            yield record.replace(
                runs=(piece,), angle=record.angle[c], variants=record.variants[c] if record.variants else ()
            )
