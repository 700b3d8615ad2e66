"""Band-limited Gaussian noise of torque, independent for every axis and experiment, periodic or from rest to rest.

Noise that repeats excites all lines of its band, with random amplitudes; noise that does not has no lines and no
steady state, and its records are for windowed segments (`frf.spectral`). For comparison with multisines.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field, PositiveFloat

from robid_core import Configurations, Context, Excitation, Robot
from robid_core.estimation.excitation.signals import band_bins, edge_taper, gaussian_lines
from robid_excitation.classical import ClassicalExcitation, whole_samples


class FilteredNoise(ClassicalExcitation):
    """Speed references from Gaussian noise of torque with the same power at all frequencies of the band.

    Periodic noise is cut off at the band's ends exactly. Noise that is not fades in and out; measure it once:
    `acquire: {use: acquisition.drives, with: {periods: 1, settle_periods: 0}}`.

        excite: {use: excitation.filtered_noise, with: {band_hz: [4, 80], duration_s: 60, periodic: false}}
    """

    duration_s: PositiveFloat
    """Length of an experiment, or of the period, s."""
    periodic: bool = True
    """Repeat the same noise, with lines; or one long run from rest to rest, without."""
    fade: float = Field(default=0.02, gt=0, le=0.5)
    """Share of the duration over which noise that is not periodic rises, and falls at its end."""

    @property
    def excites_lines(self) -> bool:
        """Periodic noise does."""
        return self.periodic

    def length(self) -> tuple[str, float]:
        """The duration."""
        return "duration_s", self.duration_s

    def plan_lines(self, upstream: Mapping[str, Any]) -> list[str]:
        """Say what will be asked of the robot, for `robid plan`."""
        how = "periodic noise" if self.periodic else "noise from rest to rest, no lines"
        return [f"{how}, {self.duration_s:g} s", *super().plan_lines(upstream)]

    def run(self, configurations: Configurations, robot: Robot, context: Context) -> Excitation:
        """Draw the noise of all configurations and clear it by simulation."""
        n_sample = whole_samples(self.duration_s, robot, "duration_s")
        self.check_band(n_sample, robot, self.band_hz[0])
        bins = band_bins(self.band_hz, self.duration_s)
        shape = (configurations.n_config, self.blocks, self.n_exp(robot.n_axis), robot.n_axis)
        torque = gaussian_lines(shape, bins, n_sample, context.generator)
        if self.periodic:
            return self.finish(torque, bins, configurations, robot, context)
        fade = round(self.fade * n_sample)
        none, taper = np.zeros(0, dtype=np.int64), edge_taper(n_sample, fade, fade)
        return self.finish(torque, none, configurations, robot, context, taper)
