"""Recordings as a dense array: configurations x blocks x experiments, and what does not fit into one.

A block is whole or of no use: its experiments together excite all axes. So the block is what is dropped where an
experiment is missing, and as many blocks of each configuration are kept as leave most experiments.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robid_acquisition.recording import Recording
from robid_core import DataRejected

SHOWN = 6  # items of a list in a message

Numbered = dict[int, Recording]  # by experiment
Configuration = tuple[str, int]  # variant and number


@dataclass(frozen=True)
class Arrangement:
    """Recordings by configuration, block and experiment; every configuration has equally many of both.

    `shortfalls` says in sentences what is missing and what was left out.
    """

    recordings: tuple[tuple[tuple[Recording, ...], ...], ...]
    shortfalls: tuple[str, ...] = ()

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of configurations, blocks and experiments."""
        return len(self.recordings), len(self.recordings[0]), len(self.recordings[0][0])

    @property
    def variants(self) -> tuple[str, ...]:
        """Variant of each configuration."""
        return tuple(blocks[0][0].variant for blocks in self.recordings)


def arrange(recordings: Iterable[Recording]) -> Arrangement:
    """Put recordings into their order; configurations of one variant stay together.

    Raises
    ------
    DataRejected
        If two recordings claim to be the same experiment.
    """
    blocks: dict[Configuration, dict[int, Numbered]] = {}
    for recording in recordings:
        numbers = blocks.setdefault((recording.variant, recording.configuration), {})
        others = numbers.setdefault(recording.block, {})
        if recording.experiment in others:
            raise DataRejected(
                f"{others[recording.experiment].name} and {recording.name} are both {recording.block_name}, experiment "
                f"{recording.experiment}; rename one, or leave it out of the pattern or table"
            )
        others[recording.experiment] = recording
    words = _gaps(blocks)
    whole, lost = _whole_blocks(blocks)
    count, short = _common_count(whole)
    kept = tuple(
        tuple(
            tuple(whole[place][b][e] for e in sorted(whole[place][b])) for b in sorted(whole[place])[:count]
        )
        for place in sorted(whole)
        if len(whole[place]) >= count
    )
    return Arrangement(kept, (*words, *lost, *short))


def _gaps(blocks: dict[Configuration, dict[int, Numbered]]) -> list[str]:
    """Say which numbers are missing between the first and the last, of the configurations of each variant too."""
    numbered: dict[str, set[int]] = {}
    for (variant, configuration), numbers in blocks.items():
        whose = f" of variant {variant}" if variant else ""
        numbered.setdefault(f"configurations{whose}", set()).add(configuration)
        numbered.setdefault("blocks", set()).update(numbers)
        numbered.setdefault("experiments", set()).update(*numbers.values())
    words = []
    for noun, found in numbered.items():
        count = max(found) - min(found) + 1 - len(found)
        if count:
            first = next(number for number in range(min(found), max(found)) if number not in found)
            others = f" and {count - 1} more" if count > 1 else ""
            words.append(f"{noun} are numbered {min(found)} to {max(found)} without {first}{others}")
    return words


def _whole_blocks(
    blocks: dict[Configuration, dict[int, Numbered]],
) -> tuple[dict[Configuration, dict[int, Numbered]], list[str]]:
    """Return the blocks that have the experiments that most have, without further ones, and say what was left out."""
    sets = Counter(frozenset(block) for numbers in blocks.values() for block in numbers.values())
    wanted = max(sets, key=lambda one: (sets[one], len(one), sorted(one)))
    whole: dict[Configuration, dict[int, Numbered]] = {}
    lost, spare = [], []
    for place, numbers in blocks.items():
        for number, block in numbers.items():
            missing = sorted(wanted - set(block))
            if missing:
                lost.append(f"{next(iter(block.values())).block_name} lacks experiment {listed(missing)}")
                continue
            spare += [recording.name for e, recording in block.items() if e not in wanted]
            whole.setdefault(place, {})[number] = {e: block[e] for e in wanted}
    words = [f"incomplete blocks are left out: {listed(lost, '; ')}"] if lost else []
    if lost and len({variant for variant, _ in blocks}) > 1:
        words[-1] += (
            " (variants have unequal numbers of experiments: make each a configuration of its own in the table, or "
            "give each variant a stage of its own)"
        )
    if spare:
        words.append(f"blocks have {len(wanted)} experiments, left out beyond these: {listed(spare)}")
    return whole, words


def _common_count(whole: dict[Configuration, dict[int, Numbered]]) -> tuple[int, list[str]]:
    """Return the number of blocks that leaves most experiments, and say which are left out for it."""
    counts = [len(numbers) for numbers in whole.values()]
    best = max(sorted(set(counts)), key=lambda n: n * sum(count >= n for count in counts))
    few = [place for place, numbers in whole.items() if len(numbers) < best]
    many = [place for place, numbers in whole.items() if len(numbers) > best]
    words = []
    if few:
        words.append(f"configurations with less than {best} whole blocks are left out: {_named(few)}")
    if many:
        words.append(f"{best} blocks of each configuration are kept, further ones left out of {_named(many)}")
    return best, words


def _named(places: Sequence[Configuration]) -> str:
    return listed([f"{number} ({variant})" if variant else str(number) for variant, number in sorted(places)])


def listed(items: Sequence[object], separator: str = ", ") -> str:
    """Return the first of a list of things as text, and how many there are in all where there are more."""
    shown = separator.join(str(item) for item in items[:SHOWN])
    return shown if len(items) <= SHOWN else f"{shown}{separator}... ({len(items)})"
