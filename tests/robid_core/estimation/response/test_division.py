"""Division of matrices line by line: kernel and numpy against twins by singular values, and what both refuse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from robid_core.estimation.response import division as dv

LIMIT = 1e6


def numbers(generator: np.random.Generator, *shape: int) -> Any:
    """Complex Gaussian numbers."""
    return generator.standard_normal(shape) + 1j * generator.standard_normal(shape)


def sizes(square: np.ndarray) -> np.ndarray:
    """Root mean square of each axis over the lines, (..., n); at least 1e-9 of the largest."""
    size = np.sqrt(np.mean(square, axis=-2))
    largest = size.max(axis=-1, keepdims=True)
    return np.maximum(size, np.where(largest > 0, 1e-9 * largest, 1.0))


def divide_by_svd(a: np.ndarray, b: np.ndarray | None, condition_limit: float) -> dv.Quotient:
    """Divide as `divide` does, by one singular value decomposition a line; conditions are exact."""
    size = sizes(np.sum(np.abs(a) ** 2, axis=-1))[..., None, :, None]
    left: np.ndarray
    singular: np.ndarray
    right: np.ndarray
    left, singular, right = np.linalg.svd(a / size, full_matrices=False)
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.where(singular[..., -1] > 0, singular[..., 0] / singular[..., -1], np.inf)
        reciprocal = np.where((condition <= condition_limit)[..., None], 1.0 / singular, np.nan)
    # A = size L S R, hence A^+ = R^H S^-1 L^H / size: `size` belongs to the rows of L.
    unscaled = left * reciprocal[..., None, :] / size
    inverse: np.ndarray = right.conj().swapaxes(-1, -2) @ unscaled.conj().swapaxes(-1, -2)
    value = inverse if b is None else b @ inverse
    return dv.Quotient(value, unscaled @ unscaled.conj().swapaxes(-1, -2), condition)


def divide_jointly_by_svd(u: np.ndarray, y: np.ndarray, r: np.ndarray, condition_limit: float) -> dv.Quotient:
    """Divide as `divide_jointly` does, in plain numpy; conditions are exact."""
    left, output, right = (np.concatenate(list(np.moveaxis(x, -4, 0)), axis=-1) for x in (u, y, r))
    size = sizes(np.sum(np.abs(left) ** 2, axis=-1))[..., None, :, None]
    adjoint = right.conj().swapaxes(-1, -2)
    inverse = adjoint @ np.linalg.inv(left @ adjoint)
    condition = np.linalg.norm(left / size, 2, axis=(-2, -1)) * np.linalg.norm(
        inverse * size.swapaxes(-1, -2), 2, axis=(-2, -1)
    )
    inverse = np.where((condition <= condition_limit)[..., None, None], inverse, np.nan)
    return dv.Quotient(output @ inverse, inverse.conj().swapaxes(-1, -2) @ inverse, condition)


@settings(max_examples=25, deadline=None)
@given(
    n=st.integers(1, 7),
    extra=st.integers(0, 5),
    n_line=st.integers(1, 17),
    n_config=st.integers(1, 2),
    seed=st.integers(0, 2**32 - 1),
    compiled=st.booleans(),
)
def test_lines_are_divided_as_singular_values_do(
    n: int, extra: int, n_line: int, n_config: int, seed: int, compiled: bool
) -> None:
    generator = np.random.default_rng(seed)
    a = numbers(generator, n_config, n_line, n, n + extra)
    a *= np.geomspace(1e-3, 1e3, n)[:, None]  # units of the axes
    for b in (numbers(generator, n_config, n_line, 3, n + extra), None):
        ours, twin = dv.divide(a, b, LIMIT, compiled=compiled), divide_by_svd(a, b, LIMIT)
        # Orthogonalisation is backward stable: relative errors of a few n times the condition number in ulps.
        # Frobenius norms are at most n times the spectral ones, never below.
        error = 1e-15 * 20 * n * twin.condition[..., None, None]
        rows = np.sqrt(np.sum(np.abs(a) ** 2, axis=-1)).max(axis=(0, 1))
        size = np.abs(twin.value * rows).max(axis=(-2, -1), keepdims=True)
        assert (np.abs((ours.value - twin.value) * rows) <= error * size).all()
        outer = np.outer(rows, rows)
        size = np.abs(twin.gram_inverse * outer).max(axis=(-2, -1), keepdims=True)
        assert (np.abs((ours.gram_inverse - twin.gram_inverse) * outer) <= 10 * error * size).all()
        assert (ours.condition >= twin.condition * (1 - 1e-9)).all()
        assert (ours.condition <= n * twin.condition * (1 + 1e-9)).all()


def test_few_lines_take_no_kernel_and_many_do(monkeypatch: pytest.MonkeyPatch) -> None:
    from robid_core.estimation.response import division_kernel

    calls = list[int]()
    kernel = division_kernel.divide_lines

    def heard(*arguments: Any) -> None:
        calls.append(len(arguments[1]))
        kernel(*arguments)

    monkeypatch.setattr(division_kernel, "divide_lines", heard)
    a = numbers(np.random.default_rng(6), dv.FEW + 1, 2, 3)
    few, many = dv.divide(a[:-1], None, LIMIT), dv.divide(a, None, LIMIT)
    assert calls == [dv.FEW + 1]
    assert few.value == pytest.approx(many.value[:-1], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("compiled", [False, True])
def test_blocks_stand_side_by_side(compiled: bool) -> None:
    generator = np.random.default_rng(1)
    u, y, r = (numbers(generator, 2, 3, 11, 4, 2) for _ in range(3))
    joined = [np.concatenate(list(np.moveaxis(x, 1, 0)), axis=-1) for x in (u, y, r)]
    ours = dv.divide(u, y, LIMIT, parts=True, compiled=compiled)
    twin = divide_by_svd(joined[0], joined[1], LIMIT)
    assert ours.value == pytest.approx(twin.value, rel=1e-9, abs=1e-12)
    assert ours.gram_inverse == pytest.approx(twin.gram_inverse, rel=1e-9, abs=1e-12)
    # Not contiguous arrays are what a record yields.
    turned = [np.moveaxis(np.ascontiguousarray(np.moveaxis(x, -1, 0)), 0, -1) for x in (u, y)]
    assert (dv.divide(turned[0], turned[1], LIMIT, parts=True, compiled=compiled).value == ours.value).all()


@pytest.mark.parametrize("n", [1, 2, 6])
def test_joint_division_is_the_formula_of_the_thesis(n: int) -> None:
    generator = np.random.default_rng(n)
    u, y, r = (numbers(generator, 2, 3, 9, n, n + 1) for _ in range(3))
    ours, twin = dv.divide_jointly(u, y, r, LIMIT), divide_jointly_by_svd(u, y, r, LIMIT)
    for c, k in ((0, 0), (1, 8)):
        all_u, all_y, all_r = (np.concatenate(list(x[c, :, k]), axis=-1) for x in (u, y, r))
        inverse = all_r.conj().T @ np.linalg.inv(all_u @ all_r.conj().T)  # (3.14)
        assert ours.value[c, k] == pytest.approx(all_y @ inverse, rel=1e-9, abs=1e-10)
        assert ours.gram_inverse[c, k] == pytest.approx(inverse.conj().T @ inverse, rel=1e-9, abs=1e-10)
    assert ours.value == pytest.approx(twin.value, rel=1e-8, abs=1e-10)
    assert (ours.condition >= twin.condition * (1 - 1e-9)).all()
    assert (ours.condition <= n * twin.condition * (1 + 1e-9)).all()


@pytest.mark.parametrize(("joint", "compiled"), [(False, False), (False, True), (True, True)])
def test_both_refuse_the_same_lines(joint: bool, compiled: bool) -> None:
    # Conditions on both sides of the limit, some within the factor n that Frobenius norms leave open.
    generator = np.random.default_rng(3)
    n, condition = 4, np.concatenate((np.geomspace(1e4, 1e8, 40), [np.inf]))
    left, right = (np.linalg.qr(numbers(generator, 41, n, n))[0] for _ in range(2))
    singular = np.ones((41, n))
    singular[:, -1] = 1 / condition
    a = left @ (singular[..., None] * right)
    b = numbers(generator, 41, n, n)
    if joint:
        # R with the inputs' own row space: A is their pseudo-inverse.
        ours, twin = dv.divide_jointly(a[None], b[None], right[None], LIMIT), divide_by_svd(a, b, LIMIT)
    else:
        ours, twin = dv.divide(a, b, LIMIT, compiled=compiled), divide_by_svd(a, b, LIMIT)
    refused = np.isnan(twin.value).any(axis=(1, 2))
    assert 10 < refused.sum() < 31
    assert (np.isnan(ours.value).any(axis=(1, 2)) == refused).all()
    assert (np.isnan(ours.gram_inverse).any(axis=(1, 2)) == refused).all()
    assert np.isinf(ours.condition[-1]) or ours.condition[-1] > 1e14
    kept = ~refused
    error = np.abs(ours.value - twin.value)[kept].max(axis=(1, 2))
    assert (error <= 1e-13 * twin.condition[kept] * np.abs(twin.value)[kept].max(axis=(1, 2))).all()


@pytest.mark.parametrize("compiled", [False, True])
def test_an_axis_that_does_not_move_and_one_line_that_is_zero_are_refused(compiled: bool) -> None:
    generator = np.random.default_rng(4)
    a = numbers(generator, 9, 2, 2)
    a[3] = 0.0
    quotient = dv.divide(a, None, LIMIT, compiled=compiled)
    assert (np.isnan(quotient.value).any(axis=(1, 2)) == (np.arange(9) == 3)).all()
    assert np.isinf(quotient.condition[3])
    a[:, 1] = 1e-12 * a[:, 0]  # crosstalk at the level of rounding
    assert np.isnan(dv.divide(a, None, LIMIT, compiled=compiled).value).any(axis=(1, 2)).all()


@pytest.mark.parametrize("compiled", [False, True])
def test_what_is_not_a_number_spreads_over_its_line_only(compiled: bool) -> None:
    generator = np.random.default_rng(5)
    a, b = numbers(generator, 20, 3, 3), numbers(generator, 20, 3, 3)
    clean = dv.divide(a, b, LIMIT, compiled=compiled).value
    b[7, 1, 0] = np.nan
    value = dv.divide(a, b, LIMIT, compiled=compiled).value
    assert np.isnan(value[7, 1]).all()
    others = np.arange(20) != 7
    assert (value[others] == clean[others]).all()
