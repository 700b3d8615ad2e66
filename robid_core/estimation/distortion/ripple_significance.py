"""Whether a wave is there, when friction misfits: tests and standard errors from sums over stretches of time.

What friction leaves in the torque is no stationary noise: it sits at the reversals of the motor, where waves of high
order have their torque in the band, too. The variance of a fitted wave therefore comes from the data: residual times
column, summed over stretches of time that are longer than its memory, scatters as the sum over all of them does
(cluster sums: Liang and Zeger 1986). For the test the sums are those of the model without the wave, and Hotelling's
T^2 of two numbers over n stretches has an F distribution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import ComplexArray, FloatArray

STRETCH_S = 0.25  # longer than what a reversal leaves, an eighth of a slow sine's period
FEWEST_STRETCHES = 8  # of an experiment


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a least-squares problem with real unknowns, experiments of all configurations below one another.

    Scaled to unit variance; bins are without gaps, rows that are not used zero.
    """

    columns: ComplexArray
    """Shape (n_exp, n_bin, n_column)."""
    target: ComplexArray
    """Shape (n_exp, n_bin)."""
    period_s: float

    def estimate(self) -> FloatArray:
        """Least-squares estimate, shape (n_column,)."""
        flat = self.columns.reshape(-1, self.columns.shape[-1])
        right = (flat.conj().T @ self.target.ravel()).real
        return np.asarray(np.linalg.lstsq(self.gram(), right)[0], dtype=np.float64)

    def gram(self) -> FloatArray:
        """Products of the columns, shape (n_column, n_column)."""
        flat = self.columns.reshape(-1, self.columns.shape[-1])
        result: FloatArray = (flat.conj().T @ flat).real
        return result

    def without(self, pair: int) -> Rows:
        """Rows of one pair of columns, the other columns projected out of it and of the target."""
        own = np.arange(2 * pair, 2 * pair + 2)
        others = np.delete(np.arange(self.columns.shape[-1]), own)
        if not len(others):
            return self
        beside = self.columns[..., others]
        target = self.target - beside @ Rows(beside, self.target, self.period_s).estimate()
        each = [Rows(beside, self.columns[..., i], self.period_s).estimate() for i in own]
        pair_columns = self.columns[..., own] - beside @ np.stack(each, axis=-1)
        return Rows(pair_columns, target, self.period_s)


def stretch_sums(rows: Rows, residual: ComplexArray) -> FloatArray:
    """Sums of column times residual over stretches of time of each experiment, shape (n_stretch, n_column).

    Their total is that over all bins (Parseval), the gradient of the sum of squares.
    """
    n_exp, n_bin, n_column = rows.columns.shape
    per_experiment = min(max(FEWEST_STRETCHES, round(rows.period_s / STRETCH_S)), n_bin)
    start = np.arange(per_experiment) * n_bin // per_experiment
    products = np.fft.ifft(rows.columns, axis=1).conj() * np.fft.ifft(residual, axis=1)[..., None]
    sums: FloatArray = n_bin * np.add.reduceat(products.real, start, axis=1)
    return sums.reshape(n_exp * per_experiment, n_column)


def chance_of_pair(rows: Rows, pair: int) -> float:
    """Probability that a pair of columns beside the others explains so much by chance."""
    alone = rows.without(pair)
    sums = stretch_sums(alone, alone.target)
    total, scatter, n = sums.sum(axis=0), sums.T @ sums, len(sums)
    if n < 4 or np.linalg.cond(scatter) > 1e12:
        return 1.0
    share = min(float(total @ np.linalg.solve(scatter, total)) / n, 1.0 - 1e-15)
    return float(scipy.stats.f.sf(0.5 * (n - 2) * share / (1.0 - share), 2, n - 2))


def covariance(rows: Rows, estimate: FloatArray) -> FloatArray:
    """Covariance of a least-squares estimate from the stretches, shape (n_column, n_column)."""
    sums = stretch_sums(rows, rows.target - rows.columns @ estimate)
    n, n_column = sums.shape
    inverse = np.linalg.pinv(rows.gram(), hermitian=True)
    result: FloatArray = inverse @ (sums.T @ sums) @ inverse * (n / max(n - n_column, 1))
    return result
