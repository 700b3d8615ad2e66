"""Whether a period and its lines suit a robot: whole samples, and resonances that fall between the lines."""

from __future__ import annotations

import numpy as np

from robid_core import ConfigurationError, FloatArray, IntArray, Robot
from robid_core.estimation.excitation.grids import spacing_hz


def samples_in_period(period_s: float, band_hz: tuple[float, float], robot: Robot) -> int:
    """Samples in a period; ConfigurationError unless they are whole and even, and the band is below half their rate."""
    n_sample = period_s / robot.sample_time_s
    if abs(n_sample - 2 * round(n_sample / 2)) > 1e-6:
        near = 2 * round(n_sample / 2) * robot.sample_time_s
        raise ConfigurationError(
            f"period_s: {period_s:g} s is not an even number of the robot's samples of {robot.sample_time_s:g} s; "
            f"{near:.9g} s is"
        )
    refuse_beyond_half_rate(band_hz, robot)
    return round(n_sample)


def refuse_beyond_half_rate(band_hz: tuple[float, float], robot: Robot) -> None:
    """Raise ConfigurationError where a band does not end below half the robot's sampling rate."""
    if band_hz[1] >= 0.5 / robot.sample_time_s:
        raise ConfigurationError(
            f"band_hz: {band_hz[1]:g} Hz is not below half the sampling rate of {robot.name}, "
            f"{0.5 / robot.sample_time_s:g} Hz"
        )


def missed_resonances(
    robot: Robot, angle: FloatArray, line: IntArray, period_s: float
) -> list[tuple[float, float, float]]:
    """Nominal resonances that the lines may miss, the worst first: narrower than half the distance of lines there.

    A pole s has the half-power width ``-Re(s) / pi`` in Hz. One of at least half the distance has a line within that
    width of its middle, where the response is 45 % of its peak or more. Returns (frequency, width, distance), Hz.
    """
    frequency, spacing = line / period_s, spacing_hz(line, period_s)
    poles = np.concatenate([np.linalg.eigvals(robot.linearize(one).a) for one in angle])
    poles = poles[poles.imag > 0]
    resonance, width = np.abs(poles) / (2 * np.pi), -poles.real / np.pi
    there = spacing[np.argmin(np.abs(frequency[:, None] - resonance), axis=0)]
    missed = (resonance >= frequency[0]) & (resonance <= frequency[-1]) & (there > 2 * width)
    worst_first = np.flatnonzero(missed)[np.argsort((width / there)[missed])]
    return [(float(resonance[i]), float(width[i]), float(there[i])) for i in worst_first]
