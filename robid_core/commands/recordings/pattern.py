"""The pattern that names of recordings follow: which number counts configurations, blocks, experiments."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

FIELDS = {
    "config": {"c", "cfg", "config", "configuration", "pose"},
    "block": {"b", "block", "repetition", "rep"},
    "exp": {"e", "exp", "experiment", "run", "trial", "test"},
}
KNOWN = frozenset().union(*FIELDS.values())
LACKING = 0.75  # of all combinations of the numbers in names: with fewer files they are no array


def pattern_of(names: Sequence[str], poses_differ: bool = False) -> str:
    """Return the pattern of names that differ in up to three numbers, empty where there is none that takes all.

    Of numbers that change together (a date and a count), the last one counts, and `*` stands for the others. Where
    the words before numbers do not say what they count, most of their combinations must be there: a pattern makes an
    array of experiments of them.

    Parameters
    ----------
    names
        Of files, below the data root.
    poses_differ
        A single number counts configurations, whatever the name calls it.
    """
    parts = [re.split(r"([0-9]+)", name) for name in names]
    if len({tuple(part[::2]) for part in parts}) > 1:
        return ""
    changing = [index for index in range(1, len(parts[0]), 2) if len({part[index] for part in parts}) > 1]
    words = {place: re.split("[^a-z]", parts[0][place - 1].lower().rstrip("_-"))[-1] for place in changing}
    places, spare = _independent(parts, words)
    if not 0 < len(places) <= len(FIELDS):
        return ""
    counts = [len({part[place] for part in parts}) for place in places]
    guessed = any(words[place] not in KNOWN for place in places)
    if guessed and len(names) < LACKING * math.prod(counts):
        return ""
    fields = {
        place: next((one for one, known in FIELDS.items() if words[place] in known), "") for place in places
    }
    if poses_differ and len(places) == 1:
        fields = dict.fromkeys(places, "config")
    named = [field for field in fields.values() if field]
    if len(set(named)) < len(named):
        fields, named = dict.fromkeys(places, ""), []
    rest = [field for field in FIELDS if field not in named]
    for place in reversed([place for place in places if not fields[place]]):
        fields[place] = rest.pop()
    template = list(parts[0])
    for place, field in fields.items():
        template[place] = f"{{{field}}}"
    for place in spare:
        template[place] = "*"
    return "".join(template)


def _independent(parts: Sequence[Sequence[str]], words: Mapping[int, str]) -> tuple[list[int], list[int]]:
    """Part places of names into those whose numbers say something of their own, and those that follow from another.

    Places with a known word before them stay; of others that change together the last one does.
    """
    kept, spare = list[int](), list[int]()
    for place in sorted(words, key=lambda one: (words[one] in KNOWN, one), reverse=True):
        follows = words[place] not in KNOWN and any(
            len({(part[place], part[other]) for part in parts}) == len({part[other] for part in parts})
            for other in kept
        )
        (spare if follows else kept).append(place)
    return sorted(kept), spare
