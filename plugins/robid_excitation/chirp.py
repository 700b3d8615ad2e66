"""Sweeps: all motors pass through the band once in a period, orthogonal over the experiments by their phases.

A swept sine has a low crest factor and a smooth spectrum, and excites one frequency at a time: distortion does not
average over random phases as a multisine's does. For comparison (Pintelon and Schoukens 2012, section 5.3).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from pydantic import Field, PositiveFloat

from robid_core import ConfigurationError, Configurations, Context, Excitation, Robot
from robid_core.estimation.excitation.multisine import experiment_factors
from robid_core.estimation.excitation.signals import (
    band_bins,
    edge_taper,
    in_band,
    powerful_bins,
    spread,
    sweep,
)
from robid_excitation.classical import ClassicalExcitation, whole_samples


class Chirp(ClassicalExcitation):
    """Speed references from a torque that sweeps through the band, faded in and out at its ends.

    The lines count from band end to band end where there is power; so that the sweep begins and ends smoothly some of
    it lies up to an octave below and a quarter above. At its ends the reference is below 4 % of its peak.

    Phases of the sweep differ from axis to axis by columns of (4.3) and are new for each block and experiment, so that
    a block of as many experiments as axes is orthogonal at every line.

        excite: {use: excitation.chirp, with: {band_hz: [4, 80], period_s: 8, sweep: logarithmic}}
    """

    period_s: PositiveFloat
    """Length of one sweep and of the period, s."""
    sweep: Literal["linear", "logarithmic"] = "linear"
    """Same power at every line, or in every octave."""
    fade: float = Field(default=0.05, gt=0, le=0.5)
    """Share of the period over which the sweep rises, two turns at least, and falls at its end."""

    def length(self) -> tuple[str, float]:
        """The period."""
        return "period_s", self.period_s

    def plan_lines(self, upstream: Mapping[str, Any]) -> list[str]:
        """Say what will be asked of the robot, for `robid plan`."""
        return [f"{self.sweep} sweep in {self.period_s:g} s", *super().plan_lines(upstream)]

    def run(self, configurations: Configurations, robot: Robot, context: Context) -> Excitation:
        """Make the sweeps of all configurations and clear them by simulation."""
        n_sample = whole_samples(self.period_s, robot)
        wide = (0.5 * self.band_hz[0], min(1.25 * self.band_hz[1], 0.49 / robot.sample_time_s))
        self.check_band(n_sample, robot, wide[0])
        fall = round(self.fade * n_sample)
        rise = max(fall, round(2 / (self.band_hz[0] * robot.sample_time_s)))
        if rise + fall > n_sample:
            raise ConfigurationError(
                f"period_s: {self.period_s:g} s do not hold two turns at {self.band_hz[0]:g} Hz to begin with and the "
                "fall at the end; take a longer period"
            )
        bins, line = band_bins(wide, self.period_s), band_bins(self.band_hz, self.period_s)
        waveform = sweep(self.band_hz, n_sample, robot.sample_time_s, self.sweep)
        waveform = in_band(waveform * edge_taper(n_sample, rise, fall), bins)
        n_axis, n_exp = robot.n_axis, self.n_exp(robot.n_axis)
        factors = experiment_factors(max(n_exp, n_axis), n_axis)[:n_exp]
        shape = (configurations.n_config, self.blocks)
        of_axis = context.generator.uniform(0.0, 2 * np.pi, (*shape, 1, n_axis))
        of_experiment = context.generator.uniform(0.0, 2 * np.pi, (*shape, n_exp, 1))
        turned = factors * np.exp(1j * (of_axis + of_experiment))
        torque = np.stack(
            [np.stack([spread(waveform, bins, block[:, None]) for block in blocks]) for blocks in turned]
        )
        return self.finish(torque, powerful_bins(waveform, line), configurations, robot, context)
