"""What a verdict says of effects that were not named."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from robid_diagnosis.asked import nearest_lines

STRIBECK = ("friction.stribeck", "axis_1", "motor")


def outcome(*keys: tuple[str, str, str]) -> Any:
    """Hits in the order of their gains, beside a fit that leaves four times the noise."""
    hits = [
        SimpleNamespace(candidate=SimpleNamespace(key=key), gain=SimpleNamespace(total=400.0)) for key in keys
    ]
    search = SimpleNamespace(hits=hits, p_value=lambda hit, noise: 1e-9)
    return SimpleNamespace(searches=[search], final=SimpleNamespace(misfit=4.0))


def unknown(*axes: str) -> Any:
    return [SimpleNamespace(on=axis) for axis in axes]


def test_the_nearest_effect_is_told_with_the_reason_and_how_to_try_it() -> None:
    """Of the axis at which something is left; gains are counted in what the fit leaves."""
    found = outcome(("drive.cogging", "axis_2", "torque"), STRIBECK, ("friction.dahl", "axis_1", "motor"))
    assert nearest_lines(found, unknown("axis_1", "axis_1"), {STRIBECK: "a cause has to gain 150 here"}) == [
        "Nearest to it is friction.stribeck at axis_1 (motor): p = 1e-09, twice the log-likelihood rises by 100.0; not "
        "named: a cause has to gain 150 here. To try it alone: robid diagnose --test friction.stribeck@axis_1."
    ]


def test_an_effect_that_is_no_more_than_chance_is_not_near() -> None:
    assert nearest_lines(outcome(STRIBECK), unknown("axis_1"), {}) == []
    assert nearest_lines(outcome(STRIBECK), unknown("axis_2"), {STRIBECK: "too little"}) == []
    assert nearest_lines(outcome(STRIBECK), (), {STRIBECK: "too little"}) == []
