"""Which rivals are tried: of laws that do the same the plainest; of values those that no law explains as well."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from robid_core.residual import effect_class
from robid_diagnosis.least_gains import LeastGains
from robid_diagnosis.search import Hit
from robid_diagnosis.selection import _plainest, _stands_out
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


def test_a_law_too_weak_to_be_named_is_not_named_as_a_value_that_does_the_same() -> None:
    """A weak spring of a cable looks like a body told wrong; a body that no law imitates is told, and a strong one."""
    least = LeastGains(30.0, np.zeros(1), ("axis_1",))
    weak, strong = (ValueHit("axis_1", "body", ("mass.axis_1",), gain, 3) for gain in (27.1, 31.0))
    cable, other = hit("load.cable_spring", 26.8, 1), hit("drive.cogging", 8.0, 3)
    assert not _stands_out(weak, [cable, other], least)
    assert _stands_out(weak, [other], least)
    assert _stands_out(weak, [], least)
    assert _stands_out(strong, [cable, other], least)
