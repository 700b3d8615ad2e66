"""Columns of a recording put together by axes: `Position1` to `Position7` are one channel, a table is one already."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray

SHORT = 20  # times: an array so much shorter than the longest is no signal
_NUMBER = re.compile(r"[0-9]+")
_JOINT = re.compile(r"(.+)\[([^\[\]]+)\]")


@dataclass(frozen=True)
class Family:
    """Columns of one channel, one for each axis, or one table; `samples` is (n_sample, n_axis)."""

    label: str
    names: tuple[str, ...]
    samples: FloatArray


@dataclass(frozen=True)
class Sorted:
    """What a recording holds: channels, single numbers, and names of arrays that are no signals."""

    families: tuple[Family, ...]
    constants: dict[str, float]
    short: tuple[str, ...]


def sort_columns(columns: Mapping[str, FloatArray]) -> Sorted:
    """Put columns together by axes, and apart by what they can be."""
    constants = {name: float(values.reshape(-1)[0]) for name, values in columns.items() if values.size == 1}
    arrays = {name: values for name, values in columns.items() if values.size > 1}
    longest = max((max(values.shape) for values in arrays.values()), default=0)
    signals = {
        name: values
        for name, values in arrays.items()
        if values.ndim <= 2 and max(values.shape) * SHORT > longest
    }
    families = []
    for label, names in _grouped(signals):
        table = np.stack([signals[name] for name in names], axis=1) if len(names) > 1 else signals[names[0]]
        if table.ndim == 1:
            table = table[:, None]
        families.append(Family(label, names, table if table.shape[0] >= table.shape[1] else table.T))
    short = tuple(f"{name} {values.shape}" for name, values in arrays.items() if name not in signals)
    return Sorted(tuple(families), constants, short)


def _grouped(signals: Mapping[str, FloatArray]) -> list[tuple[str, tuple[str, ...]]]:
    """Return a label and the names of each group, in the order of the file."""
    members: dict[tuple[str, int], list[tuple[int, str]]] = {}
    for name, values in signals.items():
        if values.ndim == 1:
            for label, number in _labels(name):
                members.setdefault((label, len(values)), []).append((number, name))
    group_of: dict[str, tuple[str, tuple[str, ...]]] = {}
    for (label, _), found in sorted(members.items(), key=lambda item: -len(item[1])):
        numbers = [number for number, _ in found]
        names = tuple(name for _, name in found)
        if len(names) > 1 and _consecutive(numbers) and not any(name in group_of for name in names):
            group_of |= dict.fromkeys(names, (label, names))
    groups = [group_of.get(name, (name, (name,))) for name in signals]
    return list(dict.fromkeys(groups))


def _labels(name: str) -> Iterable[tuple[str, int]]:
    """Yield a name with one of its numbers taken out, and the number; of `position[elbow]` the part before it, -1."""
    joint = _JOINT.fullmatch(name)
    if joint and not joint[2].strip().isdigit() and ("/" in joint[1] or "." in joint[1]):
        yield joint[1], -1  # of a topic; elsewhere brackets hold units
        return
    for number in _NUMBER.finditer(name):
        label = name[: number.start()] + name[number.end() :]
        if re.search("[A-Za-z]", label):
            yield label, int(number[0])


def _consecutive(numbers: list[int]) -> bool:
    return set(numbers) == {-1} or sorted(numbers) == list(range(min(numbers), min(numbers) + len(numbers)))
