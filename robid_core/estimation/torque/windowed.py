"""Spectra of records that do not repeat: any cut of a motion, under a window, its derivatives by a sine series.

Angle less the line through its ends is continued as an odd function about both ends; its second derivative is that of
a sum of sines. Torque, acceleration and functions of speed get the same window, so that what leaks from one bin to
another leaks alike. The window is Tukey's, tapered by TAPER of the length at either end, of mean square one: white
noise has the variance that it would have without.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
import scipy

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.errors import DataRejected
from robid_core.estimation.torque.spectra import (
    MOTION_BAND_HZ,
    SPEED_BAND,
    Hold,
    MotionSpectra,
    divided_period,
    periodic_derivative,
)
from robid_core.mechanics import MotorMotion, periodic_motion

VISIBLE = 0.5  # of the window: below, a sample says little of what was there
TAPER = 0.06  # of the length, at either end
SLOW = 1e-3  # rad over the whole recording: by so slow a wave a gain tells how late a straight line comes


@dataclass(frozen=True, eq=False)
class _Waves:
    """The odd continuation of values in waves, and the line that was taken off."""

    spectrum: ComplexArray
    first: FloatArray
    slope: FloatArray

    @classmethod
    def of(cls, values: FloatArray, sample_time_s: float) -> _Waves:
        """Of values at the samples."""
        odd, first, slope = odd_continuation(values, sample_time_s)
        return cls(scipy.fft.rfft(odd, axis=2), first, slope)


@dataclass(frozen=True, eq=False)
class WindowedMotion(MotionSpectra):
    """Spectra of whole recordings under a window."""

    rates: dict[tuple[int, int, float], tuple[FloatArray, FloatArray]] = field(
        default_factory=dict, kw_only=True, repr=False
    )
    """Angles and what `rate` made of them, by its arguments: laws on torques ask again and again."""

    def of_configuration(self, config: int) -> WindowedMotion:
        """Likewise; one alone is itself."""
        return self if len(self.angle) == 1 else replace(super().of_configuration(config), rates={})

    @cached_property
    def constant(self) -> ComplexArray:
        """Spectrum of the number one, shape (n_bin,): that of the window."""
        window: ComplexArray = scipy.fft.rfft(_window(self.n_sample))[self.bin] / self.n_sample
        return window

    def spectrum_of(self, values: FloatArray) -> ComplexArray:
        """Spectra of values under the window, on any even grid, time on the third axis.

        Forces on a finer grid compare with a held torque half a sample after its sample: so late comes their window.
        """
        n = values.shape[2]
        late = 0.5 if n > self.n_sample and self.torque_hold == "zero_order_hold" else 0.0
        weighted = values * _window(self.n_sample, n // self.n_sample, late)[:, None]
        spectrum: ComplexArray = scipy.fft.rfft(weighted, axis=2)[:, :, self.bin] / n
        return spectrum

    def spectrum_of_means(self, torque: FloatArray, step_s: float) -> ComplexArray:
        """Likewise; means lie half a sample later than a continuous torque, while the window stays where it is."""
        if self.torque_hold == "zero_order_hold":
            return super().spectrum_of_means(torque, step_s)
        return self.spectrum_of(self.divided(torque, lambda omega: self.mean_share(omega, step_s)[:, None]))

    def over_time(self, spectrum: ComplexArray) -> FloatArray:
        """Values of spectra at the samples, shape of `angle`; nothing where the window shows little."""
        values, window = super().over_time(spectrum), _window(self.n_sample)[:, None]
        shown: FloatArray = np.divide(values, window, out=np.zeros_like(values), where=window > VISIBLE)
        return shown

    def rate(self, order: int, finer: int = 1, shift_s: float = 0.0) -> FloatArray:
        """Likewise of the motor angles; not to be written to."""
        known = self.rates.get((order, finer, shift_s))
        if known is None or known[0] is not self.angle:
            rate = self.between(self.angle, order, finer, shift_s)
            rate.setflags(write=False)
            self.rates[order, finer, shift_s] = known = self.angle, rate
        return known[1]

    def between(self, values: FloatArray, order: int, finer: int, shift_s: float) -> FloatArray:
        """Derivative of values at the samples, band-limited, on a grid so many times finer and so much later."""
        odd, first, slope = odd_continuation(values, self.sample_time_s)
        highest, n = SPEED_BAND / self.sample_time_s, finer * self.n_sample
        rate = periodic_derivative(odd, self.sample_time_s, order, highest, finer, shift_s)[:, :, :n]
        if order == 0:
            time = shift_s + self.sample_time_s / finer * np.arange(n)
            rate += first + slope * time[:, None]
        elif order == 1:
            rate += slope
        return rate

    def divided(self, values: FloatArray, gain: Callable[[FloatArray], ComplexArray]) -> FloatArray:
        """Return values at the samples over a gain as a function of omega, (n_omega, n_axis)."""
        return self._divided(_Waves.of(values, self.sample_time_s), gain)

    def _divided(self, waves: _Waves, gain: Callable[[FloatArray], ComplexArray]) -> FloatArray:
        still, slow = gain(np.array([0.0, SLOW / (self.n_sample * self.sample_time_s)]))[:, None, None]
        early = np.angle(slow / still) / SLOW * (self.n_sample * self.sample_time_s)
        line = waves.first + waves.slope * (self.sample_time_s * np.arange(self.n_sample)[:, None] - early)
        period = divided_period(waves.spectrum, 2 * (self.n_sample - 1), self.sample_time_s, gain)
        result: FloatArray = period[:, :, : self.n_sample] + line / still.real
        return result

    @cached_property
    def _torque_waves(self) -> _Waves:
        """Of the torques: they are asked for with one delay after another."""
        return _Waves.of(self.torque, self.sample_time_s)

    def advanced_torque(self, delay: FloatArray) -> ComplexArray:
        """Likewise; what moves is the torque, not the window."""

        def late(omega: FloatArray) -> ComplexArray:
            turn: ComplexArray = np.exp(-1j * omega[:, None] * delay)
            return turn

        if not np.any(delay):
            return self.torque_spectrum
        return self.spectrum_of(self._divided(self._torque_waves, late))

    def advancing(self, torque: ComplexArray) -> ComplexArray:
        """Likewise, less what a window that moves with them would add."""
        result: ComplexArray = super().advancing(torque) - self.window_slope(self.torque)
        return result

    def window_slope(self, values: FloatArray) -> ComplexArray:
        """Spectra of values at the samples under the window's derivative, (n_config, n_exp, n_bin, n), per second."""
        slope = np.gradient(_window(self.n_sample), self.sample_time_s)
        moved: ComplexArray = scipy.fft.rfft(values * slope[:, None], axis=2)[:, :, self.bin] / self.n_sample
        return moved

    def acceleration_of(self, angle: FloatArray) -> ComplexArray:
        """Likewise, under the window; of motion within the band of motions only."""
        odd, _, _ = odd_continuation(angle, self.sample_time_s)
        return self.spectrum_of(
            periodic_derivative(odd, self.sample_time_s, 2, MOTION_BAND_HZ)[:, :, : self.n_sample]
        )

    def with_signals(self, angle: FloatArray, torque: FloatArray) -> WindowedMotion:
        """Return the same with other angles and torques."""
        return replace(
            self,
            rates=self.rates if angle is self.angle else {},
            angle=angle,
            torque=torque,
            torque_spectrum=self.spectrum_of(torque),
            acceleration_spectrum=self.acceleration_of(angle),
        )

    @property
    def settling(self) -> int:
        """None: what was before the first sample is not known."""
        return 0

    def motor_motion(self, step: float) -> MotorMotion:
        """Motion through these angles in the integrator's steps, one lane an experiment."""
        odd, first, slope = odd_continuation(self.angle, self.sample_time_s)
        n_axis, n_step = odd.shape[3], round(self.n_sample * self.sample_time_s / step)
        there = periodic_motion(
            odd.reshape(-1, odd.shape[2], n_axis), self.sample_time_s, step, MOTION_BAND_HZ
        )
        return MotorMotion(
            there.angle + first.reshape(-1, n_axis),
            there.speed + slope.reshape(-1, n_axis),
            there.acceleration[:, :n_step],
        )


def windowed_motion_of(
    position: FloatArray,
    torque: FloatArray,
    sample_time_s: float,
    highest_hz: float,
    torque_hold: Hold = "zero_order_hold",
) -> WindowedMotion:
    """Transform recordings.

    Parameters
    ----------
    position, torque
        Motor angles, rad, and torques, N m, shape (n_config, n_exp, n_sample, n_axis).
    highest_hz
        Bins above are left out.
    torque_hold
        How torques go between samples.

    Raises
    ------
    DataRejected
        Where a sample is not finite, or the recording is too short for a bin below the limit.
    """
    if not (np.isfinite(position).all() and np.isfinite(torque).all()):
        raise DataRejected(
            "A05: a sample of motor angle or torque is missing or NaN; cut the recording there"
        )
    n_sample = position.shape[2]
    n_bin = int(highest_hz * n_sample * sample_time_s) + 1
    if not 2 <= n_bin <= n_sample // 2:
        raise DataRejected(
            f"a band up to {highest_hz:g} Hz holds {n_bin - 1} bins of a recording of {n_sample} samples; record "
            "longer, or choose another band"
        )
    bins = np.arange(n_bin)
    empty = np.zeros((*position.shape[:2], n_bin, position.shape[3]), dtype=np.complex128)
    silent = np.zeros(position.shape[3])  # a cut does not tell its noise
    bare = WindowedMotion(
        sample_time_s,
        n_sample,
        bins,
        np.zeros(n_bin, dtype=bool),
        position,
        torque,
        empty,
        empty,
        silent,
        torque_hold=torque_hold,
    )
    return bare.with_signals(position, torque)


@lru_cache(maxsize=8)
def _window(n: int, finer: int = 1, late: float = 0.0) -> FloatArray:
    """Tukey's window over n samples, of mean square one, on a grid so many times finer, shape (finer * n,).

    It comes later by a part of a sample. Read only: all records of one length share it.
    """

    def tukey(share: FloatArray) -> FloatArray:
        from_ends = np.clip(np.minimum(share, 1 - share) / TAPER, 0.0, 1.0)
        window: FloatArray = 0.5 * (1 - np.cos(np.pi * from_ends))
        return window

    whole = np.arange(n) / (n - 1)
    there = (np.arange(finer * n) / finer - late) / (n - 1)
    scaled: FloatArray = tukey(there) / np.sqrt((tukey(whole) ** 2).mean())
    scaled.setflags(write=False)
    return scaled


def odd_continuation(angle: FloatArray, sample_time_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """One period of the odd continuation of angles less the line through their ends; first angle and slope of the line.

    Shapes (n_config, n_exp, 2 (n_time - 1), n_axis), (n_config, n_exp, 1, n_axis), likewise.
    """
    n = angle.shape[2]
    first, last = angle[:, :, :1], angle[:, :, -1:]
    share = np.linspace(0.0, 1.0, n)[:, None]
    odd = angle - first - share * (last - first)
    slope = (last - first) / ((n - 1) * sample_time_s)
    return np.concatenate((odd[:, :, :-1], -odd[:, :, :0:-1]), axis=2), first, slope
