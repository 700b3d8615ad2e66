"""Classical excitation signals: sweeps, maximum-length binary sequences, band-limited noise; all of them periodic.

They are made as one waveform of torque, whose spectrum is cut to the band, spread over axes and experiments by phase
factors that keep it real, and turned into a speed reference through the inertia and the speed loop of a motor. After
Pintelon and Schoukens (2012), chapter 5; maximum-length sequences after Godfrey (1993).
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.errors import ConfigurationError


def band_bins(band_hz: tuple[float, float], period_s: float) -> IntArray:
    """All bins of a period in a band, both ends included and bin 0 never; ConfigurationError where there is none."""
    first = max(1, int(np.ceil(band_hz[0] * period_s - 1e-9)))
    bins = np.arange(first, int(np.floor(band_hz[1] * period_s + 1e-9)) + 1, dtype=np.int64)
    if not len(bins):
        raise ConfigurationError(
            f"band_hz: a period of {period_s:g} s has no line between {band_hz[0]:g} and {band_hz[1]:g} Hz"
        )
    return bins


def edge_taper(n_sample: int, rise: int, fall: int) -> FloatArray:
    """Window that rises from zero over `rise` samples, stays at one and falls over the last `fall`, (n_sample,).

    Raised cosines (Tukey's window where both are alike), without a step in the slope.
    """
    window = np.ones(n_sample)
    for length, part in ((rise, slice(None, rise)), (fall, slice(None, -fall - 1, -1))):
        if length:
            window[part] *= 0.5 * (1 - np.cos(np.pi * np.arange(length) / length))
    return window


def sweep(band_hz: tuple[float, float], n_sample: int, sample_time_s: float, law: str) -> FloatArray:
    """Cosine of amplitude one whose frequency goes through the band once, shape (n_sample,).

    "linear": ``f0 + (f1 - f0) t / T``, the same power at every line; "logarithmic": ``f0 (f1 / f0)^(t / T)``, the
    same time and power for each octave.
    """
    low, high = band_hz
    period = n_sample * sample_time_s
    share = np.arange(n_sample) / n_sample
    if law == "linear":
        turns = period * (low * share + 0.5 * (high - low) * share**2)
    elif law == "logarithmic":
        ratio = np.log(high / low)
        turns = period * low / ratio * np.expm1(ratio * share)
    else:
        raise ConfigurationError(f"sweep: {law} is neither linear nor logarithmic")
    result: FloatArray = np.cos(2 * np.pi * turns)
    return result


def maximum_length_sequence(register: int) -> FloatArray:
    """Signs of a maximum-length sequence from a shift register of so many bits, shape (2^register - 1,).

    Its circular autocorrelation is its length at shift zero and -1 at any other, so that every line but the mean
    has the same power.
    """
    from scipy.signal import max_len_seq

    bits, _ = max_len_seq(register)
    result: FloatArray = 1.0 - 2.0 * bits.astype(np.float64)
    return result


def binary_waveform(register: int, hold: int, inverse_repeat: bool) -> FloatArray:
    """One period of a maximum-length sequence, each sign held for `hold` samples.

    With `inverse_repeat` two of them with every other sign turned: the second half is the first one negated, and only
    odd lines have power (Godfrey 1993, section 1.4).
    """
    signs = maximum_length_sequence(register)
    if inverse_repeat:
        signs = np.tile(signs, 2)
        signs[1::2] *= -1
    return np.repeat(signs, hold)


def in_band(signal: FloatArray, bins: IntArray) -> FloatArray:
    """A periodic signal without all lines but `bins`, time on the first axis."""
    spectrum = np.zeros_like(np.fft.rfft(signal, axis=0))
    spectrum[bins] = np.fft.rfft(signal, axis=0)[bins]
    result: FloatArray = np.fft.irfft(spectrum, n=len(signal), axis=0)
    return result


def spread(waveform: FloatArray, bins: IntArray, factors: ComplexArray) -> FloatArray:
    """One waveform as the signals of all experiments and axes, each with complex factors on its lines.

    A factor multiplies the lines of positive frequency, its conjugate those of negative ones: signals stay real, and
    with factors of size one all have the same magnitude of spectrum. A constant factor leaves the envelope as it is.

    Parameters
    ----------
    waveform
        One period, shape (n_sample,).
    bins
        Lines that are kept, shape (n_freq,), below n_sample / 2.
    factors
        Shape (n_exp, n_freq or 1, n_axis).

    Returns
    -------
    Shape (n_exp, n_sample, n_axis).
    """
    n_exp, _, n_axis = factors.shape
    spectrum = np.zeros((n_exp, len(waveform) // 2 + 1, n_axis), dtype=np.complex128)
    spectrum[:, bins] = np.fft.rfft(waveform)[bins][:, None] * factors
    result: FloatArray = np.fft.irfft(spectrum, n=len(waveform), axis=1)
    return result


def shift_factors(shift: IntArray, bins: IntArray, n_sample: int) -> ComplexArray:
    """Factors on lines that delay a periodic signal by whole samples; shift (...), result (..., n_freq)."""
    turn = np.multiply.outer(shift, bins) % n_sample  # below one turn: exact to an ulp
    result: ComplexArray = np.exp(-2j * np.pi * turn / n_sample)
    return result


def hadamard_factors(n_axis: int) -> ComplexArray:
    """Signs of orthogonal experiments, shape (n_exp, n_axis), n_exp the power of two from n_axis on.

    Columns 1.. of Sylvester's matrix where it has one to spare, so that each sums to zero over the experiments.
    """
    from scipy.linalg import hadamard

    order = 1 << (n_axis - 1).bit_length()
    first = 1 if order > n_axis else 0
    result: ComplexArray = hadamard(order)[:, first : first + n_axis].astype(np.complex128)
    return result


def gaussian_lines(
    shape: tuple[int, ...], bins: IntArray, n_sample: int, generator: np.random.Generator
) -> FloatArray:
    """Periodic Gaussian noise of variance one with equal expected power at `bins` and none elsewhere.

    `shape` stands before the samples and the axis: (..., n_axis) gives (..., n_sample, n_axis). Real and imaginary
    part of every line are normal, so that the samples are, exactly.
    """
    leading, n_axis = shape[:-1], shape[-1]
    parts = generator.standard_normal((2, *leading, len(bins), n_axis))
    spectrum = np.zeros((*leading, n_sample // 2 + 1, n_axis), dtype=np.complex128)
    spectrum[..., bins, :] = (parts[0] + 1j * parts[1]) / (2 * np.sqrt(len(bins)))
    result: FloatArray = np.fft.irfft(spectrum * n_sample, n=n_sample, axis=-2)
    return result


def through_lines(signal: FloatArray, factor: ComplexArray) -> FloatArray:
    """A periodic signal (..., n_sample, n_axis) through a response at the bins, (n_sample // 2 + 1, n_axis)."""
    spectrum = np.fft.rfft(signal, axis=-2) * factor
    result: FloatArray = np.fft.irfft(spectrum, n=signal.shape[-2], axis=-2)
    return result


def speed_of_motor_torque(n_sample: int, sample_time_s: float, inertia: FloatArray) -> ComplexArray:
    """Speed over torque of free motors, ``1 / (i w J)``, at all bins; 0 at bin 0 and from half the rate on.

    Takes inertias (n_axis,), returns (n_sample // 2 + 1, n_axis).
    """
    omega = 2 * np.pi * np.fft.rfftfreq(n_sample, sample_time_s)
    with np.errstate(divide="ignore"):
        integral = np.where(omega > 0, 1.0 / np.where(omega > 0, omega, 1.0), 0.0)
    if n_sample % 2 == 0:
        integral[-1] = 0.0
    result: ComplexArray = np.multiply.outer(integral, -1j / inertia)
    return result


def reference_of_motor_speed(n_sample: int, sample_time_s: float, crossover_hz: FloatArray) -> ComplexArray:
    """Speed reference over speed, ``1 + i f / f_c``, of a speed loop of that bandwidth, shape as above.

    A step of torque asks for a ramp of speed, and of the reference too, but for the step of the torque over the
    loop's gain: cut to the band of the excitation, no acceleration is asked for that the motor would not show.
    """
    frequency = np.fft.rfftfreq(n_sample, sample_time_s)
    result: ComplexArray = 1 + np.multiply.outer(frequency, 1j / crossover_hz)
    return result


def powerful_bins(waveform: FloatArray, bins: IntArray, least: float = 0.1) -> IntArray:
    """Bins at which a waveform (n_sample,) has at least a share of its root mean square amplitude over `bins`."""
    size = np.abs(np.fft.rfft(waveform)[bins])
    result: IntArray = bins[size >= least * np.sqrt(np.mean(size**2))]
    return result
