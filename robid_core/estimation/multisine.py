"""Periodic excitation: odd logarithmic lines, orthogonal random-phase multisines, a slow sine beside them.

Method: thesis section 4.2 (eq. 4.1-4.3); orthogonal multisines after Dobrowiecki and Schoukens (2007), odd
lines after Schoukens et al. (2005). Eq. (4.3) as printed has `j` both as index and as imaginary unit; here it
is ``T[e, c] = exp(2 pi i e c / n)`` with e, c counted from zero.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robid_core.errors import ConfigurationError

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]


def odd_bins(band_hz: tuple[float, float], period_s: float) -> IntArray:
    """All odd DFT bins of a period whose frequency lies in the band, both ends included."""
    low, high = band_hz
    # 4 Hz * 8 s must count as bin 32 although the product may come out an ulp away.
    first = int(np.ceil(low * period_s - 1e-9))
    last = int(np.floor(high * period_s + 1e-9))
    return np.arange(first | 1, last + 1, 2, dtype=np.int64)


def logarithmic_odd_lines(band_hz: tuple[float, float], count: int, period_s: float) -> IntArray:
    """Exactly `count` distinct odd bins of the band, at a constant ratio wherever bins are dense enough.

    Rounding a plain logarithmic grid to odd bins hits some bins twice at its low end, where the ratio step is
    less than the two bins between odd neighbours; dropping the doubles leaves fewer lines than were asked
    for. Here consecutive odd bins are taken from the low end up to the first bin `b` from which the remaining
    lines, at a constant ratio r up to the top, are at least two bins apart, ``b (r - 1) >= 2``. From there on
    the distance only grows, so that rounding cannot make two lines meet.

    Parameters
    ----------
    band_hz
        Lowest and highest frequency.
    count
        Number of lines.
    period_s
        Length of one period; bin k is k / period_s.

    Returns
    -------
    Bins in increasing order, shape (count,). The lowest and the highest odd bin of the band are among them
    (for count = 1, the bin next to the geometric mean).

    Raises
    ------
    ConfigurationError
        If the band has fewer than `count` odd bins; the message gives the period that would have enough.
    """
    bins = odd_bins(band_hz, period_s)
    if len(bins) < count:
        needed = 2.0 * count / (band_hz[1] - band_hz[0])
        raise ConfigurationError(
            f"{count} lines do not fit: a period of {period_s:g} s has {len(bins)} odd bins from "
            f"{band_hz[0]:g} to {band_hz[1]:g} Hz; ask for at most {len(bins)} lines, or for a period of "
            f"about {needed:.3g} s"
        )
    if len(bins) == count:
        return bins
    first, last = int(bins[0]), int(bins[-1])
    if count == 1:
        middle = int(np.argmin(np.abs(np.log(bins / np.sqrt(first * last)))))
        return bins[middle : middle + 1]
    for consecutive in range(1, count):
        start, steps = first + 2 * (consecutive - 1), count - consecutive
        ratio = (last / start) ** (1.0 / steps)
        if start * (ratio - 1.0) >= 2.0:
            break
    grid = start * ratio ** np.arange(steps + 1)
    # Halves always upward: rounding them to even would let two targets meet.
    upper = np.floor((grid - first) / 2.0 + 0.5).astype(np.int64)
    result: IntArray = bins[np.concatenate([np.arange(consecutive - 1), upper])]
    return result


def spacing_hz(line: IntArray, period_s: float) -> FloatArray:
    """Distance from each line to its farther neighbour in Hz, shape (n_freq,).

    A resonance of frequency f and relative damping zeta has the half-power width ``2 zeta f``; where the
    spacing is wider, its peak can fall between two lines.
    """
    gap = np.diff(line).astype(np.float64) / period_s
    if len(gap) == 0:
        return np.full(len(line), np.inf)
    result: FloatArray = np.maximum(np.append(gap, 0.0), np.insert(gap, 0, 0.0))
    return result


def orthogonal_matrix(n_exp: int, n_axis: int | None = None) -> ComplexArray:
    """Phase factors of an orthogonal set of experiments, ``T[e, c] = exp(2 pi i e c / n_exp)`` (4.3).

    Returns shape (n_exp, n_axis), n_axis = n_exp by default. With n_exp >= n_axis the columns are orthogonal,
    ``T^H T = n_exp I``.
    """
    experiment = np.arange(n_exp)[:, None]
    channel = np.arange(n_exp if n_axis is None else n_axis)[None, :]
    # Reduced before the exponential: the angle stays below one turn and the factors exact to an ulp.
    turn = (experiment * channel) % n_exp
    result: ComplexArray = np.exp(2j * np.pi * turn / n_exp)
    return result


def flat_torque_amplitude(
    frequency_hz: FloatArray, crossover_hz: FloatArray, speed_rms: FloatArray
) -> FloatArray:
    """Amplitudes of a speed reference that asks a drive for the same torque at every line.

    A motor of inertia J under a speed controller of gain K follows a reference r with the speed
    ``v = r / (1 + i f / f_c)``, ``f_c = K / (2 pi J)``, and the torque ``i w J v``. Flat torque is a speed
    ``v ~ 1 / f``, hence ``|r| ~ sqrt(1 + (f / f_c)^2) / f``. A reference that is flat in acceleration would
    leave the lines above the crossover without torque, because the loop does not follow there; one that is
    flat in speed would spend the torque on them.

    Parameters
    ----------
    frequency_hz
        Excited lines, shape (n_freq,).
    crossover_hz
        Bandwidth of each speed loop f_c, shape (n_axis,).
    speed_rms
        Root mean square of the motor's speed that this drive would show, rad/s, shape (n_axis,).

    Returns
    -------
    Amplitude of each cosine of the reference in rad/s, shape (n_freq, n_axis).
    """
    speed = speed_rms / frequency_hz[:, None] / np.sqrt(0.5 * np.sum(frequency_hz**-2.0))
    result: FloatArray = speed * np.hypot(1.0, frequency_hz[:, None] / crossover_hz)
    return result


def multisine(
    amplitude: FloatArray, phase: FloatArray, experiment_phase: FloatArray, line: IntArray, n_sample: int
) -> FloatArray:
    """One period of orthogonal multisines (4.1), whose inputs at a line are ``diag(U_c) T diag(exp(i psi_e))``.

    To (4.2) this adds the phases psi of each experiment. They change nothing in ``U U^H``. Without them the
    experiments of a block differ by a constant phase on each axis only; a nonlinearity of one motor turns
    with it, the same distortion comes back in every experiment, and all of it lands in that motor's column of
    the response: no average, and a scatter that no residual within a block shows. With them every experiment
    is a new random-phase multisine, the distortion averages over experiments as noise does, and so does what
    does not depend on the phases at all (ripple, harmonics of the slow sine).

    Parameters
    ----------
    amplitude, phase
        Amplitude, and phase in rad, of each line and axis, shape (n_freq, n_axis).
    experiment_phase
        Phase psi of each line and experiment, rad, shape (n_freq, n_exp), n_exp = n_axis.
    line
        Bins, shape (n_freq,), each below n_sample / 2.
    n_sample
        Samples in the period.

    Returns
    -------
    Shape (n_exp, n_sample, n_axis), in the unit of `amplitude`. With the DFT scaled by 1 / n_sample the input
    matrix at a line has ``U U^H = n_axis diag(A_k^2 / 4)``.
    """
    n_axis = amplitude.shape[1]
    spectrum = np.zeros((n_axis, n_sample // 2 + 1, n_axis), dtype=np.complex128)
    half = 0.5 * amplitude * np.exp(1j * phase)
    turn = np.exp(1j * experiment_phase.T)
    spectrum[:, line, :] = half * orthogonal_matrix(n_axis)[:, None, :] * turn[:, :, None]
    result: FloatArray = np.fft.irfft(spectrum * n_sample, n=n_sample, axis=1)
    return result


def sine(amplitude: FloatArray, phase: FloatArray, sine_bin: int, n_sample: int) -> FloatArray:
    """One period of ``A cos(2 pi bin t / period + phi)`` for each axis, shape (n_sample, n_axis).

    The bin is to be even: the harmonics of an even bin, odd and even alike, fall on even bins, where no odd
    multisine line stands; friction turns an odd bin's third harmonic into an error of the response.
    """
    turn = (sine_bin * np.arange(n_sample) % n_sample) / n_sample
    result: FloatArray = amplitude * np.cos(2 * np.pi * turn[:, None] + phase)
    return result


def crest_factor(signal: FloatArray) -> float:
    """Largest ratio of peak to root mean square over experiments and axes of (n_exp, n_sample, n_axis)."""
    rms = np.sqrt(np.mean(signal**2, axis=1))
    return float(np.max(np.abs(signal).max(axis=1) / rms))


def low_crest_multisine(
    amplitude: FloatArray, line: IntArray, n_sample: int, draws: int, generator: np.random.Generator
) -> FloatArray:
    """Best of several draws of uniform phases: the set of experiments with the lowest crest factor.

    Each draw is a random-phase multisine, so that the best linear approximation stays what it is; a search
    over the phases themselves would lower the crest factor further and give that up.

    Returns shape (n_axis experiments, n_sample, n_axis), as `multisine`.
    """
    best, best_crest = None, np.inf
    for _ in range(draws):
        phase, experiment_phase = generator.uniform(0.0, 2 * np.pi, (2, *amplitude.shape))
        candidate = multisine(amplitude, phase, experiment_phase, line, n_sample)
        crest = crest_factor(candidate)
        if best is None or crest < best_crest:
            best, best_crest = candidate, crest
    if best is None:
        raise ConfigurationError(f"{draws} draws of the phases leave no multisine; ask for at least one")
    return best
