"""A weak law that a search alone does not show beyond chance: its fit names it. Development seeds."""

from __future__ import annotations

import pytest

from blind.judging import judged
from blind.plan import Wanted


def test_a_law_that_a_search_shows_in_part_is_named_by_its_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search gains 30 (p = 0.0015), the fit 50."""
    wanted = Wanted("middle", 501055, 1, ("friction.lugre",), (60, 200))
    row = judged(wanted, "test")
    assert "True" in (row["right"], row["in_class"])
    assert row["extras"] == "0"
    monkeypatch.setattr("robid_diagnosis.selection.UNSURE", 0.0)  # no law is fitted on suspicion
    assert not judged(wanted, "test")["told"]


def test_what_is_fitted_on_suspicion_is_not_named_where_nothing_is_hidden(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The best that a search shows of noise is fitted whatever its chance is, and counted as before."""
    monkeypatch.setattr("robid_diagnosis.selection.UNSURE", 1.1)
    monkeypatch.setattr("robid_diagnosis.selection.PROMISES", 0.3)
    rows = [judged(Wanted("nothing", 503000 + i), "test") for i in range(3)]
    assert all(not row["told"] for row in rows)
