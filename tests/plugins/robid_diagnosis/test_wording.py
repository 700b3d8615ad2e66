"""Sentences of the verdict: values that are not as they were told."""

from __future__ import annotations

import numpy as np

from robid_core import ParameterTable
from robid_diagnosis.wording import values_line


def table(estimate: list[float], error: list[float], group: str = "stiffness") -> ParameterTable:
    n = len(estimate)
    return ParameterTable(
        tuple(f"gear_stiffness.axis_{i + 1}" for i in range(n)), ("N m/rad",) * n, (group,) * n, np.full(n, 100.0),
        np.array(estimate), np.array(error), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool),
    )  # fmt: skip


def test_values_that_are_surely_and_clearly_off_are_read_out_the_furthest_first() -> None:
    """A half is further than a third more; an error of a percent, or one that the data do not tell, is not read out."""
    line = values_line(table([130.0, 50.0, 101.0, 140.0], [0.2, 0.1, 0.1, 20.0]))
    assert line == (
        "Values: gear_stiffness.axis_2 is 50 ± 0.1 % smaller than told; "
        "gear_stiffness.axis_1 is 30 ± 0.2 % larger than told."
    )


def test_many_are_counted_and_none_is_no_line() -> None:
    assert values_line(table([200.0] * 7, [1.0] * 7)).endswith("; 2 more.")
    assert values_line(table([100.5], [0.01])) == ""
    assert values_line(table([50.0], [0.01], group="friction")) == ""
