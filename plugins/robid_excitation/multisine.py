"""Orthogonal random-phase multisines on odd lines, with a slow sine that keeps the motors moving.

Thesis section 4.2. Each configuration and each block has phases of its own, so that the distortion of a
nonlinear robot averages out and shows in the scatter; within a block the experiments are orthogonal (4.2).
The slow sine holds the motors away from standstill, where friction is not a slope; it sits on an even bin.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from robid_core import (
    MILESTONE,
    ConfigurationError,
    Configurations,
    Context,
    Excitation,
    ExcitationDesign,
    FloatArray,
    IntArray,
    Robot,
    frozen,
)
from robid_core.estimation.excitation.grids import (
    leave_one_out,
    linear_choice,
    logarithmic_choice,
    odd_bins,
    refuse_too_few,
    spacing_hz,
    with_detection,
    without_multiples,
)
from robid_core.estimation.excitation.multisine import flat_torque_amplitude
from robid_excitation.amplitudes import (
    CREST as CREST,
    crossover_hz,
    inverse_inertia as inverse_inertia,
    motor_speed_of,
    reference_shape,
    scaled_to,
    speed_of_torque as speed_of_torque,
    tabulated_weight,
    torque_peaks as torque_peaks,
)
from robid_excitation.beforehand import (
    problems_of,
    refuse_strange_axes,
    refuse_too_fast,
    refuse_too_large,
    refuse_wrong_length,
)
from robid_excitation.lines import (
    missed_resonances as missed_resonances,
    samples_in_period as samples_in_period,
)
from robid_excitation.prediction import Level, clear, factors_within_limits
from robid_excitation.realisations import PhaseChoice, references, torque_crest, torque_response
from robid_excitation.ripple_reach import planned_reach, reaches


class Multisine(ExcitationDesign):
    """Speed references from multisines with the same torque at all lines, plus a slow sine.

    Nothing moves before the nominal robot was simulated with it: an excitation that would break a limit of
    torque, speed, acceleration or position is refused, with the amplitude that would do; `beyond_limits: scale` takes
    that amplitude.

    Distortion averages because phases are random. What does not depend on the phases (ripple and friction harmonics
    of the slow sine) lies on even bins as long as the sine's bin is even; where it falls on lines, the random phases of
    each experiment average it. `experiments_per_block: n_plus_1` rejects it exactly and measures it, with common
    phases, at the price that a motor's own distortion comes back in every experiment of a block and averages over
    blocks only: more blocks, and a scatter taken over blocks. `crest: minimise` buys lower peaks, and so more torque
    at each line, with phases that are no longer random: distortion does not average as over random ones, and the best
    linear approximation is that of signals with few peaks. It takes seconds a block with six axes.

        excite:
          use: excitation.multisine
          with: {band_hz: [4, 80], lines: 100, period_s: 8, blocks: 2, slow_sine_rad_s: 9}
    """

    band_hz: tuple[PositiveFloat, PositiveFloat]
    """Lowest and highest excited frequency, Hz."""
    lines: PositiveInt | None = None
    """Number of excited lines: odd bins of the period, no line twice; left out where `grid` is full."""
    grid: Literal["logarithmic", "linear", "full"] = "logarithmic"
    """Distances of the lines: at a constant ratio, a constant distance, or every odd bin of the band."""
    detection_group: int | None = Field(default=None, ge=2, le=1000)
    """One line of every so many consecutive ones is left out, drawn at random, and shows odd distortion."""
    period_s: PositiveFloat
    """Length of one period, s; lines are multiples of its inverse."""
    blocks: int = Field(default=2, ge=1, le=1000)
    """Blocks of experiments, each with phases of its own; two are needed for a covariance."""
    experiments_per_block: Literal["n", "n_plus_1"] = "n"
    """As many as axes, or one more, whose column of (4.3) takes what does not depend on the phases."""
    experiment_phases: Literal["random", "common"] | None = None
    """Phases of each experiment's own beside those of its block; by default random for n, common for n_plus_1."""
    spectrum: Literal["flat_torque", "flat_speed", "flat_acceleration"] = "flat_torque"
    """Same torque of the motor at every line; or a reference flat in speed, or in acceleration."""
    exponents: tuple[float, ...] | None = None
    """For each axis: the amplitudes are multiplied by frequency to this power; by default 0 for all."""
    weights: dict[str, tuple[tuple[PositiveFloat, PositiveFloat], ...]] | None = None
    """For axes by name: pairs (Hz, factor) on the amplitudes, straight between them on logarithmic axes."""
    slow_sine_rad_s: NonNegativeFloat = 0.0
    """Amplitude of the slow sine, motor speed in rad/s; 0: none."""
    slow_sine_hz: PositiveFloat | None = None
    """Frequency of the slow sine, a bin of the period; by default bin 2, or 3 where it is to be odd."""
    slow_sine_parity: Literal["even", "odd"] = "even"
    """An odd bin shows odd friction harmonics at its odd multiples, which are left out of the lines."""
    speed_rms_rad_s: PositiveFloat | None = None
    """Root mean square of the motor speed from the multisine; by default what `torque_share` allows."""
    torque_share: float = Field(default=0.5, gt=0, le=1)
    """Share of each motor's torque limit that the multisine's peaks take, where `speed_rms_rad_s` is not set."""
    axis_scale: tuple[PositiveFloat, ...] | None = None
    """Factor on both amplitudes for each axis; by default 1 for all."""
    draws: PositiveInt = 10
    """Random phases tried for each block; the ones with the lowest crest factor are taken, or searched on from."""
    crest: Literal["draws", "minimise"] = "draws"
    """Best of the draws as it is, or its phases searched for lower peaks (all experiments of a block at once)."""
    crest_of: Literal["reference", "torque"] = "torque"
    """Whose peaks a search lowers; the torque is that of the nominal robot."""
    margin: float = Field(default=0.9, gt=0, le=1)
    """Share of the torque, speed and acceleration limits that the prediction may use."""
    beyond_limits: Literal["refuse", "scale"] = "refuse"
    """An excitation that the nominal robot cannot follow is refused, or made as small as its limits need."""
    ripple_orders: tuple[PositiveFloat, ...] = (1.0, 2.0, 6.0, 12.0)
    """Ripple per motor turn to be listed beside the nominal robot's (one pole pair: resolver 1, 2, torque 6, 12)."""
    ripple_level: float = Field(default=0.01, gt=0, lt=1)
    """Lines with more of a ripple than this share of its amplitude are listed as reached."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.band_hz[0] >= self.band_hz[1]:
            raise ValueError(f"band_hz: {self.band_hz[0]:g} Hz is not below {self.band_hz[1]:g} Hz")
        if (self.lines is None) != (self.grid == "full"):
            wanted = "is every odd bin: leave lines out" if self.lines else "needs lines: how many"
            raise ValueError(f"grid: {self.grid} {wanted}")
        self._sine_possible()
        try:
            line = self.line()
        except ConfigurationError as error:
            raise ValueError(str(error)) from error
        if self.slow_sine_rad_s > 0 and self.sine_bin >= line[0]:
            raise ValueError(
                f"the slow sine at {self.sine_bin / self.period_s:g} Hz is not below the lowest line at "
                f"{line[0] / self.period_s:g} Hz; take a longer period or a higher band"
            )
        for axis, table in (self.weights or {}).items():
            if len({frequency for frequency, _ in table}) < max(1, len(table)):
                raise ValueError(
                    f"weights.{axis}: a table of (Hz, factor) with every frequency once is wanted"
                )
        return self

    def _sine_possible(self) -> None:
        if self.slow_sine_hz is None:
            return
        odd = int(self.slow_sine_parity == "odd")
        wanted = self.slow_sine_hz * self.period_s
        near = 2 * max(1, round((wanted - odd) / 2)) + odd
        if abs(wanted - near) > 1e-6:
            why = (
                "its odd multiples cannot be left out"
                if odd
                else "its friction harmonics would fall on excited lines"
            )
            raise ValueError(
                f"slow_sine_hz: {self.slow_sine_hz:g} Hz is not an {self.slow_sine_parity} bin of {self.period_s:g} s"
                f"{' from 3 on' if odd else ''}, and {why}; {near / self.period_s:.6g} Hz is"
            )

    def line(self) -> IntArray:
        """Bins of the grid; with `detection_group` some of them, drawn when it runs, are left out."""
        bins = odd_bins(self.band_hz, self.period_s)
        if self.sine_bin % 2:
            bins = without_multiples(bins, self.sine_bin)
        if self.lines is None:
            refuse_too_few(bins, 1, self.band_hz, self.period_s, self.detection_group)
            return bins
        refuse_too_few(bins, self.lines, self.band_hz, self.period_s, self.detection_group)
        group = self.detection_group
        count = self.lines if group is None else with_detection(self.lines, group)
        return (linear_choice if self.grid == "linear" else logarithmic_choice)(bins, count)

    @property
    def sine_bin(self) -> int:
        """Bin of the slow sine, 0 where there is none."""
        if self.slow_sine_rad_s == 0:
            return 0
        default = 2 if self.slow_sine_parity == "even" else 3
        return default if self.slow_sine_hz is None else round(self.slow_sine_hz * self.period_s)

    def n_exp(self, n_axis: int) -> int:
        """Experiments in a block."""
        return n_axis + (self.experiments_per_block == "n_plus_1")

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """A period or a band that the robot's sampling does not hold, axes that it does not have, too much memory."""
        n_experiment = self.blocks * self.n_exp(robot.n_axis)
        return problems_of(
            [
                lambda: samples_in_period(self.period_s, self.band_hz, robot),
                lambda: refuse_too_large("period_s", self.period_s, n_experiment, robot),
                lambda: refuse_too_fast("slow_sine_rad_s", self.slow_sine_rad_s, self.axis_scale, robot),
                lambda: refuse_wrong_length("exponents", self.exponents, robot),
                lambda: refuse_wrong_length("axis_scale", self.axis_scale, robot),
                lambda: refuse_strange_axes("weights", self.weights, robot),
            ]
        )

    def plan_lines(self, upstream: Mapping[str, Any]) -> list[str]:
        """Say what will be asked of the robot, for `robid plan`."""
        line = self.line()
        frequency, spacing = line / self.period_s, spacing_hz(line, self.period_s)
        counts = [getattr(stage, "count", None) for stage in upstream.values()]
        count = next((number for number in counts if isinstance(number, int)), None)
        where = "" if count is None else f"{count} configuration{'' if count == 1 else 's'} x "
        group = self.detection_group
        detection = f", one of every {group} left out at random" if group else ""
        one_more = " and one more" if self.experiments_per_block == "n_plus_1" else ""
        level = f"{self.torque_share:.0%} of the torque limits"
        if self.speed_rms_rad_s is not None:
            level = f"{self.speed_rms_rad_s:g} rad/s rms of motor speed"
        slow = f", slow sine {self.slow_sine_rad_s:g} rad/s at {self.sine_bin / self.period_s:g} Hz"
        fastest = self.slow_sine_rad_s * max(self.axis_scale or (1.0,))
        return [
            f"{len(line)} odd lines from {frequency[0]:.4g} to {frequency[-1]:.4g} Hz, {spacing.min():.3g} to "
            f"{spacing.max():.3g} Hz apart{detection}",
            f"{where}{self.blocks} blocks x one experiment per axis{one_more}, period {self.period_s:g} s",
            f"multisine at {level}{slow if self.sine_bin else ''}",
            *planned_reach(line, self.period_s, self.sine_bin, fastest, self.ripple_orders),
        ]

    def run(self, configurations: Configurations, robot: Robot, context: Context) -> Excitation:
        """Make the references of all configurations and clear them by simulation."""
        n_sample = samples_in_period(self.period_s, self.band_hz, robot)
        line, angle = self.line(), configurations.angle
        if self.detection_group is not None:
            line, _ = leave_one_out(line, self.detection_group, context.generator)
        frequency = line / self.period_s
        sine_amplitude = self.slow_sine_rad_s * self._of_axes("axis_scale", robot, 1.0)
        crossover, amplitude, level = self._amplitude(frequency, angle, robot, sine_amplitude)
        search = self.crest == "minimise"
        common = (self.experiment_phases or self._default_phases) == "common"
        choice = PhaseChoice(self.n_exp(robot.n_axis), common, self.draws, search)
        torque = torque_response(robot, angle, frequency) if search else None
        shape = (configurations.n_config, self.blocks, n_sample)
        peaks_of = torque if self.crest_of == "torque" else None
        fast, slow = references(
            amplitude, sine_amplitude, line, self.sine_bin, shape, choice, peaks_of, context.generator
        )
        if torque is not None and self.speed_rms_rad_s is None:
            # The same peaks of torque with the crest factor that was found, in place of that of random phases.
            gain = CREST / torque_crest(fast, torque, line)
            fast, amplitude = fast * gain, amplitude * gain
        if self.beyond_limits == "scale":
            smaller, slower, told = factors_within_limits(fast, slow, angle, robot, line, self.margin)
            fast, amplitude, slow = smaller * fast, smaller * amplitude, slower * slow
            sine_amplitude = slower * sine_amplitude
            if told:
                sizes = f"multisine {smaller:.3g}" + (f" and slow sine {slower:.3g}" if slower < 1 else "")
                context.log.log(MILESTONE, "%s times as large as asked for: %s", sizes, told)
        self._tell(
            robot, angle, line, motor_speed_of(amplitude, frequency, crossover), sine_amplitude, context
        )
        cleared = clear(fast, slow, angle, robot, line, self.margin, level)
        return Excitation(
            axis_names=robot.axis_names,
            sample_time_s=robot.sample_time_s,
            slow_sine_bin=self.sine_bin,
            line=line,
            reference=frozen(fast + slow),
            slow_sine_speed=sine_amplitude,
            **cleared.artifact_fields(),
        )

    @property
    def _default_phases(self) -> str:
        return "common" if self.experiments_per_block == "n_plus_1" else "random"

    def _tell(
        self,
        robot: Robot,
        angle: FloatArray,
        line: IntArray,
        speed: FloatArray,
        sine_speed: FloatArray,
        context: Context,
    ) -> None:
        """Log resonances that may be missed, and the lines that ripple reaches; `speed` (n_freq, n_axis)."""
        missed = missed_resonances(robot, angle, line, self.period_s)
        if missed:
            context.log.warning(
                "%d resonance%s of the nominal robot may fall between the lines, the one at %.4g Hz most: it is "
                "%.2g Hz wide, the lines there are %.2g Hz apart; take more lines, or a longer period",
                len(missed),
                "" if len(missed) == 1 else "s",
                *missed[0],
            )
        swing = speed / (2 * np.pi * line / self.period_s)[:, None]
        n_sample = round(self.period_s / robot.sample_time_s)
        found = reaches(
            robot, self.ripple_orders, line, swing, self.sine_bin, sine_speed, n_sample, self.ripple_level
        )
        for reach in found:
            context.log.info("%s", reach.words(self.ripple_level, self.period_s))

    def _amplitude(
        self, frequency: FloatArray, angle: FloatArray, robot: Robot, sine_amplitude: FloatArray
    ) -> tuple[FloatArray, FloatArray, Level]:
        """Crossover of the loops, amplitudes of the reference (n_freq, n_axis), and the settings behind them."""
        mobility = inverse_inertia(robot, angle, float(frequency[0]))
        crossover = crossover_hz(robot, mobility)
        shape = self._shape(frequency, crossover, robot)
        if self.speed_rms_rad_s is not None:
            speed_rms = np.full(robot.n_axis, self.speed_rms_rad_s)
            level = Level("speed_rms_rad_s", self.speed_rms_rad_s, self.slow_sine_rad_s)
        else:
            peak = torque_peaks(robot, angle, sine_amplitude, self.torque_share, self.margin)
            speed = None if shape is None else motor_speed_of(shape, frequency, crossover)
            speed_rms = speed_of_torque(peak, 1 / mobility, frequency, speed)
            share = float((peak / robot.drives.torque_limit).min())
            level = Level("torque_share", share, self.slow_sine_rad_s)
        speed_rms = speed_rms * self._of_axes("axis_scale", robot, 1.0)
        if shape is None:
            return crossover, flat_torque_amplitude(frequency, crossover, speed_rms), level
        return crossover, scaled_to(shape, frequency, crossover, speed_rms), level

    def _shape(self, frequency: FloatArray, crossover: FloatArray, robot: Robot) -> FloatArray | None:
        """Shape of the amplitudes with exponents and weights, (n_freq, n_axis); None for a plain flat torque."""
        if self.spectrum == "flat_torque" and self.exponents is None and self.weights is None:
            return None
        shape: FloatArray = reference_shape(self.spectrum, frequency, crossover)
        shape = shape * (frequency[:, None] / frequency[0]) ** self._of_axes("exponents", robot, 0.0)
        refuse_strange_axes("weights", self.weights, robot)
        for name, table in (self.weights or {}).items():
            shape[:, robot.axis_names.index(name)] *= tabulated_weight(frequency, table)
        return shape

    def _of_axes(self, setting: str, robot: Robot, default: float) -> FloatArray:
        """Values of a setting that has one for each axis."""
        values: tuple[float, ...] | None = getattr(self, setting)
        if values is None:
            return np.full(robot.n_axis, default)
        refuse_wrong_length(setting, values, robot)
        return np.array(values)
