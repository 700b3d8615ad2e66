"""Under which motion a response was measured: speed of the multisine, and of the slow sine beside it.

The response of a robot with friction depends on the motors' speed, so the measurement carries it: the
equivalent gain of friction is ``E[df/dv]`` under a Gaussian speed (the multisine) plus a sine.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import FloatArray, IntArray


def slow_sine_bin(speed_power: FloatArray, first_line: int) -> int:
    """Bin of the slow sine: the strongest bin below the lowest excited line, 0 where none stands out.

    It has to hold half of the power below the band and a tenth of the power in it; without a sine there is
    only distortion below the band, spread over many bins.

    Parameters
    ----------
    speed_power
        Power of the speed at each bin, summed over axes in units that make them comparable, shape (n_bin,).
    first_line
        Lowest excited bin.
    """
    below = speed_power[1:first_line]
    if len(below) == 0:
        return 0
    strongest = int(np.argmax(below))
    stands_out = (
        below[strongest] > 0.5 * below.sum() and below[strongest] > 0.1 * speed_power[first_line:].sum()
    )
    return strongest + 1 if stands_out else 0


def speed_levels(position: FloatArray, line: IntArray, sample_time_s: float) -> tuple[FloatArray, FloatArray]:
    """Root mean square of the speed without the slow sine, and the amplitude of the slow sine.

    From the period average of the position, differentiated in frequency. The band ends at twice the highest
    excited line: above it the derivative holds nothing but the noise of the sensor.

    Parameters
    ----------
    position
        Motor angles in rad, shape (..., n_exp, n_period, n_sample, n_axis): one configuration; all leading
        axes are averaged over.
    line
        Excited bins, shape (n_freq,).
    sample_time_s
        Time between samples.

    Returns
    -------
    (rms, amplitude), each (n_axis,), in rad/s.
    """
    n_sample, n_axis = position.shape[-2:]
    period = position.mean(axis=-3).reshape(-1, n_sample, n_axis)
    last = min(2 * int(line.max()), n_sample // 2)
    omega = 2 * np.pi * np.arange(last + 1) / (n_sample * sample_time_s)
    spectrum = np.fft.rfft(period, axis=1)[:, : last + 1] * (omega[:, None] / n_sample)
    # |X| is half the amplitude of a cosine, and the mean square of a cosine is half its amplitude squared.
    power = 2.0 * np.mean(np.abs(spectrum) ** 2, axis=0)
    total = power.sum(axis=0)
    comparable = np.sum(power / np.where(total > 0, total, 1.0), axis=1)
    sine = slow_sine_bin(comparable, int(line.min()))
    amplitude = np.sqrt(2.0 * power[sine])  # bin 0 has no speed
    power[sine] = 0.0
    rms: FloatArray = np.sqrt(power.sum(axis=0))
    return rms, amplitude
