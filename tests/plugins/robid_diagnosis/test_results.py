"""Findings: what is said of a cause beside the numbers that were estimated."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from robid_diagnosis.hypothesis import Addition, Hypothesis
from robid_diagnosis.results import _held

VALUES = {
    "coulomb": 0.0,
    "load_coulomb": 0.0535,
    "load_excess": 0.0066,
    "stribeck_speed": 63.0,
    "exponent": 1.9,
    "viscous": 0.0,
    "speed": 0.4,
}


def test_sizes_that_are_held_are_said() -> None:
    """Friction per load is 0.0535 at high speed and 0.0601 at low: the first alone is another law."""
    law = Addition("by_load", "friction.load_dependent", "axis_1", "motor", VALUES, ("load_coulomb",))
    other = Addition("else", "friction.load_dependent", "axis_2", "motor", VALUES, ("load_coulomb",))
    final: Any = SimpleNamespace(hypothesis=Hypothesis((other, law)))
    step: Any = SimpleNamespace(names=law.names)
    assert [(row.name, value) for row, value in _held(final, step)] == [("load_excess", 0.0066)]
