"""Which bins the slow sine's friction and a ripple of the motor angle reach, and how strongly.

Friction under a sine at bin p makes harmonics at k p. A ripple sin(n angle) under a slow sine of amplitude z / n is
frequency modulation: harmonics at k p of size 2 |J_k(z)| up to about k = z, that is n times the speed over 2 pi, and
nothing beyond (Jacobi-Anger). The multisine beside it takes power out of these carriers and spreads it to both sides of
each; its expectation over random phases has a closed form, because the characteristic function of a cosine of random
phase is a Bessel function. Carriers do not depend on the multisine's phases and add up over experiments; what is
spread does, and averages as noise does.
"""

from __future__ import annotations

import numpy as np
import scipy

from robid_core.arrays import FloatArray, IntArray


def harmonics_on_lines(line: IntArray, sine_bin: int, n_harmonic: int | None = None) -> IntArray:
    """Lines on harmonics of the sine, the first `n_harmonic` or all; an even sine reaches no odd line."""
    harmonic, rest = np.divmod(line, sine_bin)
    found: IntArray = line[(rest == 0) & (harmonic <= (np.inf if n_harmonic is None else n_harmonic))]
    return found


def ripple_band_hz(order: float, sine_speed: float) -> float:
    """Frequency up to which a ripple goes under a sine of speed: order times the largest speed over 2 pi.

    `order` counts the ripple's periods per turn of the motor; the speed is the motor's, in rad/s.
    """
    return order * sine_speed / (2 * np.pi)


def ripple_level(
    order: float, sine_bin: int, sine_angle: float, line: IntArray, angle: FloatArray, n_sample: int
) -> FloatArray:
    """Expected amplitude of a ripple at every bin, relative to its own amplitude, shape (n_sample // 2 + 1,).

    With independent uniform phases of sine, lines and pose, exp(i n angle(t)) is stationary with the correlation
    ``R(tau) = J_0(2 n a_s sin(w_s tau / 2)) prod_l J_0(2 n a_l sin(w_l tau / 2))``, and its power at a bin is the
    Fourier transform of that, exactly, aliases included. Carriers and what is spread from them are both in it.

    Parameters
    ----------
    order
        Periods per turn of the motor.
    sine_bin, sine_angle
        Of the slow sine, the amplitude as motor angle in rad; 0 where there is none.
    line, angle
        Bins and amplitudes of the multisine as motor angle, rad, shape (n_freq,) each.
    n_sample
        Samples in the period.

    Returns
    -------
    ``sqrt(4 E|c|^2)``, c the DFT coefficient scaled by 1 / n_sample: the amplitude of a cosine at that bin, root mean
    square over phases and pose; at bin 0, twice the root mean square of the mean.
    """
    lag = np.arange(n_sample // 2 + 1)
    correlation = np.ones(len(lag))
    bins = np.append(line, sine_bin)
    for k, amplitude in zip(bins.tolist(), np.append(angle, sine_angle).tolist(), strict=True):
        # Reduced before the sine: k lag / n_sample would lose digits for high bins.
        turn = (k * lag % n_sample) / n_sample
        correlation *= scipy.special.j0(2 * order * amplitude * np.sin(np.pi * turn))
    # Even in the lag: the other half of the period mirrors this one.
    power = np.fft.rfft(np.concatenate([correlation, correlation[1 : n_sample - len(lag) + 1][::-1]])).real
    result: FloatArray = np.sqrt(2 * np.maximum(power, 0.0) / n_sample)
    return result


def lines_reached(line: IntArray, amplitude: FloatArray, level: float) -> IntArray:
    """Lines at which an amplitude, given at all bins, is above a level."""
    found: IntArray = line[amplitude[line] > level]
    return found
