"""The study of the fit's accuracy in small: its tables go on where they stopped, and its sums are right."""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2]))
from robid_core.registry import STAGES, registry
from studies.fit_accuracy import accuracy, alarm, bound_check, tables, wear
from studies.fit_accuracy.run import QUESTIONS
from studies.fit_accuracy.scenarios import SCENARIOS
from studies.fit_accuracy.tables import Question, Row

FOLDER = Path(accuracy.__file__).parent


@pytest.fixture
def threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows are made by threads: a function of a test cannot be sent to another process."""
    monkeypatch.setattr(tables, "ProcessPoolExecutor", lambda jobs, mp_context: ThreadPoolExecutor(jobs))


def question(made: list[tuple[str, int]]) -> Question:
    def row(letter: str, seed: int) -> Row:
        made.append((letter, seed))
        return {"value": f"{letter}{seed}"} | ({"more": "1"} if letter == "b" else {})

    return Question({"letter": ("b", "a")}, "seed", row, lambda rows: [])


@pytest.mark.usefixtures("threads")
def test_a_table_is_filled_where_rows_are_missing_and_stays_in_order(tmp_path: Path) -> None:
    made: list[tuple[str, int]] = []
    path = tmp_path / "table.csv"
    tables.fill(question(made), path, [2], "command", only=["a"])
    tables.fill(question(made), path, [1, 2], "command")
    assert sorted(made) == [("a", 1), ("a", 2), ("b", 1), ("b", 2)]
    rows = tables.read(path)
    assert [row["value"] for row in rows] == ["b1", "b2", "a1", "a2"]
    assert [row["more"] for row in rows] == ["1", "1", "", ""]
    assert {row["commit"] for row in rows} == {tables.commit()}
    assert path.read_text(encoding="utf-8").startswith("# command\n")


@pytest.mark.usefixtures("threads")
def test_a_row_that_fails_loses_none_that_were_made(tmp_path: Path) -> None:
    def row(seed: int) -> Row:
        if seed == 2:
            raise ArithmeticError("no poses")
        return {"value": "1"}

    path = tmp_path / "table.csv"
    with pytest.raises(ArithmeticError):
        tables.fill(Question({}, "seed", row, lambda rows: []), path, [1, 2], "command")
    assert [row["seed"] for row in tables.read(path)] == ["1"]


def test_every_kept_table_is_one_that_its_question_fills() -> None:
    for name, asked in QUESTIONS.items():
        rows = tables.read(FOLDER / f"{name}.csv")
        keys = [asked.key(row) for row in rows]
        assert len(set(keys)) == len(keys)
        assert rows == sorted(rows, key=asked.place)
        if rows:
            assert asked.report(rows)


def test_stages_of_the_scenarios_are_registered() -> None:
    for scenario in SCENARIOS.values():
        for name in scenario.chain:
            registry().load(STAGES, name)()


def rows_of(errors: Any, stated: Any, bound: Any, **more: Callable[[int], str]) -> list[Row]:
    """Rows with these numbers of springs, (n_row, n_spring) each."""
    found = []
    for k, numbers in enumerate(zip(errors, stated, bound, strict=True)):
        row = {key: value(k) for key, value in more.items()} | {"misfit": "1.0", "fit_s": "3"}
        for what, values in zip(("error", "stated", "bound"), numbers, strict=True):
            row |= {f"{what}.spring_{s}": repr(float(value)) for s, value in enumerate(values)}
        found.append(row)
    return found


def test_scatter_as_large_as_the_bound_passes_and_a_wrong_bound_is_marked() -> None:
    """Of 50 draws a scatter 1.6 times the bound is above the interval, which ends at 1.20, by 4 of its deviations."""
    bound = np.tile([1e-4, 2e-4, 1e-4], (50, 1))
    drawn = np.random.default_rng(1).standard_normal((50, 3)) * bound
    errors = drawn / drawn.std(axis=0, ddof=1) * bound[0] * [1.0, 1.0, 1.6]
    errors[:, 1] += 1e-4 - errors[:, 1].mean()
    lines = bound_check.report(rows_of(errors, bound, bound))
    assert "0.80 to 1.20" in lines[0]
    assert lines[2].split()[:2] == ["spring_0", "1.00"]
    assert lines[3].split()[:3] == ["spring_1", "1.00", "3.5"]  # 1e-4 over 2e-4 / sqrt(50)
    assert lines[4].split()[1] == "1.60!"
    assert lines[5].startswith("all, 1 outside")
    rms = np.sqrt(((errors / bound) ** 2).mean(axis=0))
    assert [line.split()[3] for line in lines[2:5]] == [f"{z:.2f}" for z in rms]


def test_least_amplitude_and_time_are_those_whose_error_is_small_enough() -> None:
    errors = {("0.1", "8"): 0.05, ("0.1", "384"): 0.005, ("0.2", "8"): 0.02, ("0.2", "16"): 0.002}
    ones = np.ones((1, 2))
    rows = [
        row
        for (amplitude, seconds), error in errors.items()
        for row in rows_of(
            error * ones,
            0.01 * ones,
            0.01 * ones,
            amplitude=lambda k, told=amplitude: told,
            seconds=lambda k, told=seconds: told,
            standstill=lambda k: "0.25",
        )
    ]
    lines = wear.report(rows)
    assert lines[-2] == "1 %: least amplitude 0.1; least time 384 s at 0.1, 16 s at 0.2"
    assert lines[-1] == "0.3 %: least amplitude 0.2; least time 16 s at 0.2"
    assert lines[1].split() == ["0.1", "8", "1", "5.0000", "5.0000", "1.9600", "0.0%", "1.000", "0.25"]


def test_plans_of_motion_last_as_long_as_they_are_called() -> None:
    for seconds in wear.PLANS:
        assert wear.experiments_of(seconds, 0.5).motion_s == float(seconds)


def test_the_alarm_counts_plants_above_its_level() -> None:
    ones = np.full((4, 2), 0.01)
    rows = rows_of(ones, ones, ones, simulator=lambda k: "foreign" if k < 3 else "own")
    for row, misfit in zip(rows, (1.2, 1.05, 1.09, 300.0), strict=True):
        row["misfit"] = str(misfit)
    foreign, own = alarm.report(rows)
    assert "above 1.08 in 2 of 3 plants" in foreign
    assert "1 of 1 plants" in own


def test_a_robot_with_other_springs_stands_beside_the_packaged_one() -> None:
    """Errors twice what is stated everywhere: covered nowhere, whatever the number of springs."""
    six = rows_of(
        np.full((2, 3), 2e-3), np.full((2, 3), 1e-3), np.full((2, 3), 1e-3), scenario=lambda k: "late"
    )
    light = rows_of([[4e-3]], [[1e-3]], [[2e-3]], scenario=lambda k: "light_robot")
    for row in light:
        row |= {f"{what}.spring_{s}": "" for what in ("error", "stated", "bound") for s in (1, 2)}
    head, late, other, whole = accuracy.report([*six, *light], "own")
    names = head.split()
    assert names[0] == "robid"
    assert late.split()[:5] == ["late", "2", "0.2000", "0.05", "2.00"]
    assert other.split()[:5] == ["light_robot", "1", "0.4000", "0.1", "2.00"]
    assert "covered 0.0 %, each spring 0 % at least" in whole
