"""Which blind cases a score is made of: what is hidden, how strongly, in how many, on which robots."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from blind.kinds import LAWS, STRUCTURES, VALUES

ASKED = Path(__file__).with_name("asked.json")
AXES = (1, 2, 1, 6)  # half of all cases have one axis, a quarter two, a quarter six
AXES_OF_LAWS = (
    1,
    2,
    1,
    1,
    2,
    1,
    6,
    1,
    2,
    1,
    1,
)  # likewise, beside changes of the robot, which are of six axes alone
SIX = 6
SINGLE = ("drive.saturation",)  # not reached by small motions
APART = 1000  # seeds of one stratum


@dataclass(frozen=True)
class Wanted:
    """What a case is asked to be."""

    stratum: str
    """Group of cases that is counted together."""
    seed: int
    n_axis: int = 1
    kinds: tuple[str, ...] = ()
    """Of what is hidden."""
    strength: tuple[float, float] = (200.0, 3000.0)
    """Of each, least and greatest."""
    motion: Literal["multisine", "moves"] = "multisine"
    exact_inertia: bool = False
    single: bool = False
    """Whether motions are small in all configurations but one: the law is seen there only."""
    taken_out: bool = False
    """Whether the diagnosis is not given the law."""


def asked() -> dict[str, Any]:
    """Return what a score must reach and how strong each stratum is: written before any is taken."""
    found: dict[str, Any] = json.loads(ASKED.read_text(encoding="utf-8"))
    return found


def plan(counts: Mapping[str, int], first_seed: int) -> list[Wanted]:
    """All cases of a score, so mixed that any beginning of the list is a small score.

    Parameters
    ----------
    counts
        Cases of each stratum; of one kind each in the strata of single laws.
    first_seed
        Every case has a seed of its own from here on.
    """
    rows = [
        list(_stratum(name, count, first_seed + APART * i)) for i, (name, count) in enumerate(counts.items())
    ]
    longest = max((len(row) for row in rows), default=0)
    places = [(np.arange(len(row)) + 0.5) * longest / max(len(row), 1) for row in rows]
    order = sorted((float(p), i, j) for i, own in enumerate(places) for j, p in enumerate(own))
    return [rows[i][j] for _, i, j in order]


def _stratum(name: str, count: int, seed: int) -> Iterator[Wanted]:
    strength = tuple(asked()["strengths"].get(name, (200.0, 3000.0)))
    seeds = itertools.count(seed)
    if name in ("strong", "middle", "weak"):
        axes = itertools.cycle(AXES_OF_LAWS)
        for _ in range(count):
            yield from (Wanted(name, next(seeds), next(axes), (kind,), strength) for kind in LAWS)
            yield from (Wanted(name, next(seeds), SIX, (kind,), strength) for kind in STRUCTURES)
            next(axes)  # kinds meet other robots in the next round
        return
    axes, kinds = itertools.cycle(AXES), itertools.cycle(LAWS)
    for _ in range(count):
        one, n_axis, kind = next(seeds), next(axes), next(kinds)
        if name in ("nothing", "exact inertia"):
            yield Wanted(name, one, n_axis, exact_inertia=name != "nothing")
        elif name == "pairs":
            drawn = np.random.default_rng(one).choice(LAWS, 2, replace=False)
            yield Wanted(name, one, n_axis, tuple(str(kind) for kind in drawn), strength)
        elif name == "law taken out":
            yield Wanted(name, one, n_axis, (kind,), strength, taken_out=True)
        elif name == "values":
            yield Wanted(name, one, n_axis, (VALUES[one % len(VALUES)],))
        elif name == "one configuration":
            yield Wanted(name, one, n_axis, (SINGLE[one % len(SINGLE)],), strength, single=True)
        elif name == "moves":
            yield Wanted(name, one, n_axis, (kind,), strength, motion="moves")
        else:
            raise ValueError(f"no stratum is called '{name}'")
