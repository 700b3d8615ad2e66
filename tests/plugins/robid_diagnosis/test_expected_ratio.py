"""The expected ratio against refits of linear hypotheses that are written out."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import FloatArray
from robid_diagnosis.expected_ratio import expected_ratio

OLD, NEW, DRAWS = 60, 40, 4000


def cost(rows: FloatArray, data: FloatArray, prior: FloatArray) -> float:
    """Half the least sum of squares, priors of zero with these precisions among them."""
    every = np.concatenate((rows, np.diag(np.sqrt(prior))))
    wanted = np.concatenate((data, np.zeros(len(prior))))
    found = np.linalg.lstsq(every, wanted, rcond=None)[0]
    return 0.5 * float(((wanted - every @ found) ** 2).sum())


def hypotheses(seed: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Two regressions of four unknowns: (old, new) rows of each, a new column behaves otherwise than the old ones."""
    generator = np.random.default_rng(seed)
    common = generator.standard_normal((OLD + NEW, 3))
    own = generator.standard_normal((OLD + NEW, 1))
    rival = own.copy()
    rival[OLD:] = 0.6 * own[OLD:] + 0.4 * generator.standard_normal((NEW, 1))
    first, second = np.hstack((common, own)), np.hstack((common, rival))
    return first[:OLD], first[OLD:], second[:OLD], second[OLD:]


def test_a_refit_to_old_and_new_data_loses_what_is_expected() -> None:
    """Without noise exactly: old data that the rival explains, new ones as the first hypothesis says."""
    first_old, first_new, old, new = hypotheses(0)
    prior, truth = np.full(4, 0.5), np.array([1.0, -2.0, 0.5, 3.0])
    data = first_old @ truth
    precision = old.T @ old + np.diag(prior)
    point = np.linalg.solve(precision, old.T @ data)  # the rival's fit to the old data
    difference = first_new @ truth - new @ point
    both = cost(np.concatenate((old, new)), np.concatenate((data, first_new @ truth)), prior)
    expected = expected_ratio(difference, new, precision)
    assert expected == pytest.approx(both - cost(old, data, prior), rel=1e-9)
    assert expected > 10


def test_what_the_unknowns_can_take_up_does_not_count() -> None:
    """Along a column that old data hardly told next to nothing is left, across it all of it."""
    generator = np.random.default_rng(1)
    rows = np.linalg.qr(generator.standard_normal((NEW, 3)))[0]
    weak = np.diag([1e-6, 1.0, 1e6])
    sizes = [expected_ratio(10 * rows[:, i], rows, weak) for i in range(3)]
    # For one column of norm 1 the closed form is 1/2 d^2 h / (1 + h).
    assert sizes == pytest.approx([50e-6, 25.0, 50.0], rel=2e-6)
    across = generator.standard_normal(NEW)
    across -= rows @ (rows.T @ across)
    assert expected_ratio(across, rows, weak) == pytest.approx(0.5 * float(across @ across))


def test_the_mean_of_noisy_refits_is_the_expected_ratio_and_what_noise_both_take_up() -> None:
    """Old data are one draw, new ones many; the closed form of the noise's share is the oracle's, not the function's.

    Each refit takes up (n - tr S^-1) / 2 of the new noise, S = I + J H^-1 J^T. The mean of 4000 draws has a standard
    error of sqrt(2 E / 4000), E about 20: the test allows four.
    """
    first_old, first_new, old, new = hypotheses(2)
    generator = np.random.default_rng(3)
    data = first_old @ np.array([1.0, -2.0, 0.5, 1.5]) + generator.standard_normal(OLD)
    none = np.full(4, 1e-9)
    points, spreads, before = [], [], []
    for rows, further in ((first_old, first_new), (old, new)):
        points.append(further @ np.linalg.lstsq(rows, data, rcond=None)[0])
        spreads.append(np.eye(NEW) + further @ np.linalg.inv(rows.T @ rows) @ further.T)
        before.append(cost(rows, data, none))
    expected = expected_ratio(points[0] - points[1], new, old.T @ old)
    taken = 0.5 * float(np.trace(np.linalg.inv(spreads[1])) - np.trace(np.linalg.inv(spreads[0])))
    ratios = []
    for _ in range(DRAWS):
        measured = points[0] + generator.standard_normal(NEW)
        after = [
            cost(np.concatenate((a, b)), np.concatenate((data, measured)), none)
            for a, b in ((first_old, first_new), (old, new))
        ]
        ratios.append(after[1] - before[1] - after[0] + before[0])
    error = float(np.std(ratios)) / np.sqrt(DRAWS)
    assert expected > 5
    assert abs(np.mean(ratios) - expected - taken) < 4 * error
