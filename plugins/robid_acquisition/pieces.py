"""Pieces of recordings between holes, as experiments of equal length.

Each run without a hole gives one piece, from its beginning; they are as long as leaves most samples. A piece is no part
of a block that excites all axes: those of a configuration are one block.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from robid_acquisition.arrangement import Arrangement, listed
from robid_acquisition.assembly import Index
from robid_core import BoolArray, DataRejected
from robid_core.estimation.stretches import stretches


@dataclass(frozen=True)
class Piece:
    """Periods (or, where nothing repeats, samples) `first` to `first + length` of the experiment at `place`."""

    place: Index
    first: int
    length: int


def pieces_between_holes(
    arrangement: Arrangement, known: Mapping[Index, BoolArray], unit_s: float
) -> tuple[Arrangement, dict[Index, Piece], str]:
    """Return the arrangement of the pieces, where each lies, and what is left out, in words.

    Parameters
    ----------
    arrangement
        The experiments.
    known
        Of each, which periods (or samples) have no hole, (n,).
    unit_s
        Length of a period (or a sample), s.

    Raises
    ------
    DataRejected
        If a configuration has no piece.
    """
    runs = {place: stretches(marks) for place, marks in known.items()}
    n_config = arrangement.shape[0]
    by_config: list[list[Piece]] = [
        [Piece(place, a, b - a) for place in sorted(runs) if place[0] == c for a, b in runs[place]]
        for c in range(n_config)
    ]
    lengths = sorted({one.length for pieces in by_config for one in pieces})

    def count(length: int) -> int:
        return min(sum(one.length >= length for one in pieces) for pieces in by_config)

    if not lengths or not count(lengths[0]):
        raise DataRejected("gaps: a configuration has no piece without a hole; leave it out")
    best = max(lengths, key=lambda length: (count(length) * length, length))
    n_piece = count(best)
    rows, places = [], {}
    for c, pieces in enumerate(by_config):
        long = [one for one in pieces if one.length >= best][:n_piece]
        block = []
        for e, piece in enumerate(long):
            _, b, number = piece.place
            whole = arrangement.recordings[c][b][number]
            start_s = (whole.start_s or 0.0) + piece.first * unit_s
            block.append(
                replace(whole, block=1, experiment=e + 1, start_s=start_s, stop_s=start_s + best * unit_s)
            )
            places[c, 0, e] = replace(piece, length=best)
        rows.append((tuple(block),))
    kept_places = {piece.place for piece in places.values()}
    lost = [
        whole.name
        for c, blocks in enumerate(arrangement.recordings)
        for b, block in enumerate(blocks)
        for e, whole in enumerate(block)
        if (c, b, e) not in kept_places
    ]
    total = sum(int(marks.size) for marks in known.values())
    kept = n_config * n_piece * best
    words = (
        f"gaps: split: {n_config * n_piece} pieces of {best * unit_s:.4g} s between holes are kept, "
        f"{100 * kept / total:.3g} % of what was recorded"
    )
    if lost:
        words += f"; nothing of {listed(lost)}: pieces are equally long, give short recordings a stage of their own"
    return Arrangement(tuple(rows), arrangement.shortfalls), places, words
