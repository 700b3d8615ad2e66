"""Which rivals are tried: of laws that do the same the plainest; of values those that no law explains as well."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from robid_core.residual import effect_class
from robid_diagnosis.least_gains import LeastGains
from robid_diagnosis.search import Hit
from robid_diagnosis.selection import _plainest, _stands_out
from robid_diagnosis.trials import SAME, Trial, plainest_first
from robid_diagnosis.values import PRICE, ValueHit


def hit(use: str, gain: float, freedom: int, on: str = "axis_1") -> Hit:
    candidate = SimpleNamespace(use=use, key=(use, on, "motor"), effect=effect_class(use))
    return cast(
        "Hit",
        SimpleNamespace(
            candidate=candidate,
            gain=SimpleNamespace(total=gain),
            freedom=freedom,
            worth=gain - PRICE * freedom,
        ),
    )


def test_a_special_case_is_tried_and_what_holds_it_is_not() -> None:
    """Asymmetric Coulomb friction is Eyring's and the power law without the curve."""
    known: Any = hit("friction.asymmetric", 148.3, 1)
    curved = [hit("friction.power_law", 148.3, 1), hit("friction.eyring", 148.3 * (1 + 1e-9), 2)]
    assert _plainest([*curved, known]) == [known]


def test_laws_that_gain_more_or_act_elsewhere_stay() -> None:
    hits = [
        hit("friction.asymmetric", 148.3, 1),
        hit("friction.power_law", 152.0, 3),
        hit("friction.power_law", 148.3, 1, on="axis_2"),
    ]
    assert _plainest(hits) == hits


def trial(fitted: object, gain: float) -> Trial:
    known = SimpleNamespace(misfit=1.0, hypothesis=SimpleNamespace(additions=[SimpleNamespace(free=())]))
    return Trial(cast("Any", known), gain, cast("Hit", fitted), 0.0, 0.0)


@pytest.mark.parametrize(
    ("apart", "place", "first"), [(0.5, "axis_1", 1), (2.0, "axis_1", 0), (0.5, "axis_2", 0)]
)
def test_the_plainest_of_laws_that_gain_the_same_at_one_place_is_named(
    monkeypatch: pytest.MonkeyPatch, apart: float, place: str, first: int
) -> None:
    """A tenth of a percent apart they are the same there; one that gains less still, or acts elsewhere, is not."""
    monkeypatch.setattr("robid_diagnosis.trials.Hit", SimpleNamespace)
    many, few = 1e5, 1e5 * (1 - apart * SAME)
    trials = [
        trial(hit("friction.power_law", many, 3), many),
        trial(hit("friction.asymmetric", few, 1, place), few),
    ]
    assert plainest_first(trials)[0] is trials[first]
    assert trials[1].is_like(trials[0]) is bool(first)


def test_a_law_too_weak_to_be_named_is_not_named_as_a_value_that_does_the_same() -> None:
    """A weak spring of a cable looks like a body told wrong; a body that no law imitates is told, and a strong one."""
    least = LeastGains(30.0, np.zeros(1), ("axis_1",))
    weak, strong = (ValueHit("axis_1", "body", ("mass.axis_1",), gain, 3) for gain in (27.1, 31.0))
    cable, other = hit("load.cable_spring", 26.8, 1), hit("drive.cogging", 8.0, 3)
    assert not _stands_out(weak, [cable, other], least)
    assert _stands_out(weak, [other], least)
    assert _stands_out(weak, [], least)
    assert _stands_out(strong, [cable, other], least)
