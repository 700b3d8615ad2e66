"""Long-run covariances against closed forms of autoregressive and moving averages, and against scatter."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from robid_core.estimation.serial_correlation import long_run_matrix, n_cosine, sandwich_covariance


def filtered(b: list[float], a: list[float], shape: tuple[int, ...], seed: int) -> np.ndarray:
    """White noise of variance one through a filter along axis 1, stationary."""
    drawn = np.random.default_rng(seed).standard_normal((shape[0], shape[1] + 500, *shape[2:]))
    return np.asarray(scipy.signal.lfilter(b, a, drawn, axis=1))[:, 500:]


def test_white_scores_have_the_covariance_of_their_products() -> None:
    mixing = np.array([[1.0, 0.0], [0.8, 0.5]])
    scores = np.random.default_rng(1).standard_normal((8, 20000, 2)) @ mixing.T
    found = long_run_matrix([scores]) / (8 * 20000)
    # Entries below one from 8 B products scatter by sqrt(2 / (8 B)) at most: four of that.
    np.testing.assert_allclose(found, mixing @ mixing.T, atol=4 * np.sqrt(2 / (8 * n_cosine(20000))))


@pytest.mark.parametrize(
    ("b", "a", "variance"),
    [
        ([1.0], [1.0, -0.5], 4.0),  # 1 / (1 - rho)^2
        ([1.0], [1.0, -0.9], 100.0),
        ([1.0] * 8, [1.0], 64.0),  # the sum of eight
    ],
)
def test_correlated_scores_have_their_long_run_variance(
    b: list[float], a: list[float], variance: float
) -> None:
    scores = filtered(b, a, (16, 20000, 1), 2)
    found = float(long_run_matrix([scores[:5], scores[5:]])[0, 0]) / (16 * 20000)
    # 16 B squares scatter by sqrt(2 / (16 B)) = 1.8 %: four of that. B transforms reach to pi B / n = 0.047 rad, where
    # the spectrum of rho = 0.9 has fallen by (0.047 / 0.1)^2 = 20 %, 6 % in the mean.
    assert found == pytest.approx(variance, rel=0.07 + (0.07 if variance == 100 else 0.0))
    assert float((scores**2).mean()) < 0.4 * found  # what white scores would be told


def test_differences_of_white_noise_leave_next_to_nothing() -> None:
    scores = filtered([1.0, -1.0], [1.0], (4, 4000, 1), 3)
    found = float(long_run_matrix([scores])[0, 0]) / scores.size
    # The spectrum w^2, in the mean over w up to pi B / n, and what the two ends leave of a cosine: 4 / n.
    expected = (np.pi * n_cosine(4000) / 4000) ** 2 / 3 + 4 / 4000
    assert found == pytest.approx(expected, rel=4 * np.sqrt(2 / (4 * n_cosine(4000))))
    assert found < 0.01 * float((scores**2).mean())


def test_a_constant_does_not_count() -> None:
    scores = np.random.default_rng(4).standard_normal((2, 500, 2))
    np.testing.assert_allclose(long_run_matrix([scores + 7.0]), long_run_matrix([scores]), rtol=1e-9)


def test_the_sandwich_covers_a_mean_of_correlated_samples() -> None:
    """The mean of n samples: H = n, and the variance of the estimate is the scatter of such means."""
    samples = filtered([1.0], [1.0, -0.9], (400, 4000, 1), 6)
    stated = [
        float(sandwich_covariance(np.array([[4000.0]]), long_run_matrix([one[None]]))[0, 0])
        for one in samples
    ]
    # A variance from 400 means scatters by sqrt(2 / 400) = 7 %: three of that; of the spectrum up to pi B / n = 0.08
    # rad a sixth is missing.
    assert np.mean(stated) == pytest.approx(float(samples.mean(axis=1).var()), rel=0.21 + 0.17)
