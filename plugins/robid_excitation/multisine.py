"""Orthogonal random-phase multisines on odd logarithmic lines, with a slow sine that keeps the motors moving.

Thesis section 4.2. Each configuration and each block has phases of its own, so that the distortion of a
nonlinear robot averages out and shows in the scatter; within a block the experiments are orthogonal (4.2).
The slow sine holds the motors away from standstill, where friction is not a slope; it sits on an even bin.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from robid_core import (
    ConfigurationError,
    Configurations,
    Context,
    Excitation,
    ExcitationDesign,
    FloatArray,
    IntArray,
    Robot,
)
from robid_core.estimation.multisine import (
    flat_torque_amplitude,
    logarithmic_odd_lines,
    low_crest_multisine,
    sine,
    spacing_hz,
)
from robid_excitation.prediction import Level, clear

CREST = 3.2  # peak over root mean square that the best of ten draws of 100 lines has


def inverse_inertia(robot: Robot, angle: FloatArray, frequency_hz: float) -> FloatArray:
    """Acceleration per torque of each motor below the resonances, median over configurations, shape (n_axis,)."""
    response = robot.response(angle, np.array([frequency_hz]))
    median: FloatArray = np.median(np.abs(np.einsum("cfaa->ca", response)), axis=0)
    return median


def speed_of_torque(peak_torque: FloatArray, inertia: FloatArray, frequency_hz: FloatArray) -> FloatArray:
    """Root mean square of the speed of multisines with a flat torque spectrum and a given peak, shape (n_axis,).

    Each line has the torque amplitude ``peak / (crest sqrt(n_freq / 2))`` and moves the motor with it over
    ``w J``.
    """
    amplitude = peak_torque / (CREST * np.sqrt(0.5 * len(frequency_hz)))
    rms: FloatArray = amplitude / inertia * np.sqrt(0.5 * np.sum((2 * np.pi * frequency_hz) ** -2.0))
    return rms


def torque_peaks(
    robot: Robot, angle: FloatArray, sine_amplitude: FloatArray, share: float, margin: float
) -> FloatArray:
    """Torque that the multisine's peaks may take beside gravity and friction, motor side, shape (n_axis,)."""
    drives = robot.drives
    static = (
        np.abs(robot.gravity_torque(angle)).max(axis=0) + drives.coulomb + drives.viscous * sine_amplitude
    )
    room = 0.85 * (margin * drives.torque_limit - static)
    # Where nothing is left a little is asked for all the same, and the simulation says what is wrong.
    peaks: FloatArray = np.clip(room, 0.02 * drives.torque_limit, share * drives.torque_limit)
    return peaks


def samples_in_period(period_s: float, band_hz: tuple[float, float], robot: Robot) -> int:
    """Samples in a period; ConfigurationError unless they are whole and even, and the band is below half their rate."""
    n_sample = period_s / robot.sample_time_s
    if abs(n_sample - 2 * round(n_sample / 2)) > 1e-6:
        near = 2 * round(n_sample / 2) * robot.sample_time_s
        raise ConfigurationError(
            f"period_s: {period_s:g} s is not an even number of the robot's samples of {robot.sample_time_s:g} s; "
            f"{near:.9g} s is"
        )
    if band_hz[1] >= 0.5 / robot.sample_time_s:
        raise ConfigurationError(
            f"band_hz: {band_hz[1]:g} Hz is not below half the sampling rate of {robot.name}, "
            f"{0.5 / robot.sample_time_s:g} Hz"
        )
    return round(n_sample)


def references(
    amplitude: FloatArray,
    sine_amplitude: FloatArray,
    line: IntArray,
    sine_bin: int,
    shape: tuple[int, int, int],
    draws: int,
    generator: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Multisines and slow sines of all configurations and blocks.

    The sine's phase is new for each block and axis and the same in the experiments of a block.

    Parameters
    ----------
    amplitude
        Of each line and axis, rad/s, shape (n_freq, n_axis).
    sine_amplitude
        Of each axis, rad/s, shape (n_axis,).
    line, sine_bin
        Excited bins, and the bin of the sine (0: none).
    shape
        (n_config, n_block, n_sample).
    draws
        Random phases tried for each block.
    generator
        Draws the phases.

    Returns
    -------
    (multisine, sine) in rad/s, shapes (n_config, n_block, n_exp, n_sample, n_axis) and (n_config, n_block, 1,
    n_sample, n_axis).
    """
    (n_config, n_block, n_sample), n_axis = shape, len(sine_amplitude)
    fast = np.empty((n_config, n_block, n_axis, n_sample, n_axis))
    slow = np.zeros((n_config, n_block, 1, n_sample, n_axis))
    for i in range(n_config):
        for m in range(n_block):
            fast[i, m] = low_crest_multisine(amplitude, line, n_sample, draws, generator)
            phase = generator.uniform(0.0, 2 * np.pi, n_axis)
            if sine_bin:
                slow[i, m, 0] = sine(sine_amplitude, phase, sine_bin, n_sample)
    return fast, slow


def missed_resonances(
    robot: Robot, angle: FloatArray, line: IntArray, period_s: float
) -> list[tuple[float, float, float]]:
    """Nominal resonances narrower than the distance of the lines around them, the worst first.

    A pole s has the half-power width ``-Re(s) / pi`` in Hz. Returns (frequency, width, distance), all in Hz.
    """
    frequency, spacing = line / period_s, spacing_hz(line, period_s)
    poles = np.concatenate([np.linalg.eigvals(robot.linearize(one).a) for one in angle])
    poles = poles[poles.imag > 0]
    resonance, width = np.abs(poles) / (2 * np.pi), -poles.real / np.pi
    there = spacing[np.argmin(np.abs(frequency[:, None] - resonance), axis=0)]
    missed = (resonance >= frequency[0]) & (resonance <= frequency[-1]) & (there > width)
    worst_first = np.flatnonzero(missed)[np.argsort((width / there)[missed])]
    return [(float(resonance[i]), float(width[i]), float(there[i])) for i in worst_first]


class Multisine(ExcitationDesign):
    """Speed references: multisines that ask every line for the same torque, plus a slow sine.

    Nothing moves before the nominal robot was simulated with it: an excitation that would break a limit of
    torque, speed, acceleration or position is refused, with the amplitude that would do.

        excite:
          use: excitation.multisine
          with: {band_hz: [4, 80], lines: 100, period_s: 8, blocks: 2, slow_sine_rad_s: 9}
    """

    band_hz: tuple[PositiveFloat, PositiveFloat]
    """Lowest and highest excited frequency, Hz."""
    lines: PositiveInt
    """Number of excited lines: odd bins of the period on a logarithmic grid, no line twice."""
    period_s: PositiveFloat
    """Length of one period, s; lines are multiples of its inverse."""
    blocks: int = Field(default=2, ge=1, le=1000)
    """Blocks of as many experiments as axes, each with phases of its own; two are needed for a covariance."""
    slow_sine_rad_s: NonNegativeFloat = 0.0
    """Amplitude of the slow sine, motor speed in rad/s; 0: none."""
    slow_sine_hz: PositiveFloat | None = None
    """Frequency of the slow sine, an even bin of the period; by default bin 2."""
    speed_rms_rad_s: PositiveFloat | None = None
    """Root mean square of the motor speed from the multisine; by default what `torque_share` allows."""
    torque_share: float = Field(default=0.5, gt=0, le=1)
    """Share of each motor's torque limit that the multisine's peaks take, where `speed_rms_rad_s` is not set."""
    axis_scale: tuple[PositiveFloat, ...] | None = None
    """Factor on both amplitudes for each axis; by default 1 for all."""
    draws: PositiveInt = 10
    """Random phases tried for each block; the ones with the lowest crest factor are taken."""
    margin: float = Field(default=0.9, gt=0, le=1)
    """Share of the torque, speed and acceleration limits that the prediction may use."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.band_hz[0] >= self.band_hz[1]:
            raise ValueError(f"band_hz: {self.band_hz[0]:g} Hz is not below {self.band_hz[1]:g} Hz")
        try:
            line = self.line()
        except ConfigurationError as error:
            raise ValueError(str(error)) from error
        wanted = 2.0 if self.slow_sine_hz is None else self.slow_sine_hz * self.period_s
        if abs(wanted - 2 * round(wanted / 2)) > 1e-6 or round(wanted) < 2:
            near = 2 * max(1, round(wanted / 2)) / self.period_s
            raise ValueError(
                f"slow_sine_hz: {self.slow_sine_hz:g} Hz is not an even bin of {self.period_s:g} s, and its friction "
                f"harmonics would fall on excited lines; {near:.6g} Hz is"
            )
        if self.slow_sine_rad_s > 0 and self.sine_bin >= line[0]:
            raise ValueError(
                f"the slow sine at {self.sine_bin / self.period_s:g} Hz is not below the lowest line at "
                f"{line[0] / self.period_s:g} Hz; take a longer period or a higher band"
            )
        return self

    def line(self) -> IntArray:
        """Excited bins."""
        return logarithmic_odd_lines(self.band_hz, self.lines, self.period_s)

    @property
    def sine_bin(self) -> int:
        """Bin of the slow sine, 0 where there is none."""
        if self.slow_sine_rad_s == 0:
            return 0
        return 2 if self.slow_sine_hz is None else round(self.slow_sine_hz * self.period_s)

    def plan_lines(self, upstream: Mapping[str, Any]) -> list[str]:
        """Say what will be asked of the robot, for `robid plan`."""
        line = self.line()
        frequency, spacing = line / self.period_s, spacing_hz(line, self.period_s)
        counts = [getattr(stage, "count", None) for stage in upstream.values()]
        where = next((f"{count} configurations x " for count in counts if isinstance(count, int)), "")
        level = f"{self.torque_share:.0%} of the torque limits"
        if self.speed_rms_rad_s is not None:
            level = f"{self.speed_rms_rad_s:g} rad/s rms of motor speed"
        slow = f", slow sine {self.slow_sine_rad_s:g} rad/s at {self.sine_bin / self.period_s:g} Hz"
        return [
            f"{len(line)} odd lines from {frequency[0]:.4g} to {frequency[-1]:.4g} Hz, {spacing.min():.3g} to "
            f"{spacing.max():.3g} Hz apart",
            f"{where}{self.blocks} blocks x one experiment per axis, period {self.period_s:g} s",
            f"multisine at {level}{slow if self.sine_bin else ''}",
        ]

    def run(self, configurations: Configurations, robot: Robot, context: Context) -> Excitation:
        """Make the references of all configurations and clear them by simulation."""
        n_sample = samples_in_period(self.period_s, self.band_hz, robot)
        line, angle = self.line(), configurations.angle
        sine_amplitude = self.slow_sine_rad_s * self._scale(robot)
        amplitude, level = self._amplitude(configurations, robot, sine_amplitude)
        shape = (configurations.n_config, self.blocks, n_sample)
        fast, slow = references(
            amplitude, sine_amplitude, line, self.sine_bin, shape, self.draws, context.generator
        )
        missed = missed_resonances(robot, angle, line, self.period_s)
        if missed:
            context.log.warning(
                "%d resonances of the nominal robot may fall between the lines, the one at %.4g Hz most: it is "
                "%.2g Hz wide, the lines there are %.2g Hz apart; take more lines, or a longer period",
                len(missed),
                *missed[0],
            )
        cleared = clear(fast, slow, angle, robot, line, self.margin, level)
        return Excitation(
            axis_names=robot.axis_names,
            sample_time_s=robot.sample_time_s,
            slow_sine_bin=self.sine_bin,
            line=line,
            reference=fast + slow,
            slow_sine_speed=sine_amplitude,
            predicted_torque=cleared.torque,
            predicted_speed=cleared.speed,
            predicted_travel=cleared.travel,
        )

    def _amplitude(
        self, configurations: Configurations, robot: Robot, sine_amplitude: FloatArray
    ) -> tuple[FloatArray, Level]:
        """Amplitudes of the reference, (n_freq, n_axis), and the settings behind them."""
        frequency, angle = self.line() / self.period_s, configurations.angle
        mobility = inverse_inertia(robot, angle, float(frequency[0]))
        crossover = robot.drives.speed_gain * mobility / (2 * np.pi)
        if not (crossover > 0).all():
            axis = robot.axis_names[int(np.argmin(crossover))]
            raise ConfigurationError(
                f"{axis} of {robot.name} has speed_gain 0: no speed reference can excite it"
            )
        if self.speed_rms_rad_s is not None:
            speed_rms = np.full(robot.n_axis, self.speed_rms_rad_s)
            level = Level("speed_rms_rad_s", self.speed_rms_rad_s, self.slow_sine_rad_s)
        else:
            peak = torque_peaks(robot, angle, sine_amplitude, self.torque_share, self.margin)
            speed_rms = speed_of_torque(peak, 1 / mobility, frequency)
            share = float((peak / robot.drives.torque_limit).min())
            level = Level("torque_share", share, self.slow_sine_rad_s)
        return flat_torque_amplitude(frequency, crossover, speed_rms * self._scale(robot)), level

    def _scale(self, robot: Robot) -> FloatArray:
        if self.axis_scale is None:
            return np.ones(robot.n_axis)
        if len(self.axis_scale) != robot.n_axis:
            raise ConfigurationError(
                f"axis_scale: {len(self.axis_scale)} factors for the {robot.n_axis} axes of {robot.name}"
            )
        return np.array(self.axis_scale)
