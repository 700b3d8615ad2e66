"""The diagnosis against laws hidden in MuJoCo's plants: a small sample always, a larger one with `-m full`."""

from __future__ import annotations

import pytest
import scipy

from blind.cases import FAMILIES
from blind.score import judged

SAMPLE = (("", 901), ("friction.stribeck", 902))
SEEDS = range(910, 913)
RIGHT = 0.9  # of all cases that are seen at all: what is claimed
NEVER_REACHED = "drive.saturation"  # many draws have a limit that no torque comes to
RARE = 0.01  # probability of a count as low, were the claim true


@pytest.mark.parametrize(("kind", "seed"), SAMPLE, ids=[kind or "nothing" for kind, _ in SAMPLE])
def test_a_hidden_law_is_named_first_and_none_where_there_is_none(kind: str, seed: int) -> None:
    row = judged(kind, seed)
    assert row["right"] == "True", row
    assert row["others"] == ""
    if row["found_late"]:
        assert abs(float(row["found_late"]) - float(row["late"])) < 0.02


@pytest.mark.full
def test_of_all_kinds_most_are_named() -> None:
    """48 cases: the count of right ones is what chance leaves of nine in ten, and nothing is found in data without."""
    kinds = [kind for kind in FAMILIES if kind != NEVER_REACHED]
    rows = [judged(kind, seed) for seed in SEEDS for kind in ("", *kinds)]
    assert all(row["right"] == "True" for row in rows if not row["kind"])
    right = sum(row["right"] == "True" for row in rows if row["kind"])
    assert scipy.stats.binom.cdf(right, len(kinds) * len(SEEDS), RIGHT) > RARE, rows
