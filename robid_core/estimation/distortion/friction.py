"""What friction adds to the torque beyond its linear part, from the measured speed: a control variate for responses.

Friction turns each speed into a torque; against random phases one part of it looks linear (the equivalent damping, part
of the best linear approximation), the rest is distortion, and averages out slowly over experiments. But the motor's
speed is measured, so the distortion can be computed up to the law. The law is fitted, as a sum of few functions of the
speed, to the torque that is not linear in the motion (`torque_residual`), mostly at lines that were not excited;
then ``f(v) - kappa v`` is what to take off the torque, kappa the linear part as the reference sees it
(`equivalent_gain`). Its expectation at the excited lines is zero, so a law that is fitted poorly removes less scatter
and biases nothing. What kappa misses stays in the response, alike at neighbouring lines and in all experiments, so
that no residual shows it; its deviation is stated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.estimation.distortion.equivalent_gain import (
    equivalent_gain,
    gain_per_line,
    smooth_gain,
    smooth_power,
)
from robid_core.estimation.distortion.linear_motion import LinearMotion
from robid_core.estimation.distortion.torque_residual import motion_basis, torque_residual

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


def speed_functions(speed: FloatArray, rms: float) -> FloatArray:
    """Odd functions ``tanh(v / s)`` of several widths, and ``v tanh(v / s)`` for friction that differs by direction.

    Parameters
    ----------
    speed
        Of one motor, rad/s, any shape.
    rms
        Root mean square of it in the measurement, to which the functions are scaled.

    Returns
    -------
    Shape (n_function, *speed.shape); zero for a motor that does not move.
    """
    functions = np.zeros((len(WIDTHS) + 1, *speed.shape))
    if rms == 0.0:
        return functions
    for function, width in zip(functions, WIDTHS, strict=False):
        np.divide(speed, rms * width, out=function)
        np.tanh(function, out=function)
    np.multiply(speed, functions[1] / rms, out=functions[-1])
    return functions


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
    return SpeedLaw(coefficient, explained, float(scipy.stats.f.sf(ratio, rank, spare)))


@dataclass(frozen=True)
class Distortion:
    """What friction distorts in one configuration.

    `spectrum` (n_exp, n_bin, n_axis), torque in N m; a law per axis; `damping_deviation` (n_freq, n_axis), N m s/rad,
    standard deviation of the equivalent damping that was put back, at the lines.
    """

    spectrum: ComplexArray
    laws: tuple[SpeedLaw, ...]
    damping_deviation: FloatArray


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
    linear: Callable[[FloatArray], LinearMotion] | None = None,
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
    linear
        Gives the motion of a linear model under the same references and under others, whose motors have a damping
        beyond their viscous friction, N m s/rad, (n_axis,): the equivalent one of the laws. It makes kappa more
        precise.
    """
    bins = np.arange(int(line[0]), int(line[-1]) + 1)
    at_lines = np.searchsorted(bins, line)
    omega = 2j * np.pi * np.arange(position.shape[1])[:, None] / (n_sample * sample_time_s)
    speeds = omega * position
    speed = speeds[:, bins]
    motion = omega[bins] * speed
    basis = None
    if inverse_response is None:
        basis = motion_basis(motion, line, bins)
        rest, freedom = torque_residual(torque[:, bins], basis), basis.freedom
    else:
        rest = torque[:, bins] - (inverse_response @ motion[..., None])[..., 0]
        freedom = np.full(len(bins), float(len(torque)))
    measured = oversampled(speeds[:, : 2 * int(line[-1]) + 1], n_sample)
    rms = np.sqrt(np.mean(measured**2, axis=(0, 1)))
    advance = before_hold(bins / n_sample) if hold else np.ones(len(bins), dtype=np.complex128)
    n_axis = rest.shape[-1]
    distorted, laws, direct = np.zeros_like(rest), [], []
    damping = np.zeros(n_axis)
    for i in range(n_axis):
        own, asked = speed[..., i], reference[..., i]
        functions = np.fft.rfft(speed_functions(measured[..., i], rms[i]), axis=-1)[..., bins]
        signal = np.moveaxis(functions * advance, 0, -1) / measured.shape[1]
        if basis is None:
            regressor = np.empty_like(signal)
            for k in range(signal.shape[-1]):
                seen = gain_per_line(signal[:, at_lines, k], own[:, at_lines], asked, line)
                regressor[..., k] = signal[..., k] - equivalent_gain(seen, line).at(bins) * own
        else:
            regressor = torque_residual(signal, basis)
        law = fit_weighted(rest[..., i], regressor, freedom)
        laws.append(law)
        if law.significance < significance:
            distorted[..., i] = signal @ law.coefficient
        direct.append(gain_per_line(distorted[:, at_lines, i], own[:, at_lines], asked, line))
        damping[i] = max(0.0, float(np.mean(equivalent_gain(direct[i], line).at(line).real)))
    found = any(law.significance < significance for law in laws)
    model = linear(damping) if linear is not None and found else None
    deviation = np.zeros((len(line), n_axis))
    for i, law in enumerate(laws):
        if law.significance >= significance:
            continue
        gain = equivalent_gain(direct[i], line)
        if model is not None:
            seen, drawn = (
                gain_per_line(
                    law_at(speeds[..., i], law, rms[i], line, n_sample) * advance[at_lines],
                    speeds[:, line, i],
                    references[..., i],
                    line,
                )
                for speeds, references in ((model.own, reference), (model.drawn, model.drawn_reference))
            )
            gain = equivalent_gain(direct[i], line, seen, smooth_gain(drawn.gain, drawn.weight, line))
        distorted[..., i] -= gain.at(bins) * speed[..., i]
        deviation[:, i] = np.sqrt(gain.variance_at(line))
    return Distortion(distorted, tuple(laws), deviation)


def law_at(
    speed: ComplexArray, law: SpeedLaw, rms: float, line: IntArray, n_sample: int, at_once: int = 4
) -> ComplexArray:
    """Spectra (n_exp, n_freq) of a law at the lines, of speeds (n_exp, n_bin) of one motor; some at a time."""
    parts = []
    for start in range(0, len(speed), at_once):
        samples = oversampled(speed[start : start + at_once, :, None], n_sample)[..., 0]
        torque = np.tensordot(law.coefficient, speed_functions(samples, rms), 1)
        parts.append(np.fft.rfft(torque, axis=1)[:, line] / samples.shape[1])
    return np.concatenate(parts)


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


def oversampled(spectrum: ComplexArray, n_sample: int, factor: int = 2) -> FloatArray:
    """Samples of a periodic signal on a grid `factor` times as fine, from its lowest bins.

    A law with a sharp step is to be evaluated finer than it is used: what it fills beyond half the sampling rate
    would fold back. (Twice as fine is enough: on two plants of the reference bench four and eight times changed
    the error of the response by less than a part in 200, tried by hand.)

    Takes spectra (n_exp, n_bin, n_axis) scaled by 1/n_sample; returns (n_exp, factor * n_sample, n_axis).
    """
    n_bin = min(spectrum.shape[1], n_sample // 2)
    padded = np.zeros((len(spectrum), factor * n_sample // 2 + 1, spectrum.shape[-1]), dtype=np.complex128)
    padded[:, :n_bin] = spectrum[:, :n_bin]
    result: FloatArray = np.fft.irfft(padded * (factor * n_sample), n=factor * n_sample, axis=1)
    return result
