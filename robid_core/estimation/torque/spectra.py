"""Spectra of records in all bins, and functions of the measured speed as spectra of a held torque.

Friction, ripple and moving inertia are functions of the measured motion. A function of speed is evaluated on a grid
finer than the samples, where its corners are resolved, and then cut to the band: what a torque of these samples would
have to be (of a held one its spectrum over the hold's factor).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, Self

import numpy as np
import scipy

from robid_core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.weights import running_mean
from robid_core.mechanics import mean_over_smooth
from robid_core.mechanics.response import hold_factor

Hold = Literal["zero_order_hold", "continuous"]

EVERY = 5  # of the bins that are no lines stands for the others
FINER = 8  # points a sample on which laws are evaluated
SMALLEST = 1e-300  # power
HANN = 1.5  # mean square of the window 1 - cos
SPEED_BAND = 0.48  # of the sampling rate: what lies above in a measured angle is noise
MOTION_BAND_HZ = 250.0  # of the motion that is prescribed: second derivatives blow up noise


def held_share(omega: FloatArray, time_s: float) -> ComplexArray:
    """Spectrum of a torque of which each value is held for so long, over that of its values, (n_omega,); 1 at zero."""
    factor, moving = np.ones(len(omega), dtype=np.complex128), omega > 0
    factor[moving] = hold_factor(omega[moving], time_s)[0]
    return factor


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
    torque: FloatArray
    """Motor torques over time, N m, likewise."""
    torque_spectrum: ComplexArray
    """Of the motor torques, N m, shape (n_config, n_exp, n_bin, n_axis)."""
    acceleration_spectrum: ComplexArray
    """Of the motor accelerations, likewise, rad/s^2."""
    angle_noise: FloatArray
    """Variance of `angle` at each sample, white, rad^2, shape (n_axis,)."""
    torque_hold: Hold = field(default="zero_order_hold", kw_only=True)
    """Whether a torque acts from its sample to the next, or the samples are those of a continuous one."""

    def of_configuration(self, config: int) -> Self:
        """Return angles and mean spectra of one configuration; by how much periods differ stays that of all."""
        one = slice(config, config + 1)
        names = ("angle", "torque", "torque_spectrum", "acceleration_spectrum")
        return replace(self, **{name: getattr(self, name)[one] for name in names})

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
        """Spectrum of the torque that acts over that of its samples, 1 for the mean, shape (n_bin,)."""
        return self.hold_at(self.omega)

    def hold_at(self, omega: FloatArray) -> ComplexArray:
        """Likewise at any angular frequencies, rad/s, shape (n_omega,)."""
        held = self.torque_hold == "zero_order_hold"
        return held_share(omega, self.sample_time_s) if held else np.ones(len(omega), dtype=np.complex128)

    def mean_share(self, omega: FloatArray, step_s: float) -> ComplexArray:
        """Spectrum of `Simulation.torque`, means over samples, over that of samples of this torque, (n_omega,)."""
        smooth = mean_over_smooth(omega / (2 * np.pi), self.sample_time_s, step_s)
        share: ComplexArray = smooth * self.hold_at(omega)
        return share

    def spectrum_of_means(self, torque: FloatArray, step_s: float) -> ComplexArray:
        """Spectra of a `Simulation.torque`, (n_config, n_exp, n_time, n_axis), as samples of this torque show it."""
        spectrum: ComplexArray = self.spectrum_of(torque) / self.mean_share(self.omega, step_s)[:, None]
        return spectrum

    def held_spectrum(self, torque: FloatArray) -> ComplexArray:
        """Spectrum of the samples of a torque that acts as one on any even grid does, (n_config, n_exp, n_bin, n_axis).

        Of a held one: of a continuous one it is the same.
        """
        held: ComplexArray = self.spectrum_of(torque) / self.hold[:, None]
        return held

    def fine_speed(self) -> FloatArray:
        """Band-limited motor speeds on the finer grid, rad/s, shape (n_config, n_exp, FINER * n_time, n_axis)."""
        return self.rate(1, FINER)

    def torque_between(self, finer: int, shift_s: float = 0.0) -> FloatArray:
        """Torques on a grid so many times finer, and so much later within a step of it, N m.

        Held from sample to sample, or band-limited; shape (n_config, n_exp, finer * n_time, n_axis).
        """
        if self.torque_hold == "zero_order_hold":
            return np.repeat(self.torque, finer, axis=2)
        return self.between(self.torque, 0, finer, shift_s)

    def fine_torque(self) -> FloatArray:
        """Torques on the finer grid; where held ones jump, the mean of both."""
        fine = self.torque_between(FINER)
        if self.torque_hold == "zero_order_hold":
            fine[:, :, ::FINER] += 0.5 * (np.roll(self.torque, 1, axis=2) - self.torque)
        return fine

    @abstractmethod
    def spectrum_of(self, values: FloatArray) -> ComplexArray:
        """Spectra of values on any even grid, time on the third of four axes, (n_config, n_exp, n_bin, n_axis)."""

    @abstractmethod
    def between(self, values: FloatArray, order: int, finer: int, shift_s: float) -> FloatArray:
        """Derivative of values at the samples, band-limited, on a grid so many times finer and so much later.

        Order 0 gives the values themselves; shape (n_config, n_exp, finer * n_time, n_axis).
        """

    @abstractmethod
    def rate(self, order: int, finer: int = 1, shift_s: float = 0.0) -> FloatArray:
        """Likewise of the motor angles, rad (rad/s, ...)."""

    @abstractmethod
    def divided(self, values: FloatArray, gain: Callable[[FloatArray], ComplexArray]) -> FloatArray:
        """Return values at the samples, shape of `angle`, over a gain as a function of omega, (n_omega, n_axis)."""

    @abstractmethod
    def acceleration_of(self, angle: FloatArray) -> ComplexArray:
        """Spectra of the acceleration that goes with angles, as of the measured ones, (n_config, n_exp, n_bin, ...)."""

    @abstractmethod
    def with_signals(self, angle: FloatArray, torque: FloatArray) -> Self:
        """Return the same with other angles and torques, shape of `angle`."""

    def held_for(self, time_s: float) -> Self:
        """Return the same with the torques that act where a controller holds each for so long, and samples are a part.

        Of a continuous torque that is the mean over so long before; of one that is held from sample to sample itself.
        """
        if self.torque_hold == "zero_order_hold":
            return self

        held = self.divided(self.torque, lambda omega: 1 / held_share(omega, time_s)[:, None])
        return self.with_signals(self.angle, held)

    def advanced_torque(self, delay: FloatArray) -> ComplexArray:
        """Spectra of the torques without a delay, s, (1,) or (n_axis,), shape of `torque_spectrum`."""
        advanced: ComplexArray = np.exp(1j * self.omega[:, None] * delay) * self.torque_spectrum
        return advanced

    def advancing(self, torque: ComplexArray) -> ComplexArray:
        """Derivative, by the time by which they come earlier, of torques like the measured ones, N m/s, their shape."""
        slope: ComplexArray = 1j * self.omega[:, None] * torque
        return slope

    def less(self, residual: ComplexArray, delay: FloatArray) -> Self:
        """Return the same with torques over time without a delay and less a residual; spectra stay.

        The delay, s, has shape (1,) or (n_axis,), the residual (n_config, n_exp, n_bin, n_axis), without the delay.

        What a law is asked about must not hold the noise that its answer is compared with.
        """

        def late(omega: FloatArray) -> ComplexArray:
            turn: ComplexArray = np.exp(-1j * omega[:, None] * delay)
            return turn

        return replace(self, torque=self.divided(self.torque, late) - self.over_time(residual))

    def over_time(self, spectrum: ComplexArray) -> FloatArray:
        """Values of spectra at the samples, shape of `angle`: the inverse of `spectrum_of` in these bins."""
        n_bin = self.n_sample // 2 + 1
        whole = np.zeros((*self.angle.shape[:2], n_bin, spectrum.shape[-1]), dtype=np.complex128)
        whole[:, :, self.bin] = spectrum
        values: FloatArray = scipy.fft.irfft(whole, n=self.n_sample, axis=2) * self.n_sample
        return values

    @property
    @abstractmethod
    def settling(self) -> int:
        """How many samples laws with a memory run before the first one: all where the motion repeats, or none."""

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


def periodic_derivative(
    values: FloatArray,
    sample_time_s: float,
    order: int,
    highest_hz: float,
    finer: int = 1,
    shift_s: float = 0.0,
) -> FloatArray:
    """Derivative of one period, band-limited, on a grid so many times finer and so much later.

    Time is the third of four axes.
    """
    n = values.shape[2]
    spectrum = scipy.fft.rfft(values, axis=2)
    omega = 2 * np.pi * np.arange(spectrum.shape[2]) / (n * sample_time_s)
    spectrum[:, :, omega > 2 * np.pi * highest_hz] = 0.0
    turned = ((1j * omega) ** order * np.exp(1j * omega * shift_s))[:, None] * spectrum
    result: FloatArray = scipy.fft.irfft(turned, n=finer * n, axis=2) * finer
    return result


def speed_without_noise(speed: FloatArray, noise: FloatArray, sample_time_s: float) -> FloatArray:
    """Speed on the finer grid with less of the noise of its samples: Wiener's filter of the angle's spectrum.

    Of a motion that does not repeat, which goes on backwards at its ends for that; bins in which nothing stands above
    the noise are left out. Arguments as of `speed_between_samples`.
    """
    below, _, angle, n = _angle_below(speed, sample_time_s)
    gain = np.zeros((FINER * n // 2 + 1, speed.shape[3]))
    gain[0] = 1.0
    gain[below] = _gain(angle, noise, n)
    there_and_back = np.concatenate((speed, speed[:, :, ::-1]), axis=2)
    twice = np.repeat(gain, 2, axis=0)[: speed.shape[2] + 1]  # the bins lie half as far apart
    spectrum = scipy.fft.rfft(there_and_back, axis=2) * twice
    found: FloatArray = scipy.fft.irfft(spectrum, n=there_and_back.shape[2], axis=2)
    return found[:, :, : speed.shape[2]]


def speed_between_samples(
    speed: FloatArray,
    acceleration: FloatArray,
    noise: FloatArray,
    sample_time_s: float,
    quiet: FloatArray | None = None,
) -> FloatArray:
    """Speed on the finer grid where both are known, a band-limited one through noisy samples and an acceleration.

    Above half the sampling rate the acceleration tells all. What it says there moves the angle at the samples, too, by
    aliasing, and is taken off. Below, samples count as far as the two differ by more than the samples' noise (Wiener's
    filter of their difference); where the acceleration tells less than nothing, `quiet` does.

    Parameters
    ----------
    speed, acceleration
        rad/s and rad/s^2, one period or a cut whose ends do not count, (n_config, n_exp, FINER * n_sample, n_axis).
    noise
        Variance of the angle at each sample, rad^2, (n_axis,).
    quiet
        The speed without the noise of its samples, where that is known.
    """
    below, rate, angle, n = _angle_below(speed, sample_time_s)
    omega = 2 * np.pi * np.arange(FINER * n // 2 + 1)[1:, None] / (n * sample_time_s)
    moved = scipy.fft.rfft(acceleration, axis=2)
    moved[:, :, 0] = 0.0
    moved[:, :, 1:] /= -(omega**2)
    beyond = moved.copy()
    beyond[:, :, 1:][:, :, omega[:, 0] <= np.pi / sample_time_s] = 0.0
    spectrum = scipy.fft.rfft(speed, axis=2)
    angle = angle - FINER * _sampled(beyond, n)[:, :, below]
    told = moved[:, :, below]
    if quiet is not None:
        tells = _level(angle - told, n) < _level(angle, n)
        told = np.where(tells, told, scipy.fft.rfft(quiet, axis=2)[:, :, below] / rate)
    differ = angle - told
    spectrum[:, :, 1:] = 1j * omega * beyond[:, :, 1:]
    spectrum[:, :, below] = rate * (told + _gain(differ, noise, n) * differ)
    result: FloatArray = scipy.fft.irfft(spectrum, n=FINER * n, axis=2)
    return result


def _angle_below(speed: FloatArray, sample_time_s: float) -> tuple[IntArray, ComplexArray, ComplexArray, int]:
    """Bins of a band-limited speed, i omega there, the spectrum of its angle, and how many samples there are."""
    n = speed.shape[2] // FINER
    highest = SPEED_BAND * n
    below = np.arange(1, min(int(np.ceil(highest)), FINER * n // 2 + 1), dtype=np.int64)
    rate: ComplexArray = 2j * np.pi * below[:, None] / (n * sample_time_s)
    return below, rate, scipy.fft.rfft(speed, axis=2)[:, :, below] / rate, n


def _gain(angle: ComplexArray, noise: FloatArray, n: int) -> FloatArray:
    """Wiener's filter of a spectrum with white noise of some variance a sample, (n_bin, n_axis)."""
    gain: FloatArray = np.maximum(0.0, 1.0 - noise / np.maximum(_level(angle, n), SMALLEST) / n)
    return gain


def _level(angle: ComplexArray, n: int) -> FloatArray:
    """Mean power of the bins about each, (n_bin, n_axis)."""
    level: FloatArray = running_mean(_power(angle / (FINER * n)))
    return level


def _power(spectrum: ComplexArray) -> FloatArray:
    """Mean power of each bin, under Hann's window, which ends that do not meet need, (n_bin, n_axis)."""
    seen = spectrum.copy()
    seen[:, :, 1:-1] -= 0.5 * (spectrum[:, :, :-2] + spectrum[:, :, 2:])
    power: FloatArray = (np.abs(seen) ** 2).mean(axis=(0, 1)) / HANN
    return power


def _sampled(fine: ComplexArray, n: int) -> ComplexArray:
    """Spectrum of every FINER-th value, n in all, from that of all of them; frequencies stand on the third axis."""
    both = np.concatenate((fine, fine[:, :, -2:0:-1].conj()), axis=2)
    aliases = both.reshape(*both.shape[:2], FINER, n, both.shape[3])
    folded: ComplexArray = aliases.sum(axis=2)[:, :, : n // 2 + 1] / FINER
    return folded


def divided_period(
    spectrum: ComplexArray, n: int, sample_time_s: float, gain: Callable[[FloatArray], ComplexArray]
) -> FloatArray:
    """One period of n samples over a gain as a function of omega, (n_omega, n_axis), from the spectrum of the period.

    Frequencies stand on the third of four axes, as time does in what is returned.
    """
    omega = 2 * np.pi / (n * sample_time_s) * np.arange(spectrum.shape[2], dtype=np.float64)
    result: FloatArray = scipy.fft.irfft(spectrum / gain(omega), n=n, axis=2)
    return result


def friction_spectra(motion: MotionSpectra, laws: SpeedFunctions, speed: FloatArray) -> ComplexArray:
    """Spectra of functions of the speed and of a constant, shape (n_law + 1, n_config, n_exp, n_bin, n_axis).

    `speed` is on the finer grid. Single precision errs by 1e-7 of a function's level, and takes half the time.
    """
    found = np.empty((len(laws.names), *motion.torque_spectrum.shape), dtype=np.complex128)
    for k, torque in enumerate(laws.along(speed.astype(np.float32))):
        found[k] = motion.held_spectrum(torque)
    found[-1] = motion.constant[:, None]
    return found
