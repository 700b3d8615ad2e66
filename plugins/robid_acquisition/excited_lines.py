"""Which lines of a period were excited: found in the spectra of what drives the robot, or held against them.

A line stands out where its power, averaged over periods, is well above the noise (the scatter from period to period,
smoothed over neighbours). Harmonics that friction makes stand out, too: of these a line is told by its amplitude, the
geometric mean over the axes, which is not far below the largest of its neighbours. Of a single period the noise is not
known; a line must then stand above the median of its neighbours. References have no harmonics.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from robid_core import DataRejected, FloatArray, IntArray

ABOVE_NOISE = 12.0  # power over that of the noise; by chance at exp(-12) of all bins where it is known well
ABOVE_NEIGHBOURS = 30.0  # power over the neighbours' median, of a single period
OF_LARGEST = (
    0.3  # of the largest amplitude among the neighbours: friction's harmonics of a slow sine had up to 0.25
)
OF_ALL = 0.1  # of the lines' rms amplitude
NEIGHBOURS = 8  # bins on either side
SLOW_SINE = 3.0  # amplitude over that of all others: what only carries the motors over friction
SHOWN = 8


def find_lines(signals: FloatArray) -> tuple[IntArray, str]:
    """Return the excited bins, and what was found in words.

    Parameters
    ----------
    signals
        References or torques, (n_experiment, n_period, n_sample, n_axis).

    Raises
    ------
    DataRejected
        If no bin stands out.
    """
    power, stands = _standing(signals)
    moving = power.max(axis=1) > 0
    share = power[moving] / power[moving].sum(axis=1, keepdims=True)
    amplitude = np.exp(0.5 * np.log(np.maximum(share, 1e-30)).mean(axis=0))
    excited = np.array(stands.any(axis=0))
    excited[0] = False
    slow = []
    while excited.sum() > 2:
        *_, second, first = np.flatnonzero(excited)[np.argsort(amplitude[excited])]
        if amplitude[first] <= SLOW_SINE * amplitude[second]:
            break
        slow.append(int(first))
        excited[first] = False
    excited &= amplitude >= OF_LARGEST * _largest(np.where(excited, amplitude, 0.0))
    if not excited.any():
        raise DataRejected("lines: auto: no line stands out from its neighbours; give the lines")
    lines = np.flatnonzero(excited & (amplitude >= OF_ALL * np.sqrt((amplitude[excited] ** 2).mean())))
    left_out = f"; line {', '.join(map(str, sorted(slow)))} is left out as the slow sine" if len(slow) else ""
    found = f"{len(lines)} lines stand out, {lines[0]} to {lines[-1]}"
    if len(lines) == 1:
        found = f"1 line stands out, {lines[0]}"
    return lines.astype(np.int64), f"{found}{left_out}"


def doubts_of_lines(signals: FloatArray, lines: IntArray) -> list[str]:
    """Say which of some claimed lines do not stand out at any axis; raises DataRejected for one that cannot be.

    `signals` as in `find_lines`.
    """
    refuse_beyond_nyquist(lines, signals.shape[2])
    _, stands = _standing(signals)
    silent = [int(line) for line in lines if not stands[:, line].any()]
    if not silent:
        return []
    shown = ", ".join(map(str, silent[:SHOWN])) + (", ..." if len(silent) > SHOWN else "")
    what = "the noise" if signals.shape[1] > 1 else "their neighbours"
    return [f"lines: {len(silent)} of {len(lines)} do not stand out from {what} at any axis: {shown}"]


def refuse_beyond_nyquist(lines: Iterable[int], n_sample: int) -> None:
    """Raise DataRejected for a line that a period of so many samples cannot have."""
    for line in lines:
        if line > n_sample // 2:
            raise DataRejected(
                f"lines: {line} lies above the Nyquist frequency, a period has {n_sample} samples; lines are counted "
                "in periods of it, not in Hz"
            )


def _standing(signals: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Power of each bin and whether it stands out, (n_axis, n_bin) each; axes that do not move have none."""
    n_period, n_sample = signals.shape[1:3]
    spectra = np.fft.rfft(signals - signals.mean(axis=2, keepdims=True), axis=2) / n_sample
    mean = spectra.mean(axis=1)
    power = (np.abs(mean) ** 2).mean(axis=0).T  # (n_axis, n_bin)
    floor = 1e-24 * np.maximum(power.max(axis=1, keepdims=True), 1e-300)
    if n_period > 1:
        scatter = (np.abs(spectra - mean[:, None]) ** 2).sum(axis=1) / (n_period - 1) / n_period
        noise = scatter.mean(axis=0).T
        smoothed = np.stack([np.nanmean(_windows(one), axis=1) for one in noise])
        return power, power > ABOVE_NOISE * smoothed + floor
    median = np.stack([_median(one) for one in power])
    return power, power > ABOVE_NEIGHBOURS * median + floor


def _windows(values: FloatArray) -> FloatArray:
    """Values with their neighbours, (n_bin, 2 NEIGHBOURS + 1), NaN beyond the ends."""
    padded = np.pad(values, NEIGHBOURS, constant_values=np.nan)
    result: FloatArray = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1)
    return result


def _largest(values: FloatArray) -> FloatArray:
    result: FloatArray = np.nanmax(_windows(values), axis=1)
    return result


def _median(values: FloatArray) -> FloatArray:
    windows = _windows(values).copy()
    windows[:, NEIGHBOURS] = np.nan
    result: FloatArray = np.nanmedian(windows, axis=1)
    return result
