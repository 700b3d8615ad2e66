"""Hidden effects beside friction that turns within a speed that noise of the angle hides: turns do not count there.

Development seeds. What acts at turns alone (how friction differs by direction, what it remembers) cannot be seen then.
"""

from __future__ import annotations

import math

import pytest

from blind import cases
from blind.judging import judged
from blind.plan import Wanted, asked, plan
from robid_core import Robot

FIRST_SEED = 930000
AT_TURNS = ("friction.asymmetric", "friction.dahl", "friction.lugre", "friction.stribeck")


@pytest.fixture
def narrow(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Plants whose friction turns within so many rad/s, in place of 0.3 to 0.7."""
    drawn = cases.true_robot

    def narrower(told: Robot, *arguments: object, **more: object) -> Robot:
        robot = drawn(told, *arguments, **more)
        return robot.with_parameters({f"friction.{name}.speed": request.param for name in robot.axis_names})

    monkeypatch.setattr(cases, "true_robot", narrower)


def wanted(stratum: str) -> list[Wanted]:
    counts = {name: math.ceil(0.1 * n) for name, n in asked()["counts"].items()}
    return [one for one in plan(counts, FIRST_SEED) if one.stratum == stratum and one.n_axis == 1]


@pytest.mark.parametrize("narrow", [0.05], indirect=True)
def test_load_dependent_friction_is_named(narrow: None) -> None:
    one = next(one for one in wanted("strong") if one.kinds == ("friction.load_dependent",))
    row = judged(one, "test")
    assert (row["right"], row["extras"]) == ("True", "0")


@pytest.mark.full
@pytest.mark.parametrize("narrow", [0.01, 0.05], indirect=True)
def test_most_causes_are_named_and_none_is_wrong(narrow: None) -> None:
    seen = [one for one in wanted("strong") if not set(one.kinds) & set(AT_TURNS)]
    rows = [judged(one, "test") for one in seen[:8]]
    assert sum(row["right"] == "True" for row in rows) >= 0.9 * len(rows)
    assert all(row["extras"] == "0" for row in rows)


@pytest.mark.full
@pytest.mark.parametrize("narrow", [0.01, 0.05], indirect=True)
def test_nothing_is_named_where_nothing_is_hidden(narrow: None) -> None:
    rows = [judged(one, "test") for one in wanted("nothing")[:6]]
    assert all(not row["told"] for row in rows)
