"""Of laws that do the same at one place, that with the fewest numbers is tried: it is a special case of the others."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

from robid_core.residual import effect_class
from robid_diagnosis.search import Hit
from robid_diagnosis.selection import _plainest


def hit(use: str, gain: float, freedom: int, on: str = "axis_1") -> Hit:
    candidate = SimpleNamespace(use=use, key=(use, on, "motor"), effect=effect_class(use))
    return cast(
        "Hit", SimpleNamespace(candidate=candidate, gain=SimpleNamespace(total=gain), freedom=freedom)
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
