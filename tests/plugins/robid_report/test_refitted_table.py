"""The table of values that a diagnosis fitted: which of them the data determine, and which have moved."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Diagnosis, Finding, ParameterTable
from robid_report.numbers import significant
from robid_report.refitted import refitted_table


@pytest.fixture
def diagnosis() -> Diagnosis:
    """A spring that moved, a damper that nothing shows, a rotor that moved, a mass within its tolerance alone."""
    names = ("gear_stiffness.axis_1", "gear_damping.axis_1", "rotor_inertia.axis_1", "mass.axis_1")
    n, groups = len(names), ("stiffness", "damping", "inertia", "inertia")
    table = ParameterTable(
        names, ("N m/rad", "N m s/rad", "kg m^2", "kg"), groups,
        np.array([100.0, 1.0, 2e-4, 10.0]), np.array([130.0, 0.01, 2.2e-4, 11.0]),
        np.array([0.5, 0.8, 1e-7, 0.09]), np.ones(n, dtype=bool), np.zeros(n, dtype=bool),
        prior=np.array([np.inf, np.inf, 2e-6, 0.1]),
    )  # fmt: skip
    return Diagnosis("effects", "", values=table)


def test_what_moved_and_what_only_tolerances_tell_are_marked(diagnosis: Diagnosis) -> None:
    table = refitted_table(diagnosis)
    assert table is not None
    (spring,) = table["shown"]
    assert spring[:2] == ("gear_stiffness.axis_1", "N m/rad")
    assert spring[5:] == ("+30.0\u202f%", "–", True, True)
    marks = {name: (by_data, moved) for name, *_, by_data, moved in table["folded"]}
    assert marks == {
        "gear_damping.axis_1": (False, False),
        "rotor_inertia.axis_1": (True, True),
        "mass.axis_1": (False, False),  # eleven standard errors that are the tolerance's
    }


def test_where_nothing_was_fitted_there_is_no_table() -> None:
    assert refitted_table(None) is None
    assert refitted_table(Diagnosis("closed loop", "")) is None


def test_effects_that_were_found_have_no_value_in_the_robot_file(diagnosis: Diagnosis) -> None:
    """Where their search began is nobody's statement."""
    none, one = np.empty(0), np.ones(1)
    cause = Finding(
        "cause", "load.payload", "axis_1", "", 900.0, 1e-9, float("nan"), ("mass",), ("kg",), one, one, one,
        none, none, none,
    )  # fmt: skip
    table = ParameterTable(
        ("effect.payload_axis_1.mass", "effect.payload_axis_2.mass"), ("kg", "kg"), ("effect", "effect"),
        np.array([1.0, 1.0]), np.array([3.0, 3.0]), np.array([0.1, 0.1]), np.ones(2, dtype=bool),
        np.zeros(2, dtype=bool),
    )  # fmt: skip
    rows = refitted_table(Diagnosis("effects", "", findings=(cause,), values=table))
    assert rows is not None
    found, stated = rows["shown"]
    assert (found[2], found[5], found[-1]) == ("–", "–", True)
    assert (stated[2], stated[5], stated[-1]) == (significant(1.0), "+200 %", True)
