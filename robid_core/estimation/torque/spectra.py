"""Spectra of periodic records in all bins, and functions of the measured speed as spectra of a held torque.

Friction, ripple and moving inertia are functions of the measured motion. A function of speed is evaluated on a grid
finer than the samples, where its corners are resolved, and then cut to the band: what a held torque of these samples
would have to be (its spectrum over the hold's factor).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
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
SpeedFunction = Callable[[FloatArray], FloatArray]

EVERY = 5  # of the bins that are no lines stands for the others
FINER = 8  # points a sample on which laws are evaluated
SPEED_BAND = 0.48  # of the sampling rate: what lies above in a measured angle is noise
MOTION_BAND_HZ = 250.0  # of the motion that is prescribed: second derivatives blow up noise


@dataclass(frozen=True, eq=False)
class MotionSpectra(ABC):
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

    @abstractmethod
    def held_spectrum(self, torque: FloatArray) -> ComplexArray:
        """Spectrum of the held torque that acts as one on any even grid does, (n_config, n_exp, n_bin, n_axis)."""

    @property
    @abstractmethod
    def constant(self) -> ComplexArray:
        """Spectrum of the number one, shape (n_bin,)."""

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
    torque: FloatArray
    """Motor torques, mean of the periods, N m, shape (n_config, n_exp, n_sample, n_axis)."""
    angle_deviation: FloatArray
    """Each period's angles less their mean, rad, shape (n_config, n_exp, n_period, n_sample, n_axis)."""

    @property
    def constant(self) -> ComplexArray:
        """Spectrum of the number one, shape (n_bin,): all of it is in the mean."""
        one = np.zeros(len(self.bin), dtype=np.complex128)
        one[0] = 1.0
        return one

    def fine_speed(self, acceleration: FloatArray | None = None) -> FloatArray:
        """Motor speeds on the finer grid, rad/s, shape (n_config, n_exp, FINER * n_sample, n_axis).

        A held torque jumps between samples, and friction where the speed turns: what that does to the speed is no part
        of the band-limited motion through the samples, but reaches them by aliasing. Where the acceleration of the
        motors is known, its part above half the sampling rate is taken off the samples and put on between them.

        Parameters
        ----------
        acceleration
            Of the motors by what acts on them, rad/s^2, shape of the result; only what lies above half the sampling
            rate counts. None: the band-limited motion.
        """
        n, period_s = self.n_sample, self.n_sample * self.sample_time_s
        omega = 2 * np.pi * np.arange(FINER * n // 2 + 1) / period_s
        between = np.zeros((*self.angle.shape[:2], len(omega), self.angle.shape[3]), dtype=np.complex128)
        samples = self.angle
        if acceleration is not None:
            above = omega > np.pi / self.sample_time_s
            between[:, :, above] = np.fft.rfft(acceleration, axis=2)[:, :, above] / -(omega[above, None] ** 2)
            samples = samples - np.fft.irfft(between, n=FINER * n, axis=2)[:, :, ::FINER]
        below = omega[: n // 2 + 1] <= 2 * np.pi * SPEED_BAND / self.sample_time_s
        between[:, :, : n // 2 + 1][:, :, below] = FINER * np.fft.rfft(samples, axis=2)[:, :, below]
        result: FloatArray = np.fft.irfft(1j * omega[:, None] * between, n=FINER * n, axis=2)
        return result

    def speed_of_period(self, period: int) -> FloatArray:
        """Motor speeds of one period as they are measured, at the samples, rad/s, shape of `angle`."""
        angle = self.angle + self.angle_deviation[:, :, period]
        return periodic_derivative(angle, self.sample_time_s, 1, SPEED_BAND / self.sample_time_s)

    def held_spectrum(self, torque: FloatArray) -> ComplexArray:
        """Spectrum of the held torque that acts as one on any even grid does, (n_config, n_exp, n_bin, n_axis)."""
        spectrum = np.fft.rfft(torque, axis=2)[:, :, self.bin] / torque.shape[2]
        result: ComplexArray = spectrum / self.hold[:, None]
        return result


def periodic_derivative(
    values: FloatArray, sample_time_s: float, order: int, highest_hz: float, finer: int = 1
) -> FloatArray:
    """Derivative of one period, band-limited, on a grid so many times finer; time is the third of four axes."""
    n = values.shape[2]
    spectrum = np.fft.rfft(values, axis=2)
    omega = 2 * np.pi * np.arange(spectrum.shape[2]) / (n * sample_time_s)
    spectrum[:, :, omega > 2 * np.pi * highest_hz] = 0.0
    turned = (1j * omega[:, None]) ** order * spectrum
    result: FloatArray = np.fft.irfft(turned, n=finer * n, axis=2) * finer
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
        pull.mean(axis=2),
        angle - angle.mean(axis=2, keepdims=True),
    )


def speed_functions(widths: tuple[float, ...]) -> list[SpeedFunction]:
    """Free functions of friction: odd ones ``tanh(v / w)``, and an even one, ``tanh^2(v / w)`` of the middle width."""

    def odd(width: float) -> SpeedFunction:
        return lambda v: np.tanh(v / width)

    middle = widths[len(widths) // 2]
    return [*(odd(width) for width in widths), lambda v: np.tanh(v / middle) ** 2]


def friction_spectra(motion: MotionSpectra, laws: Sequence[SpeedFunction], speed: FloatArray) -> ComplexArray:
    """Spectra of functions of the speed and of a constant, shape (n_law + 1, n_config, n_exp, n_bin, n_axis).

    `speed` is on the finer grid.
    """
    constant = np.broadcast_to(motion.constant[:, None], motion.torque_spectrum.shape)
    return np.stack([*(motion.held_spectrum(law(speed)) for law in laws), constant])


def friction_deviation(motion: PeriodicMotion, laws: Sequence[SpeedFunction]) -> ComplexArray:
    """Spectra of functions of each period's speed less their mean.

    Shape (n_law, n_config, n_exp, n_period, n_bin, n_axis).
    """
    n_period = motion.torque_deviation.shape[2]
    found = np.zeros((len(laws), *motion.torque_deviation.shape), dtype=np.complex128)
    for period in range(n_period):
        speed = motion.speed_of_period(period)
        for k, law in enumerate(laws):
            found[k, :, :, period] = motion.held_spectrum(law(speed))
    found -= found.mean(axis=3, keepdims=True)
    return found
