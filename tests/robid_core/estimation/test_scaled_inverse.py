"""The inverse of a badly scaled information matrix is symmetric, and right."""

import numpy as np

from robid_core.estimation.scaled_inverse import scaled_inverse


def test_the_inverse_of_unequal_scales_is_that_of_the_closed_form() -> None:
    """D ((1 - r) I + r 1 1^T) D, inverted by Sherman and Morrison; condition n/(1 - r) without D, 1e24 with it."""
    n, r = 12, 1 - 1e-7
    scale = np.logspace(-6, 6, n)
    matrix = ((1 - r) * np.eye(n) + r) * np.outer(scale, scale)
    expected = (np.eye(n) - r / (1 - r + n * r)) / (1 - r) / np.outer(scale, scale)
    found = scaled_inverse(matrix)
    np.testing.assert_array_equal(found, found.T)
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # Rounding of the matrix alone moves the inverse by its condition number times epsilon.
    assert np.abs((found - expected) / size).max() < 20 * n / (1 - r) * np.finfo(float).eps
