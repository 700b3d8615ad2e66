"""Spectra of periodic records in all bins, and functions of the measured speed as spectra of a held torque.

Friction, ripple and moving inertia are functions of the measured motion. A function of speed is evaluated on a grid
finer than the samples, where its corners are resolved, and then cut to the band: what a held torque of these samples
would have to be (its spectrum over the hold's factor).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from robid_core.errors import DataRejected
from robid_core.mechanics.response import hold_factor

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

EVERY = 5  # of the bins that are no lines stands for the others
FINER = 4  # points a sample on which laws are evaluated
SPEED_BAND = 0.48  # of the sampling rate: what lies above in a measured angle is noise


@dataclass(frozen=True, eq=False)
class MotionSpectra:
    """Angles, torques and accelerations of a record as spectra over bins up to a limit; axes (config, exp, bin, axis).

    Experiments of all blocks stand one behind the other. Spectra are sums over samples, over their number; the first
    bin is the mean.
    """

    sample_time_s: float
    n_sample: int
    """Samples that are transformed; bins are multiples of the inverse of their time."""
    bin: IntArray
    """Numbers of the bins, the first is 0, shape (n_bin,)."""
    excited: BoolArray
    """Whether a bin is an excited line, shape (n_bin,)."""
    angle: FloatArray
    """Motor angles over time, rad, shape (n_config, n_exp, n_time, n_axis)."""
    torque_spectrum: ComplexArray
    """Of the motor torques, N m, shape (n_config, n_exp, n_bin, n_axis)."""
    acceleration_spectrum: ComplexArray
    """Of the motor accelerations, likewise, rad/s^2."""

    @property
    def frequency_hz(self) -> FloatArray:
        """Of the bins, shape (n_bin,)."""
        frequency: FloatArray = self.bin / (self.n_sample * self.sample_time_s)
        return frequency

    @property
    def omega(self) -> FloatArray:
        """Angular frequencies of the bins, rad/s, shape (n_bin,)."""
        return 2 * np.pi * self.frequency_hz

    @property
    def angle_spectrum(self) -> ComplexArray:
        """Accelerations twice integrated, zero at the first bin, rad."""
        spectrum = np.zeros_like(self.acceleration_spectrum)
        spectrum[:, :, 1:] = -self.acceleration_spectrum[:, :, 1:] / (self.omega[1:, None] ** 2)
        return spectrum

    @property
    def hold(self) -> ComplexArray:
        """Factor of a held torque, 1 for the mean, shape (n_bin,)."""
        factor = np.ones(len(self.bin), dtype=np.complex128)
        factor[1:] = hold_factor(self.omega[1:], self.sample_time_s)[0]
        return factor

    def representative(self) -> IntArray:
        """Return the numbers of the mean, the lines, and every fifth other bin."""
        keep = self.excited | (np.arange(len(self.bin)) % EVERY == 0)
        return np.flatnonzero(keep)

    def thinned(self, keep: IntArray) -> Self:
        """Return the same with some of the bins only; `keep` counts among the present ones and begins with 0."""
        chosen: dict[str, Any] = {"bin": self.bin[keep], "excited": self.excited[keep]}
        for entry in fields(self):
            value = getattr(self, entry.name)
            if np.iscomplexobj(value):
                chosen[entry.name] = value[..., keep, :]
        return replace(self, **chosen)


@dataclass(frozen=True, eq=False)
class PeriodicMotion(MotionSpectra):
    """Spectra of one period, the mean of those measured, with what each period differs by."""

    torque_deviation: ComplexArray
    """Each period's torque spectrum less their mean, shape (n_config, n_exp, n_period, n_bin, n_axis)."""
    acceleration_deviation: ComplexArray
    """Likewise of the accelerations."""

    def fine_speed(self) -> FloatArray:
        """Motor speeds on the finer grid, rad/s, shape (n_config, n_exp, FINER * n_sample, n_axis)."""
        spectrum = np.fft.rfft(self.angle, axis=2)
        omega = 2 * np.pi * np.arange(spectrum.shape[2]) / (self.n_sample * self.sample_time_s)
        spectrum[:, :, omega > 2 * np.pi * SPEED_BAND / self.sample_time_s] = 0.0
        fine = FINER * self.n_sample
        width = ((0, 0), (0, 0), (0, fine // 2 + 1 - spectrum.shape[2]), (0, 0))
        speed = np.pad(1j * omega[:, None] * spectrum, width)
        result: FloatArray = np.fft.irfft(speed, n=fine, axis=2) * FINER
        return result

    def held_spectrum(self, fine_torque: FloatArray) -> ComplexArray:
        """Spectrum of the held torque that acts as one on the finer grid does, (n_config, n_exp, n_bin, n_axis)."""
        spectrum = np.fft.rfft(fine_torque, axis=2)[:, :, self.bin] / fine_torque.shape[2]
        result: ComplexArray = spectrum / self.hold[:, None]
        return result


def periodic_motion_of(
    position: FloatArray,
    torque: FloatArray,
    sample_time_s: float,
    lines: npt.NDArray[np.int64],
    highest_hz: float,
) -> PeriodicMotion:
    """Transform whole periods.

    Parameters
    ----------
    position, torque
        Motor angles, rad, and torques, N m, shape (n_config, n_block, n_exp, n_period, n_sample, n_axis).
    lines
        Excited bins.
    highest_hz
        Bins above are left out.

    Raises
    ------
    DataRejected
        Where a sample is not finite, or the limit leaves no bin.
    """
    if not (np.isfinite(position).all() and np.isfinite(torque).all()):
        raise DataRejected("A05: a sample of motor angle or torque is missing or NaN; drop its period")
    n_config, _, _, n_period, n_sample, n_axis = position.shape
    n_bin = int(highest_hz * n_sample * sample_time_s) + 1
    if not 2 <= n_bin <= n_sample // 2:
        raise DataRejected(
            f"a band up to {highest_hz:g} Hz holds {n_bin - 1} bins of a period of {n_sample} samples; measure longer "
            "periods, or choose another band"
        )
    rows = (n_config, -1, n_period, n_sample, n_axis)
    angle, pull = position.reshape(rows), torque.reshape(rows)
    bins = np.arange(n_bin)
    omega = 2 * np.pi * bins / (n_sample * sample_time_s)
    angles, torques = (np.fft.rfft(x, axis=3)[:, :, :, :n_bin] / n_sample for x in (angle, pull))
    accelerations = -(omega[:, None] ** 2) * angles
    return PeriodicMotion(
        sample_time_s,
        n_sample,
        bins,
        np.isin(bins, lines),
        angle.mean(axis=2),
        torques.mean(axis=2),
        accelerations.mean(axis=2),
        torques - torques.mean(axis=2, keepdims=True),
        accelerations - accelerations.mean(axis=2, keepdims=True),
    )


def speed_functions(widths: tuple[float, ...]) -> list[Callable[[FloatArray], FloatArray]]:
    """Free functions of friction: odd ones ``tanh(v / w)``, and an even one, ``tanh^2(v / w)`` of the middle width."""

    def odd(width: float) -> Callable[[FloatArray], FloatArray]:
        return lambda v: np.tanh(v / width)

    middle = widths[len(widths) // 2]
    return [*(odd(width) for width in widths), lambda v: np.tanh(v / middle) ** 2]
