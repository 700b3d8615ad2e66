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
    SPEED_BAND,
    Hold,
    MotionSpectra,
    divided_period,
    held_share,
    periodic_derivative,
)
from robid_core.estimation.torque.speed_functions import SpeedFunctions

NOISY = 0.25  # of the sampling rate: by how much periods differ above is noise of the angles
ENDS = 100  # of a period's samples: over one such part its beginning is compared with that of the next


@dataclass(frozen=True, eq=False)
class PeriodicMotion(MotionSpectra):
    """Spectra of one period, the mean of those measured, with what each period differs by."""

    torque_deviation: ComplexArray
    """Each period's torque spectrum less their mean, shape (n_config, n_exp, n_period, n_bin, n_axis)."""
    acceleration_deviation: ComplexArray
    """Likewise of the accelerations."""
    angle_deviation: FloatArray
    """Each period's angles less their mean, rad, shape (n_config, n_exp, n_period, n_sample, n_axis)."""
    drift: FloatArray
    """Mean speed of each period, rad/s, shape (n_config, n_exp, n_period, 1, n_axis): what angles are told without."""
    _rates: dict[tuple[int, int, float], FloatArray] = field(default_factory=dict, init=False, repr=False)

    @property
    def constant(self) -> ComplexArray:
        """Spectrum of the number one, shape (n_bin,): all of it is in the mean."""
        one = np.zeros(len(self.bin), dtype=np.complex128)
        one[0] = 1.0
        return one

    def of_configuration(self, config: int) -> PeriodicMotion:
        """Likewise, with the drift of that configuration."""
        return replace(super().of_configuration(config), drift=self.drift[config : config + 1])

    def speed_of_period(self, period: int) -> FloatArray:
        """Motor speeds of one period as they are measured, at the samples, rad/s, shape of `angle`."""
        angle = self.angle + self.angle_deviation[:, :, period]
        speed = periodic_derivative(angle, self.sample_time_s, 1, SPEED_BAND / self.sample_time_s)
        result: FloatArray = speed + self.drift[:, :, period]
        return result

    def spectrum_of(self, values: FloatArray) -> ComplexArray:
        """Spectra of one period on any even grid, (n_config, n_exp, n_bin, n_axis)."""
        spectrum: ComplexArray = scipy.fft.rfft(values, axis=2)[:, :, self.bin] / values.shape[2]
        return spectrum

    def between(self, values: FloatArray, order: int, finer: int, shift_s: float) -> FloatArray:
        """Derivative of one period at the samples, band-limited, on a grid so many times finer and so much later."""
        highest = SPEED_BAND / self.sample_time_s
        return periodic_derivative(values, self.sample_time_s, order, highest, finer, shift_s)

    def rate(self, order: int, finer: int = 1, shift_s: float = 0.0) -> FloatArray:
        """Likewise of the motor angles, which drift."""
        key = (order, finer, shift_s)
        if key not in self._rates:
            rate = self.between(self.angle, order, finer, shift_s)
            self._rates[key] = rate + self.drift.mean(axis=2) if order == 1 else rate
            self._rates[key].setflags(write=False)
        return self._rates[key]

    def divided(self, values: FloatArray, gain: Callable[[FloatArray], ComplexArray]) -> FloatArray:
        """Return one period, shape of `angle`, over a gain as a function of omega, (n_omega, n_axis)."""
        return divided_period(scipy.fft.rfft(values, axis=2), values.shape[2], self.sample_time_s, gain)

    def acceleration_of(self, angle: FloatArray) -> ComplexArray:
        """Likewise, of one period."""
        acceleration: ComplexArray = -(self.omega[:, None] ** 2) * self.spectrum_of(angle)
        return acceleration

    def with_signals(self, angle: FloatArray, torque: FloatArray) -> PeriodicMotion:
        """Return the same with other angles and torques; by how much periods differ is kept."""
        acceleration = self.acceleration_of(angle)
        return replace(
            self,
            angle=angle,
            torque=torque,
            torque_spectrum=self.spectrum_of(torque),
            acceleration_spectrum=acceleration,
        )

    def held_for(self, time_s: float) -> PeriodicMotion:
        """Likewise; what differs between periods is held, too."""
        held = super().held_for(time_s)
        if held is self:
            return self
        deviation = self.torque_deviation * held_share(self.omega, time_s)[:, None]
        return replace(held, torque_deviation=deviation)

    @property
    def settling(self) -> int:
        """A whole period."""
        return self.n_sample


def periodic_motion_of(
    position: FloatArray,
    torque: FloatArray,
    sample_time_s: float,
    lines: npt.NDArray[np.int64],
    highest_hz: float,
    torque_hold: Hold = "zero_order_hold",
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
    torque_hold
        How torques go between samples.

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
    drift = drift_of(angle)
    # The jump between the ends of a period would be read as an acceleration, which the line between them has not.
    angle = angle - drift * ((np.arange(n_sample) + 0.5) / n_sample - 0.5)[:, None]
    bins = np.arange(n_bin)
    omega = 2 * np.pi * bins / (n_sample * sample_time_s)
    angles, torques = (scipy.fft.rfft(x, axis=3) / n_sample for x in (angle, pull))
    differ = angles[:, :, :, int(NOISY * n_sample) :]
    differ = differ - differ.mean(axis=2, keepdims=True)
    power = (np.abs(differ) ** 2).sum(axis=2).mean(axis=(0, 1, 2)) / (n_period * max(n_period - 1, 1))
    angles, torques = angles[:, :, :, :n_bin], torques[:, :, :, :n_bin]
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
        power * n_sample,
        torques - torques.mean(axis=2, keepdims=True),
        accelerations - accelerations.mean(axis=2, keepdims=True),
        angle - angle.mean(axis=2, keepdims=True),
        drift / (n_sample * sample_time_s),
        torque_hold=torque_hold,
    )


def drift_of(angle: FloatArray) -> FloatArray:
    """Return by how much angles change from the beginning of each period to its end, rad, (..., n_period, 1, n_axis).

    Under speed control alone a pose is approached over many periods, or wanders. `angle` has shape (..., n_period,
    n_sample, n_axis); one period alone shows none.
    """
    if angle.shape[-3] == 1:
        return np.zeros((*angle.shape[:-2], 1, angle.shape[-1]))
    few = max(1, angle.shape[-2] // ENDS)
    change = np.diff(angle, axis=-3)
    first = change[..., :1, :few, :].mean(axis=-2, keepdims=True)
    drift: FloatArray = np.concatenate((first, change[..., -few:, :].mean(axis=-2, keepdims=True)), axis=-3)
    return drift


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
