"""Periodic excitation: orthogonal random-phase multisines, and a slow sine beside them.

Method: thesis section 4.2 (eq. 4.1-4.3); orthogonal multisines after Dobrowiecki and Schoukens (2007). Eq. (4.3)
as printed has `j` both as index and as imaginary unit; here it is ``T[e, c] = exp(2 pi i e c / n)`` with e, c
counted from zero. One experiment more than axes leaves column 0 free: what is the same in all experiments falls
there and nowhere else. Which bins are excited: `grids`; phases searched for a low crest factor: `crest`.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.errors import ConfigurationError
from robid_core.estimation.excitation.grids import (
    logarithmic_odd_lines as logarithmic_odd_lines,
    odd_bins as odd_bins,
    spacing_hz as spacing_hz,
)


def orthogonal_matrix(n_exp: int, n_axis: int | None = None, first: int = 0) -> ComplexArray:
    """Phase factors of an orthogonal set of experiments, ``T[e, c] = exp(2 pi i e (c + first) / n_exp)`` (4.3).

    Returns shape (n_exp, n_axis), n_axis = n_exp by default. With n_exp >= n_axis the columns are orthogonal,
    ``T^H T = n_exp I``. With n_exp = n_axis + 1 and first = 1 the column of ones is left out: each column sums
    to zero over the experiments.
    """
    experiment = np.arange(n_exp)[:, None]
    channel = first + np.arange(n_exp if n_axis is None else n_axis)[None, :]
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


def experiment_factors(n_exp: int, n_axis: int) -> ComplexArray:
    """Columns of T that belong to the axes: 0..n-1 of n experiments, 1..n of n + 1; shape (n_exp, n_axis)."""
    return orthogonal_matrix(n_exp, n_axis, first=1 if n_exp > n_axis else 0)


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

    psi = 0 (common phases) is what n_axis + 1 experiments are for: with columns 1..n_axis of T what does not
    depend on the phases is orthogonal to all inputs and rejected exactly, not on average, at the price above: it is
    the mean over the experiments.

    Parameters
    ----------
    amplitude, phase
        Amplitude, and phase in rad, of each line and axis, shape (n_freq, n_axis).
    experiment_phase
        Phase psi of each line and experiment, rad, shape (n_freq, n_exp), n_exp = n_axis or n_axis + 1.
    line
        Bins, shape (n_freq,), each below n_sample / 2.
    n_sample
        Samples in the period.

    Returns
    -------
    Shape (n_exp, n_sample, n_axis), in the unit of `amplitude`. With the DFT scaled by 1 / n_sample the input
    matrix at a line has ``U U^H = n_exp diag(A_k^2 / 4)``.
    """
    n_axis, n_exp = amplitude.shape[1], experiment_phase.shape[1]
    spectrum = np.zeros((n_exp, n_sample // 2 + 1, n_axis), dtype=np.complex128)
    half = 0.5 * amplitude * np.exp(1j * phase)
    turn = np.exp(1j * experiment_phase.T)
    spectrum[:, line, :] = half * experiment_factors(n_exp, n_axis)[:, None, :] * turn[:, :, None]
    result: FloatArray = np.fft.irfft(spectrum * n_sample, n=n_sample, axis=1)
    return result


def sine(amplitude: FloatArray, phase: FloatArray, sine_bin: int, n_sample: int) -> FloatArray:
    """One period of ``A cos(2 pi bin t / period + phi)`` for each axis, shape (n_sample, n_axis).

    The bin is to be even: the harmonics of an even bin, odd and even alike, fall on even bins, where no odd
    multisine line stands; friction turns an odd bin's third harmonic into an error of the response, unless its
    odd multiples are no lines (`grids.without_multiples`).
    """
    turn = (sine_bin * np.arange(n_sample) % n_sample) / n_sample
    result: FloatArray = amplitude * np.cos(2 * np.pi * turn[:, None] + phase)
    return result


def crest_factor(signal: FloatArray) -> float:
    """Largest ratio of peak to root mean square over experiments and axes of (n_exp, n_sample, n_axis)."""
    rms = np.sqrt(np.mean(signal**2, axis=1))
    return float(np.max(np.abs(signal).max(axis=1) / rms))


def draw_phases(
    n_freq: int, n_axis: int, n_exp: int, common: bool, generator: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Uniform phases of the axes (n_freq, n_axis) and of the experiments (n_freq, n_exp); zeros where common."""
    phase = generator.uniform(0.0, 2 * np.pi, (n_freq, n_axis))
    shape = (n_freq, n_exp)
    return phase, np.zeros(shape) if common else generator.uniform(0.0, 2 * np.pi, shape)


def low_crest_multisine(
    amplitude: FloatArray,
    line: IntArray,
    n_sample: int,
    draws: int,
    generator: np.random.Generator,
    n_exp: int | None = None,
    common: bool = False,
) -> FloatArray:
    """Best of several draws of uniform phases: the set of experiments with the lowest crest factor.

    Each draw is a random-phase multisine, so that the best linear approximation stays what it is; a search
    over the phases themselves (`crest`) lowers the crest factor further and gives that up.

    Parameters
    ----------
    amplitude, line, n_sample
        As in `multisine`.
    draws
        Sets of phases tried.
    generator
        Draws the phases.
    n_exp
        Experiments, n_axis (by default) or n_axis + 1.
    common
        No phases of the experiments' own.

    Returns
    -------
    Shape (n_exp, n_sample, n_axis), as `multisine`.
    """
    n_freq, n_axis = amplitude.shape
    best, best_crest = None, np.inf
    for _ in range(draws):
        phases = draw_phases(n_freq, n_axis, n_axis if n_exp is None else n_exp, common, generator)
        candidate = multisine(amplitude, *phases, line, n_sample)
        crest = crest_factor(candidate)
        if best is None or crest < best_crest:
            best, best_crest = candidate, crest
    if best is None:
        raise ConfigurationError(f"{draws} draws of the phases leave no multisine; ask for at least one")
    return best
