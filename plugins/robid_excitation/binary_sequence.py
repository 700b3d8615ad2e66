"""Maximum-length binary sequences (PRBS) of torque, cut to a band.

A binary speed reference would ask for impulses of acceleration at every change of sign. Here the *torque* is binary,
the speed a chain of ramps; lines outside the band are taken out, which rounds the corners. For comparison with
multisines (Godfrey 1993; Pintelon and Schoukens 2012, section 5.3).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from robid_core import ComplexArray, ConfigurationError, Configurations, Context, Excitation, IntArray, Robot
from robid_core.estimation.excitation.multisine import experiment_factors
from robid_core.estimation.excitation.signals import (
    band_bins,
    binary_waveform,
    hadamard_factors,
    in_band,
    powerful_bins,
    shift_factors,
    spread,
)
from robid_excitation.classical import ClassicalExcitation


class BinarySequence(ClassicalExcitation):
    """Speed references from a band-limited maximum-length binary torque; the period follows from register and clock.

    `hadamard` turns signs between experiments and keeps the torque binary; it needs 1, 2, 4, 8... experiments a block.
    `t_matrix` turns phases (4.3) and needs one for each axis, but leaves two levels. Both are orthogonal at every line.
    `shifts` gives every axis of every experiment a shift of its own. The sequence of each block begins elsewhere.

        excite: {use: excitation.binary_sequence, with: {band_hz: [4, 80], register_bits: 11, clock_hz: 250}}
    """

    register_bits: int = Field(default=11, ge=3, le=18)
    """Bits of the shift register: 2^register - 1 signs in a sequence."""
    clock_hz: PositiveFloat
    """Signs per second; the band has to end below, where the spectrum has its first zero."""
    inverse_repeat: bool = False
    """Sequence and its negative in turn: twice the period, and power at odd lines only."""
    arrangement: Literal["hadamard", "t_matrix", "shifts"] = "t_matrix"
    """How the experiments of a block differ."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.band_hz[1] >= 0.9 * self.clock_hz:
            raise ValueError(
                f"clock_hz: at {self.clock_hz:g} Hz there is no power; end the band below {0.9 * self.clock_hz:g} Hz, "
                "or raise the clock"
            )
        if self.arrangement == "hadamard" and self.experiments is not None:
            raise ValueError("experiments: the arrangement hadamard has its own number; leave it out")
        return self

    @property
    def period_s(self) -> float:
        """Length of one period, s."""
        return ((1 << self.register_bits) - 1) * (2 if self.inverse_repeat else 1) / self.clock_hz

    def length(self) -> tuple[str, float]:
        """The period, from the register."""
        return "register_bits", self.period_s

    def check_length(self, robot: Robot) -> None:
        """Raise ConfigurationError unless each sign holds for whole samples."""
        self.samples_of_sign(robot)

    def samples_of_sign(self, robot: Robot) -> int:
        """Samples for which a sign holds; ConfigurationError unless they are whole."""
        hold = round(1 / (self.clock_hz * robot.sample_time_s))
        if hold < 1 or abs(hold * self.clock_hz * robot.sample_time_s - 1) > 1e-9:
            near = 1 / (max(hold, 1) * robot.sample_time_s)
            raise ConfigurationError(
                f"clock_hz: {self.clock_hz:g} Hz does not hold a sign for whole samples of {robot.sample_time_s:g} s; "
                f"{near:.9g} Hz does"
            )
        return hold

    def plan_lines(self, upstream: Mapping[str, Any]) -> list[str]:
        """Say what will be asked of the robot, for `robid plan`."""
        lines = super().plan_lines(upstream)
        if self.arrangement == "hadamard":
            lines[0] = lines[0].replace("one experiment per axis", "experiments up to the next power of two")
        return [f"{self.register_bits} bit at {self.clock_hz:g} Hz: period {self.period_s:.6g} s", *lines]

    def run(self, configurations: Configurations, robot: Robot, context: Context) -> Excitation:
        """Make the sequences of all configurations and clear them by simulation."""
        hold = self.samples_of_sign(robot)
        waveform = binary_waveform(self.register_bits, hold, self.inverse_repeat)
        n_sample = len(waveform)
        self.check_band(n_sample, robot, self.band_hz[0])
        bins = powerful_bins(waveform, band_bins(self.band_hz, self.period_s))
        waveform = in_band(waveform, bins)
        torque = np.stack(
            [
                np.stack([spread(waveform, bins, self._factors(robot.n_axis, bins, n_sample, hold, context))
                          for _ in range(self.blocks)])
                for _ in range(configurations.n_config)
            ]
        )  # fmt: skip
        return self.finish(torque, bins, configurations, robot, context)

    def _factors(
        self, n_axis: int, bins: IntArray, n_sample: int, hold: int, context: Context
    ) -> ComplexArray:
        """Factors of a block on the lines, (n_exp, n_freq, n_axis), shifts by whole signs among them."""
        n_exp, signs = self.n_exp(n_axis), n_sample // hold
        if self.arrangement == "shifts":
            shift = hold * context.generator.integers(signs, size=(n_exp, n_axis))
            return shift_factors(shift, bins, n_sample).swapaxes(-1, -2)
        if self.arrangement == "hadamard":
            turn = hadamard_factors(n_axis)
        else:
            turn = experiment_factors(max(n_exp, n_axis), n_axis)[:n_exp]
        # A shift of its own for each axis and for each experiment leaves the block orthogonal (`multisine`).
        of_axis = shift_factors(hold * context.generator.integers(signs, size=n_axis), bins, n_sample)
        of_experiment = shift_factors(
            hold * context.generator.integers(signs, size=len(turn)), bins, n_sample
        )
        result: ComplexArray = turn[:, None, :] * of_axis.T * of_experiment[:, :, None]
        return result
