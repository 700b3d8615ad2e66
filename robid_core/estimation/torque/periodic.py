"""Spectra of periodic records: the mean of the periods, and what each differs by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import scipy

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.errors import DataRejected
from robid_core.estimation.torque.spectra import (
    FINER,
    SPEED_BAND,
    MotionSpectra,
    divided_period,
    periodic_derivative,
)
from robid_core.estimation.torque.speed_functions import SpeedFunctions


@dataclass(frozen=True, eq=False)
class PeriodicMotion(MotionSpectra):
    """Spectra of one period, the mean of those measured, with what each period differs by."""

    torque_deviation: ComplexArray
    """Each period's torque spectrum less their mean, shape (n_config, n_exp, n_period, n_bin, n_axis)."""
    acceleration_deviation: ComplexArray
    """Likewise of the accelerations."""
    angle_deviation: FloatArray
    """Each period's angles less their mean, rad, shape (n_config, n_exp, n_period, n_sample, n_axis)."""
    _rates: dict[tuple[int, int, float], FloatArray] = field(default_factory=dict, init=False, repr=False)

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
        samples = scipy.fft.rfft(self.angle, axis=2)
        if acceleration is not None:
            above = omega > np.pi / self.sample_time_s
            between[:, :, above] = scipy.fft.rfft(acceleration, axis=2)[:, :, above] / -(
                omega[above, None] ** 2
            )
            samples -= _sampled(between, n)
        below = np.flatnonzero(omega <= 2 * np.pi * SPEED_BAND / self.sample_time_s)
        between[:, :, below] = FINER * samples[:, :, below]
        between *= 1j * omega[:, None]
        result: FloatArray = scipy.fft.irfft(between, n=FINER * n, axis=2)
        return result

    def speed_of_period(self, period: int) -> FloatArray:
        """Motor speeds of one period as they are measured, at the samples, rad/s, shape of `angle`."""
        angle = self.angle + self.angle_deviation[:, :, period]
        return periodic_derivative(angle, self.sample_time_s, 1, SPEED_BAND / self.sample_time_s)

    def spectrum_of(self, values: FloatArray) -> ComplexArray:
        """Spectra of one period on any even grid, (n_config, n_exp, n_bin, n_axis)."""
        spectrum: ComplexArray = scipy.fft.rfft(values, axis=2)[:, :, self.bin] / values.shape[2]
        return spectrum

    def rate(self, order: int, finer: int = 1, shift_s: float = 0.0) -> FloatArray:
        """Derivative of the motor angles, band-limited, on a grid so many times finer and so much later."""
        key = (order, finer, shift_s)
        if key not in self._rates:
            highest = SPEED_BAND / self.sample_time_s
            self._rates[key] = periodic_derivative(
                self.angle, self.sample_time_s, order, highest, finer, shift_s
            )
            self._rates[key].setflags(write=False)
        return self._rates[key]

    def divided(self, values: FloatArray, gain: Callable[[FloatArray], ComplexArray]) -> FloatArray:
        """Return one period, shape of `angle`, over a gain as a function of omega, (n_omega, n_axis)."""
        return divided_period(values, self.sample_time_s, gain)

    def with_signals(self, angle: FloatArray, torque: FloatArray) -> PeriodicMotion:
        """Return the same with other angles and torques; by how much periods differ is kept."""
        acceleration = -(self.omega[:, None] ** 2) * self.spectrum_of(angle)
        return replace(
            self,
            angle=angle,
            torque=torque,
            torque_spectrum=self.spectrum_of(torque),
            acceleration_spectrum=acceleration,
        )

    @property
    def settling(self) -> int:
        """A whole period."""
        return self.n_sample


def _sampled(fine: ComplexArray, n: int) -> ComplexArray:
    """Spectrum of every FINER-th value, n in all, from that of all of them; frequencies stand on the third axis."""
    both = np.concatenate((fine, fine[:, :, -2:0:-1].conj()), axis=2)
    aliases = both.reshape(*both.shape[:2], FINER, n, both.shape[3])
    folded: ComplexArray = aliases.sum(axis=2)[:, :, : n // 2 + 1] / FINER
    return folded


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
    angles, torques = (scipy.fft.rfft(x, axis=3)[:, :, :, :n_bin] / n_sample for x in (angle, pull))
    accelerations = -(omega[:, None] ** 2) * angles
    return PeriodicMotion(
        sample_time_s,
        n_sample,
        bins,
        np.isin(bins, lines),
        angle.mean(axis=2),
        pull.mean(axis=2),
        torques.mean(axis=2),
        accelerations.mean(axis=2),
        torques - torques.mean(axis=2, keepdims=True),
        accelerations - accelerations.mean(axis=2, keepdims=True),
        angle - angle.mean(axis=2, keepdims=True),
    )


def friction_deviation(motion: PeriodicMotion, laws: SpeedFunctions) -> ComplexArray:
    """Spectra of functions of each period's speed less their mean.

    Shape (n_law, n_config, n_exp, n_period, n_bin, n_axis).
    """
    n_period = motion.torque_deviation.shape[2]
    found = np.zeros((len(laws.names) - 1, *motion.torque_deviation.shape), dtype=np.complex128)
    for period in range(n_period):
        speed = motion.speed_of_period(period)
        for k, torque in enumerate(laws.along(speed.astype(np.float32))):
            found[k, :, :, period] = motion.held_spectrum(torque)
    found -= found.mean(axis=3, keepdims=True)
    return found
