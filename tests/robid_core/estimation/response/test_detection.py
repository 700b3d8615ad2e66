"""Levels of odd and even distortion of plants whose distortion is known in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core.estimation.response import detection as dt

LINE = np.array([5, 9, 11, 17, 21, 25, 31])
LAST = 100  # highest bin of the algebra, above three times the highest line


def two_sided(coefficient: dict[int, complex]) -> Any:
    """Coefficients at bins -LAST to LAST of a real signal."""
    result = np.zeros(2 * LAST + 1, dtype=complex)
    for k, value in coefficient.items():
        result[LAST + k], result[LAST - k] = value, np.conj(value)
    return result


def product(a: Any, b: Any) -> Any:
    """Coefficients of the product of two signals in time: a convolution."""
    return np.convolve(a, b)[LAST:-LAST]


def experiments(square: float, cubic: float, feedback: complex = 0.0) -> Any:
    """Inputs, outputs and quiet bins of y = G u + square x^2 + cubic x^3, x the multisine that drives u.

    With feedback the input answers to the distortion d, ``u = x - F d``, ``y = G u + d``: the residual is d still.
    """
    generator = np.random.default_rng(0)
    quiet = np.setdiff1d(np.arange(LINE.min(), LINE.max() + 1), LINE)
    u, y, distortion = [], [], []
    for _ in range(3):
        x = two_sided({int(k): np.exp(2j * np.pi * generator.random()) for k in LINE})
        d = square * product(x, x) + cubic * product(product(x, x), x)
        at = LAST + np.arange(LAST + 1)
        driven = x[at] - feedback * d[at]
        u.append(driven)
        y.append(plant(np.arange(LAST + 1.0)) * driven + d[at])
        distortion.append(d[at])
    return quiet, np.array(u)[None, None, ..., None], np.array(y)[None, None, ..., None], np.array(distortion)


def plant(k: Any) -> Any:
    """A cubic of the bin: interpolated exactly by a cubic through four lines."""
    return 2 + 0.3j * k - 0.01 * k**2 + 1e-4j * k**3


def levels(quiet: Any, u: Any, y: Any) -> Any:
    response = plant(LINE.astype(float))[None, :, None, None] + 0j
    return dt.distortion_levels(
        u[:, :, :, quiet], y[:, :, :, quiet], quiet, response, np.ones((1, len(LINE)), bool), LINE
    )


@pytest.mark.parametrize("feedback", [0.0, 0.2 - 0.1j])
def test_square_and_cubic_distortion_come_out_at_even_and_odd_bins(feedback: complex) -> None:
    for square, cubic in ((0.3, 0.0), (0.0, 0.05), (0.3, 0.05)):
        quiet, u, y, distortion = experiments(square, cubic, feedback)
        odd, even = levels(quiet, u, y)
        power = np.mean(np.abs(distortion) ** 2, axis=0)
        for parity, found in ((1, odd), (0, even)):
            bins = quiet[quiet % 2 == parity]
            for i, line in enumerate(LINE):
                nearer = np.abs(bins - line) <= np.abs(bins[:, None] - LINE).min(axis=1)
                if nearer.sum() >= 6:
                    expected = np.sqrt(power[bins[nearer]].mean())
                    assert found[0, i, 0] == pytest.approx(expected, rel=1e-9, abs=1e-12)
        assert (odd[0, :, 0].max() > 0.01) == (cubic > 0)
        assert (even[0, :, 0].max() > 0.01) == (square > 0)
        # All of the band's power is in the levels where no bin is pooled twice: the mean is of its size.
        if cubic:
            assert np.mean(odd**2) == pytest.approx(power[quiet[quiet % 2 == 1]].mean(), rel=0.7)


def test_a_linear_plant_has_no_distortion_whatever_stands_at_the_bins() -> None:
    quiet, u, _, _ = experiments(0.3, 0.1)
    leaked = u + 0.5  # noise of the reference at quiet bins, say
    odd, even = levels(quiet, leaked, plant(np.arange(LAST + 1.0))[:, None] * leaked)
    assert odd == pytest.approx(0, abs=1e-12)
    assert even == pytest.approx(0, abs=1e-12)


def test_the_six_nearest_bins_are_pooled_and_all_that_belong_to_a_line() -> None:
    quiet, line = np.array([2, 4, 6, 8, 50, 52, 54, 56, 58, 60, 62, 64]), np.array([3, 57])
    power = np.arange(12.0)[None, :, None] ** 2
    level = dt.level_at_lines(power, quiet, line)[0, :, 0]
    assert level == pytest.approx(
        [np.sqrt(np.mean(np.arange(6.0) ** 2)), np.sqrt(np.mean(np.arange(4.0, 12) ** 2))]
    )


def test_interpolation_is_exact_for_cubics_and_steps_over_masked_lines() -> None:
    at = np.linspace(4.0, 33.0, 20)
    response = plant(LINE.astype(float))[None, :, None, None] + 0j
    valid = np.ones((1, len(LINE)), bool)
    for masked in ([], [3], [1, 4]):
        valid[:] = True
        valid[0, masked] = False
        spoilt = np.where(valid[..., None, None], response, np.nan)
        found = dt.interpolate_response(spoilt, LINE.astype(float), valid, at)
        assert found[0, :, 0, 0] == pytest.approx(plant(at), rel=1e-9)
    valid[:] = False
    valid[0, 2] = True  # one line: it is all there is to know
    found = dt.interpolate_response(response, LINE.astype(float), valid, at)
    assert (found[0, :, 0, 0] == response[0, 2, 0, 0]).all()
    assert np.isnan(dt.interpolate_response(response, LINE.astype(float), valid & False, at)).all()


def test_without_quiet_bins_of_a_parity_no_level_is_stated() -> None:
    response, valid = np.ones((1, 3, 1, 1)) + 0j, np.array([[True, False, True]])
    u = np.zeros((1, 1, 1, 2, 1)) + 0j
    odd, even = dt.distortion_levels(u, u + 2.0, np.array([4, 6]), response, valid, np.array([3, 5, 7]))
    assert odd is None
    assert even[0, :, 0].tolist()[::2] == [2.0, 2.0]  # type: ignore[index]
    assert np.isnan(even[0, 1, 0])  # type: ignore[index]
    none = np.zeros((1, 1, 1, 0, 1)) + 0j
    assert dt.distortion_levels(none, none, np.array([], int), response, valid, np.array([3, 5, 7])) == (
        None,
        None,
    )
