"""Gain of a nonlinear signal over the speed it comes from, as the reference sees it, with a control variate.

A static law of the speed has an equivalent gain (Bussgang 1952), which is part of the best linear approximation; what
is left of it is distortion. The gain that one measurement shows scatters by that distortion. But the law can be
evaluated on any speed, also on that of a linear model under the same references, whose gain is known as precisely
as one likes by drawing further phases: by what the model's gain misses of its mean in this measurement, the
measured one misses it too. (Control variates: Glasserman 2003, section 4.1.) A poor model corrects little and biases
nothing, since its own mean is added back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray, IntArray

ORDER = 2
"""Of the polynomial in the logarithm of the frequency that a gain follows. A static law of a Gaussian speed has a
constant and real one; speed in closed loop is neither quite Gaussian nor independent of what the law does to it."""
COURSE_LINES = 5
"""Lines on either side over which the power of the distortion is averaged for weights."""


@dataclass(frozen=True)
class GainPerLine:
    """Gain of one measurement at each line and its weight, the inverse of its variance up to a factor, (n_freq,)."""

    gain: ComplexArray
    weight: FloatArray


@dataclass(frozen=True)
class EquivalentGain:
    """A gain that is smooth over frequency, a polynomial in ``log(bin / middle)``.

    `coefficient` (n_term,) and their `covariance` (n_term, n_term), complex circular.
    """

    coefficient: ComplexArray
    covariance: FloatArray
    middle: float

    def at(self, bins: npt.NDArray[np.int64]) -> ComplexArray:
        """Gain at bins within the band, shape (n_bin,)."""
        result: ComplexArray = _powers(bins, self.middle, len(self.coefficient)) @ self.coefficient
        return result

    def variance_at(self, bins: npt.NDArray[np.int64]) -> FloatArray:
        """``E |error|^2`` of it, shape (n_bin,)."""
        powers = _powers(bins, self.middle, len(self.coefficient))
        result: FloatArray = np.einsum("bi,ij,bj->b", powers, self.covariance, powers)
        return result


def _powers(bins: npt.NDArray[np.int64], middle: float, n_term: int) -> FloatArray:
    result: FloatArray = np.log(bins / middle)[:, None] ** np.arange(n_term)
    return result


def smooth_power(power: FloatArray, half_width: int = 10) -> FloatArray:
    """Course of a power over the bins: running mean over `half_width` bins on either side, shorter at the ends.

    Bins that are NaN do not count; where a whole window is NaN the result is NaN.
    """
    known = np.isfinite(power)
    total = np.concatenate([[0.0], np.cumsum(np.where(known, power, 0.0))])
    count = np.concatenate([[0], np.cumsum(known)])
    index = np.arange(len(power))
    first, last = np.maximum(index - half_width, 0), np.minimum(index + half_width + 1, len(power))
    number = count[last] - count[first]
    result: FloatArray = np.divide(
        total[last] - total[first], number, out=np.full(len(power), np.nan), where=number > 0
    )
    return result


def gain_per_line(
    signal: ComplexArray, speed: ComplexArray, reference: ComplexArray, line: IntArray
) -> GainPerLine:
    """``sum_e S_e R_e* / sum_e V_e R_e*``: through the reference, not the speed.

    The signal moves the speed too, and both would correlate by their distortion.

    Parameters
    ----------
    signal, speed, reference
        Spectra of one axis at the lines, shape (n_exp, n_freq).
    line
        Excited bins, shape (n_freq,).
    """
    over = np.sum(speed * reference.conj(), axis=0)
    power = np.sum(np.abs(reference) ** 2, axis=0)
    usable = (np.abs(over) > 0) & (power > 0)
    gain = np.divide(np.sum(signal * reference.conj(), axis=0), over, out=np.zeros_like(over), where=usable)
    seen = np.where(usable, np.abs(over) ** 2 / np.where(power > 0, power, 1.0), 0.0)
    rest = signal - smooth_gain(gain, seen, line).at(line) * speed
    course = smooth_power(np.mean(np.abs(rest) ** 2, axis=0), COURSE_LINES)
    return GainPerLine(gain, np.where(course > 0, seen / np.where(course > 0, course, 1.0), seen))


def smooth_gain(gain: ComplexArray, weight: FloatArray, line: IntArray) -> EquivalentGain:
    """Weighted least squares of a polynomial through gains at the lines, all (n_freq,); covariance from its residuals.

    Of lower order where there are fewer than four lines a term.
    """
    n_term = min(ORDER, len(line) // 4) + 1
    middle = float(np.sqrt(float(line[0]) * float(line[-1])))
    powers = _powers(line, middle, n_term)
    inverse = np.linalg.pinv(powers.T * weight @ powers, hermitian=True).astype(np.float64)
    coefficient = inverse @ (powers.T @ (weight * gain))
    rest = gain - powers @ coefficient
    scale = float(np.sum(weight * np.abs(rest) ** 2)) / max(len(line) - n_term, 1)
    return EquivalentGain(coefficient, inverse * scale, middle)


def equivalent_gain(
    measured: GainPerLine,
    line: IntArray,
    model: GainPerLine | None = None,
    mean: EquivalentGain | None = None,
) -> EquivalentGain:
    """Smooth gain of a measurement.

    Parameters
    ----------
    measured
        Of the measurement.
    line
        Excited bins, shape (n_freq,).
    model, mean
        Gain of the same law on a linear model's speed under the same references, and under many others. As much
        of the difference is taken off as the course over the lines confirms.
    """
    direct = smooth_gain(measured.gain, measured.weight, line)
    if model is None or mean is None:
        return direct
    rough = measured.gain - direct.at(line)
    other = model.gain - smooth_gain(model.gain, measured.weight, line).at(line)
    power = float(np.sum(measured.weight * np.abs(other) ** 2))
    together = float(np.sum(measured.weight * (other.conj() * rough).real))
    share = float(np.clip(together / power, 0.0, 1.0)) if power > 0 else 0.0
    gain = measured.gain - share * (model.gain - mean.at(line))
    result = smooth_gain(gain, measured.weight, line)
    return EquivalentGain(result.coefficient, result.covariance + share**2 * mean.covariance, result.middle)
