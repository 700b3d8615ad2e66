"""What sweeps, binary sequences and noise share: settings, level, slow sine, clearance.

Each stage makes waveforms of *torque*; here they get their size and become references of speed. A speed reference
with steps in it would ask for impulses of acceleration; a step of torque is a ramp of speed. The motor is taken as an
inertia under its speed loop (`estimation.excitation.signals`), as for the multisine.
"""

from __future__ import annotations

import abc
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
from robid_core.estimation.excitation.multisine import sine
from robid_core.estimation.excitation.signals import (
    reference_of_motor_speed,
    speed_of_motor_torque,
    through_lines,
)
from robid_excitation.amplitudes import crossover_hz, inverse_inertia, torque_peaks
from robid_excitation.beforehand import problems_of, refuse_too_fast, refuse_too_large, refuse_wrong_length
from robid_excitation.lines import refuse_beyond_half_rate
from robid_excitation.prediction import Level, clear


def whole_samples(period_s: float, robot: Robot, setting: str = "period_s") -> int:
    """Samples in a period; ConfigurationError unless they are whole."""
    count = round(period_s / robot.sample_time_s)
    if count < 4 or abs(period_s / robot.sample_time_s - count) > 1e-6:
        raise ConfigurationError(
            f"{setting}: {period_s:g} s is not a whole number of the robot's samples of {robot.sample_time_s:g} s; "
            f"{max(count, 4) * robot.sample_time_s:.9g} s is"
        )
    return count


class ClassicalExcitation(ExcitationDesign):
    """Settings and level of the excitations beside the multisine; `run` is the subclass's."""

    band_hz: tuple[PositiveFloat, PositiveFloat]
    """Lowest and highest excited frequency, Hz."""
    blocks: int = Field(default=2, ge=1, le=1000)
    """Blocks of experiments, each with phases, shifts or noise of its own."""
    experiments: PositiveInt | None = None
    """Experiments in a block; by default one for each axis."""
    slow_sine_rad_s: NonNegativeFloat = 0.0
    """Amplitude of the slow sine, motor speed in rad/s; 0: none."""
    slow_sine_bin: PositiveInt = 2
    """Whole turns of the slow sine in a period."""
    speed_rms_rad_s: PositiveFloat | None = None
    """Root mean square of the motor speed from the signal; by default what `torque_share` allows."""
    torque_share: float = Field(default=0.5, gt=0, le=1)
    """Share of each motor's torque limit that the signal's peaks take, where `speed_rms_rad_s` is not set."""
    axis_scale: tuple[PositiveFloat, ...] | None = None
    """Factor on both amplitudes for each axis; by default 1 for all."""
    margin: float = Field(default=0.9, gt=0, le=1)
    """Share of the torque, speed and acceleration limits that the prediction may use."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.band_hz[0] >= self.band_hz[1]:
            raise ValueError(f"band_hz: {self.band_hz[0]:g} Hz is not below {self.band_hz[1]:g} Hz")
        return self

    def plan_lines(self, upstream: Mapping[str, Any]) -> list[str]:
        """Say what will be asked of the robot, for `robid plan`."""
        counts = [getattr(stage, "count", None) for stage in upstream.values()]
        count = next((number for number in counts if isinstance(number, int)), None)
        where = "" if count is None else f"{count} configuration{'' if count == 1 else 's'} x "
        level = f"{self.torque_share:.0%} of the torque limits"
        if self.speed_rms_rad_s is not None:
            level = f"{self.speed_rms_rad_s:g} rad/s rms of motor speed"
        slow = f", slow sine {self.slow_sine_rad_s:g} rad/s" if self.slow_sine_rad_s else ""
        each = "one experiment per axis" if self.experiments is None else f"{self.experiments} experiments"
        return [
            f"from {self.band_hz[0]:g} to {self.band_hz[1]:g} Hz, {where}{self.blocks} blocks x {each}",
            f"peaks at {level}{slow}" if self.speed_rms_rad_s is None else f"{level}{slow}",
        ]

    def n_exp(self, n_axis: int) -> int:
        """Experiments in a block."""
        return n_axis if self.experiments is None else self.experiments

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """A length or a band that the robot's sampling does not hold, axes that it does not have, too much memory."""
        setting, seconds = self.length()
        n_experiment = self.blocks * self.n_exp(robot.n_axis)
        return problems_of(
            [
                lambda: refuse_beyond_half_rate(self.band_hz, robot),
                lambda: self.check_length(robot),
                lambda: refuse_too_large(setting, seconds, n_experiment, robot),
                lambda: refuse_too_fast("slow_sine_rad_s", self.slow_sine_rad_s, self.axis_scale, robot),
                lambda: refuse_wrong_length("axis_scale", self.axis_scale, robot),
            ]
        )

    @abc.abstractmethod
    def length(self) -> tuple[str, float]:
        """Which setting says how long a period is, and how long it is in s."""

    def check_length(self, robot: Robot) -> None:
        """Raise ConfigurationError unless a period has whole samples."""
        setting, seconds = self.length()
        whole_samples(seconds, robot, setting)

    def check_band(self, n_sample: int, robot: Robot, lowest_hz: float) -> None:
        """Refuse a band that the sampling, or a slow sine that the signal from `lowest_hz` on, has no room for."""
        step = robot.sample_time_s
        refuse_beyond_half_rate(self.band_hz, robot)
        sine_hz = self.slow_sine_bin / (n_sample * step)
        if self.slow_sine_rad_s > 0 and sine_hz >= lowest_hz:
            raise ConfigurationError(
                f"the slow sine at {sine_hz:g} Hz is not below the signal from {lowest_hz:g} Hz on; take a longer "
                "period or a higher band"
            )

    def finish(
        self,
        torque: FloatArray,
        line: IntArray,
        configurations: Configurations,
        robot: Robot,
        context: Context,
        taper: FloatArray | None = None,
    ) -> Excitation:
        """Give waveforms of torque their size, add the slow sine, and clear the references by simulation.

        Parameters
        ----------
        torque
            In any unit, the same for all axes, without a mean, shape (n_config, n_block, n_exp, n_sample, n_axis).
        line
            Bins of the period that count as excited; empty where the motion is not periodic.
        taper
            Factor on the references that lets them start and end at rest, shape (n_sample,).
        """
        n_config, n_block, _, n_sample, n_axis = torque.shape
        step, angle = robot.sample_time_s, configurations.angle
        mobility = inverse_inertia(robot, angle, self.band_hz[0])
        crossover = crossover_hz(robot, mobility)
        scale = self._scale(robot)
        sine_amplitude: FloatArray = np.float64(self.slow_sine_rad_s) * scale
        speed_of_torque = speed_of_motor_torque(n_sample, step, 1 / mobility)
        if self.speed_rms_rad_s is not None:
            speed = through_lines(torque, speed_of_torque)
            size = self.speed_rms_rad_s / np.sqrt(np.mean(speed**2, axis=(0, 1, 2, 3)))
            level = Level("speed_rms_rad_s", self.speed_rms_rad_s, self.slow_sine_rad_s)
        else:
            peak = torque_peaks(robot, angle, sine_amplitude, self.torque_share, self.margin)
            size = peak / np.abs(torque).max(axis=(0, 1, 2, 3))
            share = float((peak / robot.drives.torque_limit).min())
            level = Level("torque_share", share, self.slow_sine_rad_s)
        factor = speed_of_torque * reference_of_motor_speed(n_sample, step, crossover) * (size * scale)
        fast = through_lines(torque, factor)
        slow = np.zeros((n_config, n_block, 1, n_sample, n_axis))
        if self.slow_sine_rad_s > 0:
            for c, m in np.ndindex(n_config, n_block):
                phase = context.generator.uniform(0.0, 2 * np.pi, (n_axis,))
                slow[c, m, 0] = sine(sine_amplitude, phase, self.slow_sine_bin, n_sample)
        if taper is not None:
            fast, slow = at_rest(fast, taper), at_rest(slow, taper)
        cleared = clear(fast, slow, angle, robot, line, self.margin, level)
        return Excitation(
            axis_names=robot.axis_names,
            sample_time_s=step,
            slow_sine_bin=self.slow_sine_bin if self.slow_sine_rad_s > 0 else 0,
            line=line,
            reference=fast + slow,
            slow_sine_speed=sine_amplitude,
            **cleared.artifact_fields(),
        )

    def _scale(self, robot: Robot) -> FloatArray:
        if self.axis_scale is None:
            return np.ones(robot.n_axis)
        refuse_wrong_length("axis_scale", self.axis_scale, robot)
        return np.array(self.axis_scale)


def at_rest(reference: FloatArray, taper: FloatArray) -> FloatArray:
    """A reference (..., n_sample, n_axis) that starts and ends at zero and leads back to where it began."""
    window = taper[:, None]
    tapered = reference * window
    # What the taper makes of the mean is taken off with the taper's own shape: the ends stay at zero.
    result: FloatArray = tapered - window * (tapered.sum(axis=-2, keepdims=True) / taper.sum())
    return result
