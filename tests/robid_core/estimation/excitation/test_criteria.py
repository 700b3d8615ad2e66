"""Criteria of excitation: against plain numpy on the regressor itself, against differences, against scatter."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from robid_core.estimation.excitation.criteria import (
    Criterion,
    condition_number,
    cost,
    hadamard_ratio,
    log_determinant,
)


def regressor(seed: int, n_row: int = 40, n_parameter: int = 5) -> np.ndarray:
    """Columns of different size, two of them nearly alike."""
    draw = np.random.default_rng(seed)
    rows = draw.normal(size=(n_row, n_parameter)) * 10.0 ** draw.uniform(-1, 1, n_parameter)
    rows[:, 1] = rows[:, 0] + 0.1 * rows[:, 1]
    return rows


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_values_are_those_of_the_regressor_itself(seed: int) -> None:
    w = regressor(seed)
    gram = w.T @ w
    singular = np.linalg.svd(w, compute_uv=False)
    # Squaring the regressor squares its condition number: relative rounding of 1e-16 cond^2 < 1e-9 here.
    assert condition_number(gram) == pytest.approx(singular[0] / singular[-1], rel=1e-8)
    assert log_determinant(gram) == pytest.approx(2 * np.log(singular).sum(), abs=1e-8)
    ratio = np.linalg.det(w.T @ w) / np.prod((w**2).sum(axis=0))
    assert hadamard_ratio(gram) == pytest.approx(ratio, rel=1e-8)


@given(st.integers(0, 10_000), st.integers(2, 12))
@settings(max_examples=50, deadline=None)
def test_hadamards_ratio_lies_between_0_and_1_and_knows_no_units(seed: int, n_parameter: int) -> None:
    w = regressor(seed, 15, n_parameter)
    units = 10.0 ** np.random.default_rng(seed).uniform(-3, 3, n_parameter)
    plain, scaled = hadamard_ratio(w.T @ w), hadamard_ratio((w * units).T @ (w * units))
    assert 0.0 <= plain <= 1.0
    assert scaled == pytest.approx(plain, rel=1e-6)


def test_orthogonal_columns_have_ratio_1_and_dependent_ones_0() -> None:
    orthogonal = np.linalg.qr(np.random.default_rng(0).normal(size=(20, 4)))[0] * [1.0, 5.0, 0.1, 3.0]
    assert hadamard_ratio(orthogonal.T @ orthogonal) == pytest.approx(1.0, abs=1e-12)
    alike = np.column_stack([orthogonal, orthogonal[:, 0]])
    gram = alike.T @ alike
    assert hadamard_ratio(gram) == 0.0
    assert condition_number(gram) == np.inf
    assert log_determinant(gram) == -np.inf


@pytest.mark.parametrize("criterion", get_args(Criterion))
def test_the_slope_is_the_derivative_by_differences(criterion: Criterion) -> None:
    w = regressor(3)
    gram = w.T @ w / 40
    value, slope = cost(gram, criterion)
    expected = {
        "condition": np.log(condition_number(gram)),
        "log_det": -log_determinant(gram),
        "hadamard": -np.log(hadamard_ratio(gram)),
    }[criterion]
    assert value == pytest.approx(expected, rel=1e-9)
    draw = np.random.default_rng(4)
    for _ in range(5):
        # A direction of the size of the matrix itself, so that no column is lost in another's rounding.
        direction = draw.normal(size=gram.shape) * np.sqrt(np.outer(np.diag(gram), np.diag(gram)))
        direction = direction + direction.T
        step = 1e-7
        difference = cost(gram + step * direction, criterion)[0] - cost(gram - step * direction, criterion)[0]
        # Central differences of step h: error of third derivatives h^2 and rounding 1e-16 cond^2 / h, about 1e-5.
        assert np.sum(slope * direction) == pytest.approx(difference / (2 * step), rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("sharpness", [1.0, 4.0, 16.0])
def test_the_smooth_condition_number_has_its_slope_and_grows_towards_the_true_one(sharpness: float) -> None:
    w = np.random.default_rng(7).normal(size=(40, 5))
    gram = w.T @ w
    value, slope = cost(gram, "condition", sharpness)
    eigenvalue = np.linalg.eigvalsh(gram)
    means = np.mean(eigenvalue**sharpness) * np.mean(eigenvalue**-sharpness)
    assert value == pytest.approx(0.5 / sharpness * np.log(means), rel=1e-9)
    assert value < cost(gram, "condition", 2 * sharpness)[0] < np.log(condition_number(gram))
    direction = np.random.default_rng(8).normal(size=gram.shape)
    direction = direction + direction.T
    up, down = (cost(gram + sign * 1e-4 * direction, "condition", sharpness)[0] for sign in (1, -1))
    assert np.sum(slope * direction) == pytest.approx((up - down) / 2e-4, rel=1e-5)


@pytest.mark.parametrize("criterion", get_args(Criterion))
def test_a_singular_start_has_a_finite_cost(criterion: Criterion) -> None:
    value, slope = cost(np.diag([1.0, 0.0, 2.0]), criterion)
    assert np.isfinite(value)
    assert np.isfinite(slope).all()
