"""Patterns under `free`, `fixed` and `prior`: all that is wrong with them, each at its own place."""

from __future__ import annotations

from typing import Any

import pytest

from robid_core import Robot, pattern_problems

SIX = Robot.load("six_axis")


def test_patterns_that_mean_something_are_right() -> None:
    free = ("gear_stiffness.*", "inertia.*", "mass.axis_[23]")
    assert pattern_problems(SIX, free, ("inertia.axis_1.*",), {"mass.*": 0.02, "inertia.axis_3.*": 0.1}) == {}


@pytest.mark.parametrize(
    ("settings", "place", "told"),
    [
        (
            {"free": ["mass.*", "gear_stifness.*"]},
            ("free", 1),
            "no parameter 'gear_stifness.*'; did you mean 'gear_stiffness",
        ),
        ({"free": ["mass.*"], "fixed": ["mas.axis_1"]}, ("fixed", 0), "no parameter 'mas.axis_1'; did you mean 'mass"),
        ({"free": ["mass.*"], "prior": {"effect.grease.*": 0.1}}, ("prior", "effect.grease.*"), "no parameter"),
        ({"free": ["mass.*"], "prior": {"gear_ratio.*": 0.1}}, ("prior", "gear_ratio.*"), "is held fixed"),
        ({"free": ["mass.*"], "fixed": ["mass.*"]}, ("fixed",), "no parameter is left free"),
        ({"free": []}, ("free",), "no parameter is left free"),
        ({"free": ["mass.*", "inertia.axis_2.xx"]}, ("free", 1), "inertia.axis_2: its moments are free together"),
        ({"free": ["inertia.*"], "fixed": ["mass.*", "*.axis_2.x?"]}, ("fixed", 1), "inertia.axis_2: its moments"),
    ],
)  # fmt: skip
def test_each_mistake_is_told_at_its_pattern(
    settings: dict[str, Any], place: tuple[object, ...], told: str
) -> None:
    found = pattern_problems(SIX, **settings)
    assert list(found) == [place]
    assert told in found[place]  # type: ignore[index]


def test_all_patterns_that_mean_nothing_are_told_and_no_echo_of_them() -> None:
    """The prior on masses is held only because the pattern that would free them is misspelt: it is not told."""
    found = pattern_problems(SIX, ["mas.*", "gear_stiffness.*", "spring.*"], ["x"], {"mass.*": 0.1, "y": 1.0})
    assert list(found) == [("free", 0), ("free", 2), ("fixed", 0), ("prior", "y")]
