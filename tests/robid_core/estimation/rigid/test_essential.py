"""Essential parameters: what is zero goes, what is not stays, and the order is that of relative standard errors."""

from __future__ import annotations

import numpy as np
import scipy

from robid_core.estimation.rigid.essential import eliminate


def drawn(seed: int, true: np.ndarray, n: int = 400) -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(seed)
    rows = draw.standard_normal((n, len(true))) * np.geomspace(1, 30, len(true))
    rows[:, 1] += 0.5 * rows[:, 0]
    return rows, rows @ true + draw.standard_normal(n)


def test_columns_without_a_share_go_as_often_as_the_level_says() -> None:
    true = np.array([2.0, 0.0, 1.0, 0.0, 0.5, 0.0])
    right, kept = 0, set[int]()
    for seed in range(100):
        found = eliminate(*drawn(seed, true), freedom=400)
        kept = set(found.kept.tolist())
        assert {0, 2, 4} <= kept
        right += kept == {0, 2, 4}
    # Three zeros together pass a test at 5 % in 95 of 100; 2.2 is one standard deviation.
    assert 88 <= right <= 100


def test_steps_are_those_of_least_squares_written_out() -> None:
    rows, target = drawn(3, np.array([1.0, 0.001, 0.8, 0.0]))
    found = eliminate(rows, target, freedom=400)

    def fit(columns: list[int]) -> tuple[np.ndarray, np.ndarray, float]:
        best, square = np.linalg.lstsq(rows[:, columns], target)[:2]
        spread = np.diag(np.linalg.inv(rows[:, columns].T @ rows[:, columns]))
        return best, spread, float(square[0])

    columns, least = [0, 1, 2, 3], fit([0, 1, 2, 3])[2]
    for n_removed, gone in enumerate(found.removed.tolist(), start=1):
        best, spread, _ = fit(columns)
        relative = np.sqrt(least / 396 * spread) / np.abs(best)
        assert columns[int(np.argmax(relative))] == gone
        np.testing.assert_allclose(found.relative_error[n_removed - 1], relative.max(), rtol=1e-9)
        columns.remove(gone)
        more = fit(columns)[2] - least
        chance = scipy.stats.f.sf(more / n_removed / (least / 396), n_removed, 396)
        np.testing.assert_allclose(found.probability[n_removed - 1], chance, rtol=1e-6)
        np.testing.assert_allclose(found.increase[n_removed - 1], np.sqrt(1 + more / least) - 1, rtol=1e-6)
    np.testing.assert_allclose(found.estimate, fit(columns)[0], rtol=1e-9)


def test_the_last_column_stays() -> None:
    draw = np.random.default_rng(0)
    found = eliminate(draw.standard_normal((50, 3)), draw.standard_normal(50), freedom=50)
    assert len(found.kept) >= 1
    assert eliminate(np.empty((50, 0)), np.ones(50), freedom=50).kept.size == 0
