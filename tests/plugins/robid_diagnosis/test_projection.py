"""Gains of columns with a fit projected out, against fits made anew: whole, with folds held out, and by chance."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from robid_diagnosis.projection import Projection

N_ROW, N_UNKNOWN, N_FOLD = 240, 7, 4
FOLDS = [slice(k * 60, (k + 1) * 60) for k in range(N_FOLD)]
GROUPS = [[k] for k in range(N_FOLD)]


class Problem:
    """A linear problem with priors, fitted, and three columns of which the first two belong to it."""

    def __init__(self, seed: int, size: float = 0.4) -> None:
        generator = np.random.default_rng(seed)
        self.rows = generator.standard_normal((N_ROW, N_UNKNOWN)) * np.geomspace(1, 100, N_UNKNOWN)
        self.columns = generator.standard_normal((3, N_ROW)) + 0.3 * self.rows[:, :3].T
        self.prior = np.geomspace(0.01, 3.0, N_UNKNOWN)
        truth = self.prior * generator.standard_normal(N_UNKNOWN)
        self.data = self.rows @ truth + size * self.columns[0] + generator.standard_normal(N_ROW)
        self.precision = self.rows.T @ self.rows + np.diag(self.prior**-2)
        self.point = np.linalg.solve(self.precision, self.rows.T @ self.data)

    def projection(self, point: np.ndarray | None = None) -> Projection:
        at = self.point if point is None else point
        residual = self.data - self.rows @ at
        return Projection(self.rows, residual, self.precision, at / self.prior**2, FOLDS)

    def cost(self, columns: np.ndarray, weak: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, float]:
        """Unknowns and sizes fitted to some rows, and the cost of these rows with the priors."""
        both = np.hstack((self.rows, columns.T))[rows]
        pull = np.concatenate((self.prior**-2, weak))
        found = np.linalg.solve(both.T @ both + np.diag(pull), both.T @ self.data[rows])
        left = self.data[rows] - both @ found
        return found, float(left @ left + pull @ found**2)


ALL = np.arange(N_ROW)


@pytest.mark.parametrize("offset", [0.0, 0.5])
def test_a_gain_is_what_a_fit_with_the_column_gains(offset: float) -> None:
    """At the minimum and beside it: sizes, standard errors and cost of a fit of all unknowns."""
    problem = Problem(1)
    columns = problem.columns[:1]
    projection = problem.projection(problem.point + offset * problem.prior)
    gain = projection.gain(projection.sums(columns), [False], blind=1e-6)
    found, cost = problem.cost(columns, np.zeros(1), ALL)
    _, before = problem.cost(np.zeros((0, N_ROW)), np.zeros(0), ALL)
    assert gain.total == pytest.approx(before - cost, rel=1e-8)
    assert gain.size[0] == pytest.approx(found[-1], rel=1e-8)
    both = np.hstack((problem.rows, columns.T))
    whole = both.T @ both + np.diag([*problem.prior**-2, 0.0])
    assert gain.error[0] == pytest.approx(np.sqrt(np.linalg.inv(whole)[-1, -1]), rel=1e-8)


def test_held_out_gains_are_those_of_fits_without_the_fold() -> None:
    """Each fold predicted by unknowns and sizes of the others, these with a weak pull to zero."""
    problem = Problem(2)
    columns = problem.columns[:1]
    projection = problem.projection()
    sums = projection.sums(columns)
    gain = projection.gain(sums, [False], blind=1e-6)
    weak = 1 / gain.size**2
    for fold, rows in enumerate(FOLDS):
        others = np.delete(ALL, ALL[rows])
        with_column, _ = problem.cost(columns, weak, others)
        without, _ = problem.cost(np.zeros((0, N_ROW)), np.zeros(0), others)
        before = problem.data[rows] - problem.rows[rows] @ without
        after = problem.data[rows] - np.hstack((problem.rows, columns.T))[rows] @ with_column
        expected = before @ before - after @ after
        found = projection.held_out(sums, gain, GROUPS)[fold]
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_gains_of_the_folds_are_the_gain_of_all_but_for_the_priors() -> None:
    """Priors lose what the data gain beyond the total."""
    problem = Problem(3)
    projection = problem.projection()
    sums = projection.sums(problem.columns[:1])
    gain = projection.gain(sums, [False], blind=1e-6)
    found, _ = problem.cost(problem.columns[:1], np.zeros(1), ALL)
    lost = (found[:-1] ** 2 - problem.point**2) @ problem.prior**-2
    assert projection.by_group(sums, gain, GROUPS).sum() == pytest.approx(gain.total + lost, rel=1e-6)


def test_what_acts_in_one_group_gains_there_only() -> None:
    """Against fits with a size for each group; a column that is zero elsewhere gains nothing there."""
    problem = Problem(6)
    projection = problem.projection()
    each = np.zeros((N_FOLD, N_ROW))
    for k, rows in enumerate(FOLDS):
        each[k, rows] = problem.columns[0, rows]
    sums = projection.sums(problem.columns[:1])
    gain = projection.gain(sums, [False], blind=1e-6)
    for k, found in enumerate(projection.by_own_size(sums, gain, GROUPS)):
        _, without = problem.cost(np.delete(each, k, axis=0), np.zeros(N_FOLD - 1), ALL)
        _, with_it = problem.cost(each, np.zeros(N_FOLD), ALL)
        assert found == pytest.approx(without - with_it, rel=1e-6)
    sums = projection.sums(each[2:3])
    gain = projection.gain(sums, [False], blind=1e-6)
    alone = projection.by_own_size(sums, gain, GROUPS)
    assert alone[2] == pytest.approx(gain.total, rel=1e-6)
    assert np.delete(alone, 2) == pytest.approx(0.0, abs=1e-9)
    assert projection.concentration(sums, gain, GROUPS) == 1
    assert projection.by_group(sums, gain, GROUPS)[2] != pytest.approx(gain.total, rel=1e-3)


def test_sizes_that_differ_between_groups_are_told_from_chance() -> None:
    """By chance chi-square, its mean within four standard errors; a size in one group only is far beyond."""
    found = []
    for seed in range(200):
        problem = Problem(300 + seed)
        projection = problem.projection()
        sums = projection.sums(problem.columns[:1])
        beyond, freedom = projection.disagreement(sums, projection.gain(sums, [False], blind=1e-6), GROUPS)
        assert freedom == N_FOLD - 1
        found.append(beyond)
    assert abs(np.mean(found) - freedom) < 4 * np.sqrt(2 * freedom / len(found))
    problem = Problem(6, size=0.0)
    problem.data[FOLDS[1]] += 2.0 * problem.columns[0, FOLDS[1]]
    projection = problem.projection(np.linalg.solve(problem.precision, problem.rows.T @ problem.data))
    sums = projection.sums(problem.columns[:1])
    beyond, _ = projection.disagreement(sums, projection.gain(sums, [False], blind=1e-6), GROUPS)
    assert scipy.stats.chi2.sf(beyond, freedom) < 1e-6


def test_columns_that_are_not_worth_it_stay_out() -> None:
    """Of three columns one acts: the others gain what chance gains, and a column of the fit itself is not seen."""
    problem = Problem(4, size=1.0)
    projection = problem.projection()
    gain = projection.gain(projection.sums(problem.columns), [False] * 3, blind=1e-6)
    assert gain.chosen == (0,)
    own = projection.sums(100 * problem.rows[:, 5:6].T.copy())
    assert projection.gain(own, [False], blind=1e-4).freedom == 0


def test_a_size_that_must_not_be_negative_is_none() -> None:
    problem = Problem(5, size=-1.0)
    projection = problem.projection()
    sums = projection.sums(problem.columns[:1])
    assert projection.gain(sums, [True], blind=1e-6).freedom == 0
    assert projection.gain(sums, [False], blind=1e-6).size[0] < 0


def test_by_chance_a_gain_is_chi_square() -> None:
    """200 draws without an effect: gains of one column have mean 1 and the 95 % quantile of chi-square."""
    gains = []
    for seed in range(200):
        problem = Problem(100 + seed, size=0.0)
        projection = problem.projection()
        gains.append(projection.gain(projection.sums(problem.columns[:1]), [False], blind=1e-6).total)
    above = np.mean(np.array(gains) > scipy.stats.chi2.ppf(0.95, 1))
    assert abs(above - 0.05) < 4 * np.sqrt(0.05 * 0.95 / 200)
    assert abs(np.mean(gains) - 1.0) < 4 * np.sqrt(2 / 200)


def test_a_column_that_would_turn_negative_makes_room_for_others() -> None:
    """The first alone explains most, being the sum of two others less a third of itself; with both of them it goes."""
    generator = np.random.default_rng(3)
    rows = generator.standard_normal((N_ROW, N_UNKNOWN))
    pair = generator.standard_normal((2, N_ROW))
    columns = np.stack((pair.sum(axis=0) + 0.3 * generator.standard_normal(N_ROW), *pair))
    data = 5 * pair[0] + 5 * pair[1] - 1.0 * columns[0]
    projection = Projection(rows, data, rows.T @ rows + np.eye(N_UNKNOWN), np.zeros(N_UNKNOWN), FOLDS)
    gain = projection.gain(projection.sums(columns), [True, True, True], blind=1e-6)
    assert set(gain.chosen) == {1, 2}
    assert (gain.size > 0).all()
