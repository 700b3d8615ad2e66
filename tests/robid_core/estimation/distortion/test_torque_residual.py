"""Torque that is not linear in the motion: an exact projection at the lines, a straight line between them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies

from robid_core import PoorExcitation
from robid_core.estimation.distortion.torque_residual import MotionBasis, motion_basis, torque_residual

BINS = np.arange(3, 42)
LINE = np.arange(5, 40, 4)


def complex_normal(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def basis_of(rng: np.random.Generator, n_exp: int, n_axis: int) -> MotionBasis:
    return motion_basis(complex_normal(rng, n_exp, len(BINS), n_axis), LINE, BINS)


def test_a_torque_linear_in_the_motion_leaves_nothing_where_the_relation_runs_straight() -> None:
    rng = np.random.default_rng(1)
    basis = basis_of(rng, 5, 3)
    start, slope = complex_normal(rng, 2, 2, 3)
    relation = start + slope * BINS[:, None, None]
    torque = np.einsum("bsa,eba->ebs", relation, basis.motion)
    within = (LINE[0] <= BINS) & (LINE[-1] >= BINS)
    left = np.abs(torque_residual(torque, basis))
    # Rounding of 1e-16 times entries of some hundred times the condition of random 5 x 3 matrices.
    assert left[:, within].max() < 1e-10
    assert left[:, ~within].max() > 0.1  # beyond the lines the relation is held, and this one goes on
    np.testing.assert_allclose(basis.relation(torque)[within], relation[within], atol=1e-10)


def test_at_a_line_the_residual_is_what_least_squares_over_the_experiments_leaves() -> None:
    rng = np.random.default_rng(2)
    basis = basis_of(rng, 7, 2)
    signal = complex_normal(rng, 7, len(BINS), 3)
    left = torque_residual(signal, basis)
    for bin_number in LINE:
        k = int(bin_number - BINS[0])
        coefficients = np.linalg.lstsq(basis.motion[:, k], signal[:, k])[0]
        np.testing.assert_allclose(left[:, k], signal[:, k] - basis.motion[:, k] @ coefficients, atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(seed=strategies.integers(0, 2**32), factor=strategies.floats(-5, 5))
def test_the_residual_is_linear_in_the_signal(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    basis = basis_of(rng, 4, 2)
    a, b = complex_normal(rng, 2, 4, len(BINS), 2)
    together = torque_residual(a + factor * b, basis)
    apart = torque_residual(a, basis) + factor * torque_residual(b, basis)
    np.testing.assert_allclose(together, apart, atol=1e-9 * (1 + np.abs(apart).max()))


def test_least_squares_on_residual_regressors_is_that_with_a_free_relation_at_each_line() -> None:
    """Frisch and Waugh: the coefficient of X beside a free H at the lines is that of residual on residual."""
    rng = np.random.default_rng(3)
    basis = motion_basis(complex_normal(rng, 6, len(LINE), 2), LINE, LINE)
    regressor, noise = complex_normal(rng, 2, 6, len(LINE), 1)
    relation = complex_normal(rng, len(LINE), 2)
    torque = np.einsum("ba,eba->eb", relation, basis.motion)[..., None] + 0.7 * regressor + 0.1 * noise
    left, column = (torque_residual(x, basis).ravel() for x in (torque, regressor))
    short = np.vdot(column, left) / np.vdot(column, column)
    whole = np.zeros((6 * len(LINE), 2 * len(LINE) + 1), dtype=complex)
    for k in range(len(LINE)):
        whole[k :: len(LINE), 2 * k : 2 * k + 2] = basis.motion[:, k]
    whole[:, -1] = regressor.ravel()
    assert np.linalg.lstsq(whole, torque.ravel())[0][-1] == pytest.approx(short, abs=1e-12)


def test_degrees_of_freedom_are_the_power_that_white_noise_leaves() -> None:
    rng = np.random.default_rng(4)
    basis = basis_of(rng, 5, 2)
    assert basis.freedom[np.isin(BINS, LINE)].tolist() == [3.0] * len(LINE)
    signal = complex_normal(rng, 5, len(BINS), 4000)
    power = np.mean(np.abs(torque_residual(signal, basis)) ** 2, axis=-1).sum(axis=0) / 2
    excited = np.isin(BINS, LINE)
    # A mean over 4000 signals of 5 complex numbers: relative deviation 1 / sqrt(4000 * 3), six of them.
    np.testing.assert_allclose(power[excited], 3.0, rtol=6 / np.sqrt(4000 * 3))
    # At the bins between, an interpolated relation adds power and takes none.
    assert (power[~excited] > 5.0 * (1 - 6 / np.sqrt(4000 * 5))).all()


def test_with_as_many_experiments_as_axes_the_lines_themselves_say_nothing() -> None:
    basis = basis_of(np.random.default_rng(5), 3, 3)
    assert not basis.usable[np.isin(BINS, LINE)].any()
    assert basis.usable[~np.isin(BINS, LINE)].all()


def test_a_line_at_which_an_axis_repeats_another_is_not_used() -> None:
    rng = np.random.default_rng(6)
    motion = complex_normal(rng, 4, len(BINS), 2)
    motion[:, LINE[2] - BINS[0], 1] = motion[:, LINE[2] - BINS[0], 0]
    basis = motion_basis(motion, LINE, BINS)
    assert not basis.usable[LINE[2] - BINS[0]]
    assert basis.usable.sum() == len(BINS) - 1
    assert np.isfinite(torque_residual(motion, basis)).all()


def test_too_few_experiments_are_refused_with_their_number() -> None:
    with pytest.raises(PoorExcitation, match="2 experiments .* 3 axes"):
        basis_of(np.random.default_rng(7), 2, 3)


def test_axes_that_never_move_apart_are_refused() -> None:
    motion = np.repeat(complex_normal(np.random.default_rng(8), 4, len(BINS), 1), 2, axis=-1)
    with pytest.raises(PoorExcitation, match=f"0 of {len(LINE)} excited lines"):
        motion_basis(motion, LINE, BINS)
