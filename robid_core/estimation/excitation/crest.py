"""Phases of a block of orthogonal multisines that lower its peaks: the L_p method.

The maximum of a signal is the limit of its L_p norm; minimising the norm for p = 4, 8, 16 ... in turn, each from the
phases of the one before, lowers the peaks of a flat single multisine to a crest factor of about 1.4 (Guillaume,
Schoukens, Pintelon and Kollar 1991), where random phases have 3 to 4: the largest of many Gaussian values. All
experiments of a block are minimised at once, because the orthogonal factors of (4.2) tie their phases together:
n_axis^2 signals share 2 n_axis phases per line, and the gain is less than for one signal alone.

The price: such phases are not random. Distortion no longer averages over blocks as over independent random phases,
and the best linear approximation is that of multisines with few peaks, not that of a Gaussian input.
"""

from __future__ import annotations

import numpy as np
import scipy

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.estimation.excitation.multisine import experiment_factors

EXPONENTS = (4, 8, 16, 32, 64)
ITERATIONS = 60  # of the quasi-Newton method for each exponent
OVERSAMPLING = (
    16  # samples per period of the highest line: a peak between two is missed by 2 % of that line at most
)


def norm_with_slope(signal: FloatArray, exponent: int) -> tuple[float, FloatArray]:
    """Logarithm of the L_p norm of all samples, and its derivative with respect to each."""
    peak = float(np.abs(signal).max())
    relative = signal / peak
    power = relative**2
    partial = relative * power ** (exponent // 2 - 1)
    total = float(np.sum(partial * relative))
    slope: FloatArray = partial / (peak * total)
    return float(np.log(peak) + np.log(total) / exponent), slope


class Block:
    """Signals of a block as functions of its phases, each output scaled to a root mean square of one.

    Parameters
    ----------
    amplitude
        Of each line and axis, shape (n_freq, n_axis).
    line, n_sample
        Bins, shape (n_freq,), and samples of a period.
    n_exp
        Experiments, n_axis or n_axis + 1.
    response
        From the references to the signals whose peaks count, shape (n_freq, n_out, n_axis); None: the references
        themselves.
    """

    def __init__(
        self,
        amplitude: FloatArray,
        line: IntArray,
        n_sample: int,
        n_exp: int,
        response: ComplexArray | None = None,
    ) -> None:
        n_freq, n_axis = amplitude.shape
        self.line, self.shape = line, (n_freq, n_axis, n_exp)
        self.n_grid = min(n_sample, scipy.fft.next_fast_len(OVERSAMPLING * int(line.max()), real=True))
        direct = np.broadcast_to(np.eye(n_axis), (n_freq, n_axis, n_axis)) if response is None else response
        # (n_exp, n_freq, n_out, n_axis): half of each line's amplitude with the orthogonal factors.
        factors = experiment_factors(n_exp, n_axis)[:, None, None, :]
        gain = factors * (0.5 * amplitude)[None, :, None, :] * direct[None]
        # The sum over axes of |gain|^2 is the mean over the phases, and over the experiments exactly (4.3).
        rms = np.sqrt(2.0 * np.mean(np.sum(np.abs(gain) ** 2, axis=(1, 3)), axis=0))
        self.gain = gain / np.where(rms > 0, rms, 1.0)[:, None]

    def signals(self, phase: FloatArray, experiment_phase: FloatArray) -> FloatArray:
        """Signals on the grid, shape (n_exp, n_grid, n_out)."""
        lines = self._outputs(self._terms(phase, experiment_phase))
        spectrum = np.zeros((lines.shape[0], self.n_grid // 2 + 1, lines.shape[2]), dtype=np.complex128)
        spectrum[:, self.line] = lines
        result: FloatArray = np.fft.irfft(spectrum * self.n_grid, n=self.n_grid, axis=1)
        return result

    def norm(
        self, phase: FloatArray, experiment_phase: FloatArray, exponent: int
    ) -> tuple[float, FloatArray, FloatArray]:
        """Logarithm of the L_p norm and its derivatives with respect to both kinds of phases."""
        terms = self._terms(phase, experiment_phase)
        value, slope = norm_with_slope(self.signals(phase, experiment_phase), exponent)
        weight = np.fft.rfft(slope, axis=1)[:, self.line].conj()
        # x = 2 Re sum_k X_k exp(i w_k t), and X_k turns with its phase: d x / d phase = 2 Re (i X_k exp(i w_k t)).
        derivative = -2.0 * np.einsum("ekoc,eko->ekc", terms, weight).imag
        return value, derivative.sum(axis=0), derivative.sum(axis=2).T

    def _terms(self, phase: FloatArray, experiment_phase: FloatArray) -> ComplexArray:
        turn = np.exp(1j * (phase[None] + experiment_phase.T[:, :, None]))
        terms: ComplexArray = self.gain * turn[:, :, None, :]
        return terms

    @staticmethod
    def _outputs(terms: ComplexArray) -> ComplexArray:
        outputs: ComplexArray = terms.sum(axis=3)
        return outputs


def peak_over_rms(signal: FloatArray) -> FloatArray:
    """Crest factor of each output, the largest over the experiments, shape (n_out,).

    `signal` has shape (n_exp, n_sample, n_out); an output that is zero has crest factor 1.
    """
    rms = np.sqrt(np.mean(signal**2, axis=1))
    result: FloatArray = np.where(rms > 0, np.abs(signal).max(axis=1) / np.where(rms > 0, rms, 1.0), 1.0).max(
        axis=0
    )
    return result


def minimise_crest(
    block: Block, phase: FloatArray, experiment_phase: FloatArray, common: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Phases near the given ones with lower peaks: L_p norms in turn, the best in crest factor kept.

    A local minimum: other starting phases lead to other ones, so that blocks that start from random phases
    differ from one another.

    Parameters
    ----------
    block
        The signals whose peaks count.
    phase, experiment_phase
        Where the search begins, rad, shapes (n_freq, n_axis) and (n_freq, n_exp).
    common
        The experiments' own phases stay as they are.

    Returns
    -------
    (phase, experiment_phase), whose largest crest factor is never above that of the start.
    """
    n_freq, n_axis, n_exp = block.shape
    split = n_freq * n_axis

    def apart(unknown: FloatArray) -> tuple[FloatArray, FloatArray]:
        own = experiment_phase if common else unknown[split:].reshape(n_freq, n_exp)
        return unknown[:split].reshape(n_freq, n_axis), own

    def objective(unknown: FloatArray, exponent: int) -> tuple[float, FloatArray]:
        value, by_axis, by_experiment = block.norm(*apart(unknown), exponent)
        return value, by_axis.ravel() if common else np.concatenate([by_axis.ravel(), by_experiment.ravel()])

    unknown = phase.ravel() if common else np.concatenate([phase.ravel(), experiment_phase.ravel()])
    best, best_crest = unknown, peak_over_rms(block.signals(*apart(unknown))).max()
    for exponent in EXPONENTS:
        found = scipy.optimize.minimize(
            objective, unknown, args=(exponent,), jac=True, method="L-BFGS-B", options={"maxiter": ITERATIONS}
        )
        unknown = found.x
        crest = peak_over_rms(block.signals(*apart(unknown))).max()
        if crest < best_crest:
            best, best_crest = unknown, crest
    return apart(best)
