"""The bench of the simulator runs from end to end; its accuracies are asserted, its rates are printed."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

pytestmark = pytest.mark.full


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    folder = str(Path(__file__).parent)
    if folder not in sys.path:
        sys.path.append(folder)
    import simulation

    return simulation


def test_every_row_is_measured_and_stands_in_the_table(
    bench: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bench.main(["--look"]) == 0
    table = capsys.readouterr().out
    assert table.count("\n") >= 2 + len(bench.BENCHES)
    for words in ("per second and core", "pinocchio", "MuJoCo", "1/8 step", "24 x 100 x 15 s", "memory"):
        assert words in table


@pytest.mark.parametrize("name", ["accuracy", "response", "memory"])
def test_targets_that_no_clock_decides_are_reached(bench: ModuleType, name: str) -> None:
    missed = [row for row in bench.BENCHES[name](bench.LOOK) if row.reached is False]
    assert not missed


def test_runge_kutta_at_two_steps_agrees_so_that_it_can_judge(bench: ModuleType) -> None:
    accuracy = sys.modules["simulation_accuracy"]  # imported with the bench
    fine, _ = accuracy.response_errors(bench.LOOK)
    assert fine.max() < 1e-5
