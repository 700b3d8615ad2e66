"""Warnings that say the same of several stages or recordings, as one sentence each.

Five recordings of one machine have stamps that jitter alike: five long sentences that differ in a name and a number
hide the sixth. What is folded is for people; the manifest keeps every sentence.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

_PARTS = re.compile(r"stage (?P<stage>[^\s:]+): (?:(?P<file>[^\s:]+\.\w+): )?(?P<said>.*)", re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.]*[A-Za-z_])")
MOST_NAMES = 3  # that are listed; of more the first and the last


def folded(warnings: Iterable[str]) -> list[str]:
    """Return warnings with those that differ only in stage, file and numbers as one, at the place of the first.

    >>> folded(["stage a: x.csv: off by up to 8.8 % (2 % rms)", "stage b: y.csv: off by up to 9.2 % (3 % rms)"])
    ['stages a, b: 2 files (x.csv, y.csv): off by up to 9.2 % (2 to 3 % rms)']
    """
    groups: dict[object, list[tuple[str, str, str]]] = {}
    for text in warnings:
        found = _PARTS.fullmatch(text)
        stage, file, said = found.group("stage", "file", "said") if found else ("", "", text)
        key = (bool(file), *_NUMBER.split(said)) if found else text
        groups.setdefault(key, []).append((stage, file or "", said))
    return [_one(group) for group in groups.values()]


def _one(group: Sequence[tuple[str, str, str]]) -> str:
    stages, files, said = (list(dict.fromkeys(column)) for column in zip(*group, strict=True))
    parts = [f"stage{'s' if len(stages) > 1 else ''} {_listed(stages)}"] if stages != [""] else []
    if files != [""]:
        parts.append(files[0] if len(files) == 1 else f"{len(files)} files ({_listed(files)})")
    return ": ".join([*parts, _joined(said)])


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= MOST_NAMES else f"{names[0]} to {names[-1]}"


def _joined(said: Sequence[str]) -> str:
    """Return one sentence of several that differ in numbers: their range, the largest behind "up to"."""
    words = _NUMBER.split(said[0])
    numbers = zip(*(_NUMBER.findall(one) for one in said), strict=True)
    text = words[0]
    for values, after in zip(numbers, words[1:], strict=True):
        ordered = sorted(dict.fromkeys(values), key=float)
        between = f"{ordered[0]} to {ordered[-1]}" if len(ordered) > 1 else ordered[0]
        text += (ordered[-1] if text.endswith("up to ") else between) + after
    return text
