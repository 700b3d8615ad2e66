"""What friction adds to the torque beyond its linear part, from the measured speed: a control variate for responses.

Friction turns each speed into a torque; against random phases one part of it looks linear (the equivalent damping, part
of the best linear approximation), the rest is distortion, and averages out slowly over experiments. But the motor's
speed is measured, so the distortion can be computed up to the law. The law is fitted, as a sum of few functions of the
speed, to the torque that is not linear in the motion (`torque_residual`), mostly at lines that were not excited;
then ``f(v) - kappa v`` is what to take off the torque, kappa the linear part as the reference sees it. Its expectation
at the excited lines is zero, so a law that is fitted poorly removes less scatter and biases nothing.

Control variates: e.g. Glasserman (2003), section 4.1; equivalent gain of a static nonlinearity: Bussgang (1952).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from robid_core.estimation.distortion.torque_residual import motion_basis, torque_residual

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]

WIDTHS = (0.01, 0.03, 0.1, 0.3, 1.0)
"""Speeds over which the odd functions change sign, in root mean squares of the speed: Coulomb to nearly viscous."""


@dataclass(frozen=True)
class SpeedLaw:
    """Torque of one motor as a function of its speed, without its linear part.

    `coefficient` (n_function,) in N m belongs to the functions of `speed_functions`; `explained` is the share of the
    weighted residual power that it takes away, `significance` the probability of as much from nothing.
    """

    coefficient: FloatArray
    explained: float
    significance: float


def speed_functions(speed: FloatArray) -> FloatArray:
    """Odd functions ``tanh(v / s)`` of several widths, and ``v tanh(v / s)`` for friction that differs by direction.

    Parameters
    ----------
    speed
        Of one motor in all experiments of a configuration, rad/s, any shape.

    Returns
    -------
    Shape (n_function, *speed.shape); zero for a motor that does not move.
    """
    rms = float(np.sqrt(np.mean(speed**2)))
    if rms == 0.0:
        return np.zeros((len(WIDTHS) + 1, *speed.shape))
    scaled = speed / rms
    odd = [np.tanh(scaled / width) for width in WIDTHS]
    return np.stack([*odd, scaled * odd[1]])


def fit_speed_law(
    residual: ComplexArray, regressor: ComplexArray, weight: FloatArray, freedom: float
) -> SpeedLaw:
    """Weighted least squares of a torque residual on the residuals of functions of the speed.

    Parameters
    ----------
    residual
        Of one motor's torque, N m, shape (n_exp, n_bin).
    regressor
        Of the functions, shape (n_exp, n_bin, n_function).
    weight
        Inverse variance of the residual at each bin, zero where it does not count, shape (n_bin,).
    freedom
        Real degrees of freedom of the weighted residual.
    """
    root = np.sqrt(weight)
    target = (residual * root).ravel()
    columns = (regressor * root[:, None]).reshape(-1, regressor.shape[-1])
    left, right = np.concatenate([columns.real, columns.imag]), np.concatenate([target.real, target.imag])
    size = np.linalg.norm(left, axis=0)
    used = size > 0
    coefficient = np.zeros(len(size))
    power = float(right @ right)
    if not used.any() or power == 0.0:
        return SpeedLaw(coefficient, 0.0, 1.0)
    # Neighbouring widths are nearly parallel: what the data do not tell apart is shared between them.
    solved, _, rank, _ = np.linalg.lstsq(left[:, used] / size[used], right, rcond=1e-6)
    coefficient[used] = solved / size[used]
    rest = right - left @ coefficient
    explained = 1.0 - float(rest @ rest) / power
    spare = max(freedom - rank, 1.0)
    ratio = explained / max(1.0 - explained, 1e-300) * spare / rank
    return SpeedLaw(coefficient, explained, float(stats.f.sf(ratio, rank, spare)))


def linear_part(
    signal: ComplexArray,
    speed: ComplexArray,
    reference: ComplexArray,
    line: IntArray,
    bins: IntArray,
    order: int = 2,
) -> ComplexArray:
    """Gain kappa of a signal over the speed, as the reference sees it: smooth over frequency.

    ``sum_e S_e R_e* = kappa sum_e V_e R_e*`` with kappa a complex polynomial in the logarithm of the frequency, each
    line counting alike. Through the reference, not the speed: friction moves the speed too, and both would correlate
    by their distortion. (A static law of a Gaussian speed would have a real and constant kappa; speed in closed loop
    is neither quite Gaussian nor independent of the friction. With a constant the compensated response was off by 3 %,
    with this by less than its scatter: 24 blocks on one plant and pose, tried by hand.)

    Parameters
    ----------
    signal, speed, reference
        Spectra of one axis at the lines, shape (n_exp, n_freq).
    line
        Excited bins, shape (n_freq,).
    bins
        Where kappa is wanted, within the band, shape (n_bin,).
    order
        Of the polynomial; lower where there are few lines.

    Returns
    -------
    kappa, shape (n_bin,).
    """
    over = np.sum(speed * reference.conj(), axis=0)
    gain = np.divide(
        np.sum(signal * reference.conj(), axis=0), over, out=np.zeros_like(over), where=over != 0
    )
    exponent = np.arange(min(order, len(line) // 4) + 1)
    middle = np.sqrt(float(line[0]) * float(line[-1]))
    powers = np.log(line / middle)[:, None] ** exponent
    solved = np.linalg.lstsq(powers.astype(np.complex128), gain, rcond=None)[0]
    result: ComplexArray = np.log(bins / middle)[:, None] ** exponent @ solved
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


@dataclass(frozen=True)
class Distortion:
    """What friction distorts in one configuration: `spectrum` (n_exp, n_bin, n_axis), torque in N m; a law per axis."""

    spectrum: ComplexArray
    laws: tuple[SpeedLaw, ...]


def friction_distortion(
    torque: ComplexArray,
    position: ComplexArray,
    reference: ComplexArray,
    line: IntArray,
    sample_time_s: float,
    n_sample: int,
    inverse_response: ComplexArray | None = None,
    significance: float = 1e-3,
    hold: bool = True,
) -> Distortion:
    """Torque that friction adds to its linear part, at all bins from the lowest to the highest line.

    Parameters
    ----------
    torque, position
        Spectra of all experiments of a configuration, averaged over periods, N m and rad, scaled by 1/n_sample, all
        bins, shape (n_exp, n_sample // 2 + 1, n_axis).
    reference
        Spectra at the lines, shape (n_exp, n_freq, n_axis).
    line
        Excited bins, shape (n_freq,).
    sample_time_s, n_sample
        Of a period.
    inverse_response
        Torque over acceleration at these bins, shape (n_bin, n_axis, n_axis); None: measured, which takes as many
        experiments as axes.
    significance
        A law that as good a fit would come by chance with a larger probability than this is not used.
    hold
        The torque acts from its sample to the next: as a torque that is held, friction has to come half a sample
        earlier, and larger by the hold's 1 / sinc (14 degrees and 1 % at 80 Hz and 1 kHz).
    """
    bins = np.arange(int(line[0]), int(line[-1]) + 1)
    at_lines = np.searchsorted(bins, line)
    omega = 2j * np.pi * bins[:, None] / (n_sample * sample_time_s)
    speed = omega * position[:, bins]
    motion = omega * speed
    basis = None
    if inverse_response is None:
        basis = motion_basis(motion, line, bins)
        rest, freedom = torque_residual(torque[:, bins], basis), basis.freedom
    else:
        rest = torque[:, bins] - (inverse_response @ motion[..., None])[..., 0]
        freedom = np.full(len(bins), float(len(torque)))
    samples = oversampled_speed(position, 2 * int(line[-1]), sample_time_s, n_sample)
    spectrum, laws = np.zeros_like(rest), []
    for i in range(rest.shape[-1]):
        functions = np.fft.rfft(speed_functions(samples[..., i]), axis=-1)[..., bins] / samples.shape[1]
        if hold:
            functions = functions * before_hold(bins / n_sample)
        signal = np.moveaxis(functions, 0, -1)

        def without_linear_part(one: ComplexArray, i: int = i) -> ComplexArray:
            kappa = linear_part(one[:, at_lines], speed[:, at_lines, i], reference[..., i], line, bins)
            result: ComplexArray = one - kappa * speed[..., i]
            return result

        if basis is None:
            regressor = np.stack([without_linear_part(one) for one in np.moveaxis(signal, -1, 0)], axis=-1)
        else:
            regressor = torque_residual(signal, basis)
        law = fit_weighted(rest[..., i], regressor, freedom)
        laws.append(law)
        if law.significance < significance:
            spectrum[..., i] = without_linear_part(signal @ law.coefficient)
    return Distortion(spectrum, tuple(laws))


def before_hold(share: FloatArray) -> ComplexArray:
    """Inverse of a zero-order hold, ``exp(i w T / 2) / sinc``, at shares of the sampling rate."""
    result: ComplexArray = np.exp(1j * np.pi * share) / np.sinc(share)
    return result


def fit_weighted(residual: ComplexArray, regressor: ComplexArray, freedom: FloatArray) -> SpeedLaw:
    """Speed law with weights from the course of what the law itself leaves over, in two passes.

    Takes arrays as `fit_speed_law`, and the degrees of freedom of each bin over the experiments, shape (n_bin,).
    """
    counts = freedom > 0
    law, rest = None, residual
    for _ in range(2):
        power = np.full(len(freedom), np.nan)
        power[counts] = np.sum(np.abs(rest[:, counts]) ** 2, axis=0) / freedom[counts]
        course = smooth_power(power)
        with np.errstate(divide="ignore", invalid="ignore"):
            weight = np.where(counts & (course > 0), 1.0 / course, 0.0)
        law = fit_speed_law(residual, regressor, weight, 2.0 * float(freedom.sum()))
        rest = residual - regressor @ law.coefficient
    assert law is not None
    return law


def oversampled_speed(
    position: ComplexArray, last: int, sample_time_s: float, n_sample: int, factor: int = 2
) -> FloatArray:
    """Speed of a periodic motion on a grid `factor` times as fine, up to bin `last`.

    A law with a sharp step is to be evaluated finer than it is used: what it fills beyond half the sampling rate
    would fold back. (Twice as fine is enough: on two plants of the reference bench four and eight times changed
    the error of the response by less than a part in 200, tried by hand.)

    Takes spectra of the position, (n_exp, n_bin, n_axis); returns rad/s, (n_exp, factor * n_sample, n_axis).
    """
    last = min(last, n_sample // 2 - 1)
    omega = 2j * np.pi * np.arange(last + 1)[:, None] / (n_sample * sample_time_s)
    padded = np.zeros((len(position), factor * n_sample // 2 + 1, position.shape[-1]), dtype=np.complex128)
    padded[:, : last + 1] = omega * position[:, : last + 1]
    result: FloatArray = np.fft.irfft(padded * (factor * n_sample), n=factor * n_sample, axis=1)
    return result
