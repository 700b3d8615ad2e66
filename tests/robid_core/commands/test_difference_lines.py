"""What `robid diff` shows of two fits, and in which words ingredients differ."""

from __future__ import annotations

import numpy as np

from robid_core import Fit, ParameterTable
from robid_core.commands.diff import fit_difference_lines
from robid_core.run.identity import differences


def differing_fits(shifts: list[float], groups: tuple[str, ...]) -> tuple[Fit, Fit]:
    """Two fits whose parameters differ by so many standard errors of the difference."""
    n, errors = len(shifts), np.full(len(shifts), 0.1)
    names = tuple(f"number_{place}" for place in range(n))
    table = ParameterTable(
        names,
        ("1",) * n,
        groups,
        np.ones(n),
        np.ones(n),
        errors,
        np.ones(n, dtype=bool),
        np.zeros(n, dtype=bool),
    )
    first = Fit("test", "ended", True, 1.0, 1, 1, table, np.eye(n), names)
    moved = table.replace(estimate=1.0 + np.array(shifts) * 0.1 * 2**0.5)
    return first, first.replace(parameters=moved)


def test_diff_shows_what_differs_most_first_and_says_how_much_is_left() -> None:
    """Nuisance parameters stay away however far they are, and so does what would be printed as 0.00."""
    shifts = [0.1 * place for place in range(1, 31)] + [9.0] * 5 + [1e-4]
    groups = ("friction",) * 30 + ("nuisance",) * 5 + ("friction",)
    lines = fit_difference_lines(*differing_fits(shifts, groups))
    assert [line.split()[0] for line in lines[1:13]] == [f"number_{place}" for place in range(29, 17, -1)]
    left = "... 24 more differ (19 of the robot, 5 nuisance parameters), by 9 standard errors at most"
    assert lines[13:] == [f"{left}: --all shows them"]
    whole = fit_difference_lines(*differing_fits(shifts, groups), everything=True)
    assert [line.split()[0] for line in whole[1:]] == [f"number_{place}" for place in range(36)]


def test_diff_has_no_table_of_zeros() -> None:
    lines = fit_difference_lines(*differing_fits([1e-4, -2e-4], ("stiffness",) * 2))
    assert lines == [
        "2 parameters differ (2 of the robot), by 0.0002 standard errors at most: --all shows them"
    ]


def test_diff_says_in_words_what_a_page_tells() -> None:
    old, new = ({"told": {"run": run, "warnings": []}} for run in ("six-axis", "six-b"))
    assert differences(old, new) == ['name of the run, which the page tells: "six-axis" -> "six-b"']
    warned = {"told": {"run": "six-axis", "warnings": ["time stamps jitter"]}}
    assert differences(old, warned) == ["warnings of the stages before it, which the page tells, changed"]
