"""n + 1 experiments with common phases: what does not depend on the phases is removed."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.estimation.excitation.multisine import experiment_factors
from robid_core.estimation.response.columns import column_is_free, other_columns


def references(n: int, n_exp: int) -> np.ndarray:
    """Spectra (n_block, n_freq, n, n_exp) of orthogonal multisines with common phases."""
    phase = np.exp(2j * np.pi * np.random.default_rng(n).random((2, 5, n, 1)))
    return phase * experiment_factors(n_exp, n).T


@pytest.mark.parametrize("n", [1, 2, 6])
def test_the_common_part_is_gone_and_the_rest_untouched(n: int) -> None:
    r = references(n, n + 1)
    common = np.random.default_rng(1).standard_normal((2, 5, n, 1)) * np.ones(n + 1)
    turned = other_columns(r + common)
    assert turned.shape == (2, 5, n, n)
    assert turned == pytest.approx(other_columns(r), abs=1e-14)
    # The columns are orthonormal: Gram matrices, and with them covariances, are what they were.
    gram = r @ r.conj().swapaxes(-1, -2)
    assert turned @ turned.conj().swapaxes(-1, -2) == pytest.approx(gram, abs=1e-12)


def test_only_references_that_leave_the_column_free_are_turned() -> None:
    r = references(3, 4)
    assert column_is_free(r)
    assert column_is_free(r.astype(np.complex64).astype(complex))  # a log in single precision
    assert not column_is_free(references(3, 3))
    own = np.exp(2j * np.pi * np.random.default_rng(0).random((2, 5, 1, 4)))
    assert not column_is_free(r * own)  # phases of each experiment
    assert not column_is_free(np.zeros((2, 5, 3, 4)))
