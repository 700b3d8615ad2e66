"""Under what a best linear approximation holds: everything of an excitation but its phases.

A nonlinear robot has one best linear approximation for each class of excitations: lines, amplitudes, slow sine, and
how phases are drawn. The bench's own class is what the worked example (pipeline.yaml) would ask of the plant's
user; any `Excitation` of a later study gives another (`ExcitationClass.of`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from reference.plants import ReferencePlant

from robid_core import Configurations, Excitation, MotionRefused
from robid_core.estimation.excitation.multisine import low_crest_multisine, sine
from robid_core.testing import example_context
from robid_excitation.multisine import Multisine

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# That of pipeline.yaml at the root of the repository in twice its period; a test holds the two together.
SHIPPED: dict[str, Any] = {
    "band_hz": (4.0, 80.0),
    "lines": 100,
    "period_s": 8.0,
    "blocks": 2,
    "slow_sine_rad_s": 9.0,
}


@dataclass(frozen=True, eq=False)
class ExcitationClass:
    """Lines, amplitudes and slow sine of speed references in blocks of as many orthogonal experiments as axes."""

    line: IntArray
    """Excited bins of a period, shape (n_freq,)."""
    amplitude: FloatArray
    """Of the cosine of each line and axis, rad/s at the motor, shape (n_freq, n_axis)."""
    sine_bin: int
    """Bin of the slow sine; its phase is drawn for each block and axis."""
    sine_amplitude: FloatArray
    """rad/s at the motor, shape (n_axis,)."""
    n_sample: int
    sample_time_s: float
    draws: int
    """Sets of phases of which the one with the lowest crest factor is taken; 1: plain random phases."""

    @classmethod
    def of(cls, excitation: Excitation, draws: int = 1) -> ExcitationClass:
        """Class that an excitation belongs to; all of its experiments have the same spectrum."""
        spectrum = np.fft.rfft(excitation.reference[0, 0, 0], axis=0) / excitation.n_sample
        return cls(
            excitation.line,
            2 * np.abs(spectrum[excitation.line]),
            excitation.slow_sine_bin,
            excitation.slow_sine_speed,
            excitation.n_sample,
            excitation.sample_time_s,
            draws,
        )

    @property
    def frequency_hz(self) -> FloatArray:
        """Excited frequencies, shape (n_freq,)."""
        result: FloatArray = self.line / (self.n_sample * self.sample_time_s)
        return result

    def block(
        self, generator: np.random.Generator, n_exp: int | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Draw one block: multisines (n_exp, n_sample, n_axis), and their slow sine (n_sample, n_axis).

        As many experiments as axes, or one more; these have no phases of their own, as the excitation's stage does.
        """
        more = n_exp is not None and n_exp > self.amplitude.shape[1]
        fast = low_crest_multisine(
            self.amplitude, self.line, self.n_sample, self.draws, generator, n_exp, more
        )
        phase = generator.uniform(0.0, 2 * np.pi, len(self.sine_amplitude))
        return fast, sine(self.sine_amplitude, phase, self.sine_bin, self.n_sample)

    def changed(self, **fields: Any) -> ExcitationClass:
        """Return the class with some fields replaced."""
        return replace(self, **fields)


def shipped_class(plant: ReferencePlant, **settings: Any) -> ExcitationClass:
    """Excitation that the worked example's stage designs for the nominal robot in the plant's poses.

    `settings` of `excitation.multisine` replace those of `SHIPPED`. Where a limit would be broken, the share of the
    torque limit that the multisine takes goes down by a fifth until none is.

    The stage takes the best of ten sets of phases, the class plain random ones, at two thirds of the cost. On plant
    1, pose 1, 200 blocks each, the two differ by chance alone: mean |difference|^2 / variance 1.03 and 1.02, and
    0.99 between two runs with plain phases (README.md).
    """
    wanted = {**SHIPPED, **settings}
    poses = Configurations(plant.nominal.axis_names, plant.pose)
    share = wanted.pop("torque_share", Multisine.model_fields["torque_share"].default)
    while True:
        stage = Multisine(**wanted, torque_share=share)
        try:
            return ExcitationClass.of(stage.run(poses, plant.nominal, example_context()))
        except MotionRefused:
            share *= 0.8
            if share < 0.05:
                raise
