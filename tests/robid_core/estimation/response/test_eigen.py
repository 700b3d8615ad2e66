"""Eigenvalues of many small matrices: the kernel against LAPACK, closed forms and matrices without eigenvectors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from robid_core.estimation.response.eigen import eigen, matrix_function


def sorted_by_size(values: np.ndarray) -> np.ndarray:
    """Sort in an order that rounding does not change for distinct moduli."""
    return np.take_along_axis(values, np.argsort(np.abs(values), axis=-1), axis=-1)


@settings(max_examples=30, deadline=None)
@given(n=st.integers(1, 8), n_line=st.integers(1, 20), seed=st.integers(0, 2**32 - 1))
def test_eigenvalues_are_those_of_lapack(n: int, n_line: int, seed: int) -> None:
    generator = np.random.default_rng(seed)
    a = generator.standard_normal((n_line, n, n)) + 1j * generator.standard_normal((n_line, n, n))
    a *= 10.0 ** generator.integers(-8, 8)
    of = eigen(a, 1e12)
    # Unitary steps: a backward error of some n ulps, which an eigenvalue sees times its condition number.
    tolerance = 1e-14 * n * np.linalg.norm(a, axis=(1, 2)) * of.condition
    theirs = np.linalg.eigvals(a)
    distance = np.abs(of.value[..., None] - theirs[:, None, :])
    assert (distance.min(axis=2) <= tolerance[:, None]).all()
    assert (distance.min(axis=1) <= tolerance[:, None]).all()
    residual = a @ of.vector - of.vector * of.value[:, None, :]
    assert (np.linalg.norm(residual, axis=(1, 2)) <= 1e-14 * 10 * n * np.linalg.norm(a, axis=(1, 2))).all()
    assert np.linalg.norm(of.vector, axis=1) == pytest.approx(1.0)
    assert (np.abs(matrix_function(of, lambda x: x) - a).max(axis=(1, 2)) <= tolerance).all()


def test_special_matrices_keep_their_eigenvalues() -> None:
    shift = np.roll(np.eye(5), 1, axis=0) + 0j  # fifth roots of one: unshifted QR would stand still
    diagonal, zero, ones = (
        np.diag([3.0, 1.0, 2.0, 2.0, -1.0]) + 0j,
        np.zeros((5, 5)) + 0j,
        np.ones((5, 5)) + 0j,
    )
    of = eigen(np.stack([shift, diagonal, zero, ones]), 1e8)
    roots = np.exp(2j * np.pi * np.arange(5) / 5)
    assert np.abs(of.value[0][:, None] - roots).min(axis=0) == pytest.approx(0, abs=1e-14)
    assert np.sort(of.value[1].real) == pytest.approx([-1, 1, 2, 2, 3])
    assert of.value[2] == pytest.approx(0)
    assert np.sort(np.abs(of.value[3])) == pytest.approx([0, 0, 0, 0, 5], abs=1e-14)


def test_dependent_eigenvectors_are_known_by_their_condition() -> None:
    jordan = np.array([[2.0, 1.0], [0.0, 2.0]]) + 0j
    of = eigen(np.stack([jordan, np.diag([1.0, 2.0])]), 1e8)
    assert of.value[0] == pytest.approx(2.0)
    assert np.isnan(of.inverse[0]).all()
    assert np.isfinite(of.inverse[1]).all()


def test_neighbours_do_not_change_a_line_by_more_than_rounding() -> None:
    generator = np.random.default_rng(0)
    a = generator.standard_normal((40, 6, 6)) + 1j * generator.standard_normal((40, 6, 6))
    together, alone = eigen(a, 1e8).value, np.concatenate([eigen(one[None], 1e8).value for one in a])
    assert sorted_by_size(together) == pytest.approx(sorted_by_size(alone), rel=1e-12)
