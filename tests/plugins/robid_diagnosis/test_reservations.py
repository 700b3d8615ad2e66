"""A diagnosis that leaves more than noise, or an unknown cause, says so where the page and the screen have remarks."""

import numpy as np
import pytest

from robid_core import Finding, MisfitTable
from robid_diagnosis.reservations import reservations

NONE = np.empty(0)
LEFT = MisfitTable(("axis_1",), np.array([0.0, 3.0, 10.0]), np.array([[1.0, 9.0]]), np.ones((1, 2)))


def finding(kind: str) -> Finding:
    return Finding(kind, "law", "axis_1", "", 50.0, 1e-9, 1.0, (), (), NONE, NONE, NONE, NONE, NONE, NONE)


@pytest.mark.parametrize(
    ("kinds", "misfit", "told"),
    [
        (("cause",), 1.0, ""),
        ((), 1.02, ""),
        (("cause",), 3.96, "misfit 3.96 with what was found (9 on axis_1 at 3-10 Hz (lines)): the extended"),
        (("unknown",), 1.0, "an unknown cause at axis_1: the extended robot lacks something"),
        (("cause", "unknown"), 3.96, "(lines)), and an unknown cause at axis_1: the extended robot"),
    ],
)
def test_what_is_left_is_a_remark(kinds: tuple[str, ...], misfit: float, told: str) -> None:
    found = reservations(tuple(map(finding, kinds)), misfit, LEFT)
    assert len(found) == bool(told)
    for doubt in found:
        assert told in doubt.sentence
        assert doubt.is_remark
