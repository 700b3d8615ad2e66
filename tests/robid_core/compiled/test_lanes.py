"""Values of eight lanes: every operation is what it is on each number alone; views see the arrays they look at."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core.compiled.functions import exponential, natural_logarithm, sine_and_cosine, smooth_sign
from robid_core.compiled.kernel import kernel
from robid_core.compiled.lanes import LANES, like, where
from robid_core.compiled.views import lane_view, row_of, view_of


@kernel
def operations(x, y, out):  # type: ignore[no-untyped-def]
    """Every operation of lanes once, on a pair of values."""
    out[0] = x + y
    out[1] = 2.0 - x
    out[2] = x * y
    out[3] = x / (abs(y) + 1)
    out[4] = -x
    out[5] = where(x < y, x, 3.0)
    out[6] = where((x > 0.0) & (y >= 0.5) | (x == y), 1.0, y)
    out[7] = max(x, y) - min(x, 0.25)
    out[8] = np.sqrt(abs(x)) + np.floor(y) + np.rint(x)
    total = like(x, 1.5)
    total += x
    total *= y
    out[9] = total
    out[10] = where(x != y, smooth_sign(x), exponential(y))
    sine, cosine = sine_and_cosine(x)
    out[11], out[12] = sine, cosine
    out[13] = where(x <= y, 1, 2)


@kernel
def on_rows(x, y, out, single):  # type: ignore[no-untyped-def]
    left, right, result = lane_view(x, single), lane_view(y, single), lane_view(out, single)
    for i in range(left.shape[0]):
        operations(left[i], right[i], row_of(result, i))


@kernel
def fill(matrix):  # type: ignore[no-untyped-def]
    view = view_of(matrix)
    for i in range(view.shape[0]):
        for j in range(view.shape[1]):
            view[i, j] = 10 * i + j


def _both(x: Any, y: Any) -> tuple[Any, Any]:
    together, alone = np.zeros((len(x), 14, LANES)), np.zeros((x.size, 14, 1))
    on_rows(x, y, together, LANES)
    on_rows(x.reshape(-1, 1), y.reshape(-1, 1), alone, None)
    return together, alone.reshape(len(x), LANES, 14).transpose(0, 2, 1)


def test_lanes_compute_what_numbers_compute_to_the_last_bit() -> None:
    x, y = np.random.default_rng(2).normal(size=(2, 50, LANES)) * 3
    y[:5] = x[:5]
    together, alone = _both(x, y)
    np.testing.assert_array_equal(together, alone)


def test_lanes_compute_what_numpy_computes() -> None:
    x, y = np.random.default_rng(3).normal(size=(2, 40, LANES)) * 2
    result, _ = _both(x, y)
    expected = [
        x + y, 2 - x, x * y, x / (abs(y) + 1), -x, np.where(x < y, x, 3), np.where((x > 0) & (y >= 0.5), 1, y),
        np.maximum(x, y) - np.minimum(x, 0.25), np.sqrt(abs(x)) + np.floor(y) + np.rint(x), (1.5 + x) * y, np.tanh(x),
        np.sin(x), np.cos(x), np.where(x <= y, 1, 2),
    ]  # fmt: skip
    for row, value in enumerate(expected):
        np.testing.assert_allclose(result[:, row], value, rtol=1e-15, atol=4e-16)


def test_a_lane_with_no_number_leaves_its_neighbours_alone() -> None:
    x, y = np.random.default_rng(4).normal(size=(2, 1, LANES))
    clean, _ = _both(x, y)
    x[0, 3] = np.nan
    spoiled, _ = _both(x, y)
    others = np.arange(LANES) != 3
    np.testing.assert_array_equal(spoiled[..., others], clean[..., others])
    assert np.isnan(spoiled[0, :3, 3]).all()


def test_a_view_writes_into_the_array_it_looks_at() -> None:
    whole, real = np.zeros((3, 4), dtype=np.int64), np.zeros((3, 4))
    fill(whole)
    fill(real)
    np.testing.assert_array_equal(whole, 10 * np.arange(3)[:, None] + np.arange(4))
    np.testing.assert_array_equal(real, whole)


def test_sine_and_cosine_are_exact_to_the_last_places() -> None:
    rng = np.random.default_rng(0)
    quarters = np.arange(-40, 41) * (np.pi / 2)
    angle = np.concatenate(
        (rng.normal(size=2000) * 10, rng.uniform(-1e5, 1e5, 2000), quarters, quarters + 1e-9)
    )
    for x in angle:
        sine, cosine = sine_and_cosine(x)
        assert sine == pytest.approx(np.sin(x), rel=0, abs=2.3e-16)
        assert cosine == pytest.approx(np.cos(x), rel=0, abs=2.3e-16)


def test_exponential_and_smooth_sign_are_exact_to_the_last_places() -> None:
    for x in np.random.default_rng(1).uniform(-690, 690, 3000):
        assert exponential(x) == pytest.approx(np.exp(x), rel=6e-16)
        assert smooth_sign(x / 50) == pytest.approx(np.tanh(x / 50), rel=0, abs=4e-16)
    assert exponential(1e9) == exponential(700.0)
    assert smooth_sign(1e300) == 1.0
    assert smooth_sign(-1e300) == -1.0


def test_the_logarithm_is_that_of_the_library_and_ends_at_its_bounds() -> None:
    for x in np.exp(np.random.default_rng(0).uniform(-41, 41, 500)):
        assert natural_logarithm(x) == pytest.approx(np.log(x), rel=0, abs=3e-14)
    assert natural_logarithm(0.0) == pytest.approx(np.log(1e-18), rel=0, abs=3e-14)
    assert natural_logarithm(-3.0) == natural_logarithm(0.0)
    assert natural_logarithm(1e30) == pytest.approx(np.log(1e18), rel=0, abs=3e-14)
