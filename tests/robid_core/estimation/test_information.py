"""Information matrices and parameter covariances against dense linear algebra."""

import numpy as np
import pytest

from robid_core import NotIdentifiable
from robid_core.estimation.information import (
    covariance_of_parameters,
    information_of_rank_one,
)


def information_of_jacobian(jacobian: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Information matrix (4.4) from dense derivatives.

    Parameters
    ----------
    jacobian
        d vec(G) / d theta, shape (n_freq, n_entry, n_parameter).
    covariance
        Covariance of vec(G), shape (n_freq, n_entry, n_entry).
    """
    weighted = np.linalg.solve(covariance, jacobian)
    information: np.ndarray = 2 * np.einsum("fep,feq->pq", jacobian.conj(), weighted).real
    return 0.5 * (information + information.T)


def complex_normal(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def definite(rng: np.random.Generator, n_freq: int, n: int) -> np.ndarray:
    a = complex_normal(rng, n_freq, n, n + 2)
    return a @ a.conj().transpose(0, 2, 1)


def test_the_product_of_small_gram_matrices_is_the_dense_sum_with_the_kronecker_covariance() -> None:
    rng = np.random.default_rng(1)
    n_freq, n_parameter, n = 5, 4, 3
    x, f = complex_normal(rng, n_freq, n_parameter, n), complex_normal(rng, n_freq, n_parameter)
    gram, noise = definite(rng, n_freq, n), definite(rng, n_freq, n)
    # vec stacks columns: entry (i, j) at j * n + i, so vec(x x^T) = x (x) x; covariance S^-T (x) C.
    jacobian = np.einsum("fp,fpj,fpi->fjip", f, x, x).reshape(n_freq, n * n, n_parameter)
    dense = np.stack([np.kron(np.linalg.inv(s).T, c) for s, c in zip(gram, noise, strict=True)])
    expected = information_of_jacobian(jacobian, dense)
    got = information_of_rank_one(x, f, gram, np.linalg.inv(noise))
    np.testing.assert_allclose(got, expected, rtol=1e-10)


def test_information_is_the_inverse_scatter_of_the_least_squares_estimate() -> None:
    """One real unknown seen by complex data with variance v: the estimate scatters with 1/H; 4000 draws, 5 sigma."""
    rng = np.random.default_rng(2)
    jacobian, variance = complex_normal(rng, 6, 1, 1), 0.3
    covariance = np.full((6, 1, 1), variance, dtype=complex)
    information = information_of_jacobian(jacobian, covariance)[0, 0]
    noise = complex_normal(rng, 4000, 6) * np.sqrt(variance / 2)
    a = jacobian[:, 0, 0]
    estimate = (noise @ a.conj()).real / (np.abs(a) ** 2).sum()
    assert estimate.var() * information == pytest.approx(1.0, abs=5 * np.sqrt(2 / 4000))


def test_covariance_is_the_inverse_whatever_the_units() -> None:
    rng = np.random.default_rng(3)
    a = rng.standard_normal((5, 9))
    scale = np.array([1e-8, 1e-3, 1.0, 1e4, 1e9])
    information = (a @ a.T) * np.outer(scale, scale)
    covariance = covariance_of_parameters(information, tuple("abcde")) * np.outer(scale, scale)
    np.testing.assert_allclose(covariance, np.linalg.inv(a @ a.T), rtol=1e-9)


def test_what_cannot_be_seen_is_named() -> None:
    with pytest.raises(NotIdentifiable, match="do not see k2"):
        covariance_of_parameters(np.diag([1.0, 0.0, 2.0]), ("k1", "k2", "k3"))
    together = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(NotIdentifiable, match="k1") as caught:
        covariance_of_parameters(together, ("k1", "k2", "k3"))
    assert "k2" in str(caught.value).partition("only together")[0]
