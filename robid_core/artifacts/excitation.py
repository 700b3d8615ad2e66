"""What the motors are asked to do: periodic speed references, in blocks of orthogonal experiments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.artifacts.artifact import Artifact, FloatArray, IntArray, array


@dataclass(frozen=True, eq=False)
class Excitation(Artifact):
    """One period of the speed reference for every experiment.

    `reference[c, m, e, n, a]` is the motor speed asked of axis a at sample n in experiment e of block m,
    realisation c; configuration i uses realisation ``i % n_realization``. `line` holds the excited DFT bins
    of one period (frequency = line * sample_rate / n_sample); `slow_sine_bin` is 0 where no sine is
    superposed. `predicted_*` come from the simulation that cleared the excitation.
    """

    axis_names: tuple[str, ...]
    sample_time_s: float
    slow_sine_bin: int
    line: IntArray = array("n_freq")
    reference: FloatArray = array("n_realization n_block n_exp n_sample n_axis", "rad/s")
    slow_sine_speed: FloatArray = array("n_axis", "rad/s")
    predicted_torque: FloatArray | None = array("n_config n_axis", "N m", optional=True)
    predicted_speed: FloatArray | None = array("n_config n_axis", "rad/s", optional=True)
    predicted_travel: FloatArray | None = array("n_config n_axis", "rad", optional=True)

    @property
    def n_sample(self) -> int:
        """Samples in one period."""
        return int(self.reference.shape[3])

    @property
    def period_s(self) -> float:
        """Length of one period in seconds."""
        return self.n_sample * self.sample_time_s

    @property
    def frequency_hz(self) -> FloatArray:
        """Excited frequencies in Hz, shape (n_freq,)."""
        return self.line / self.period_s

    def realization(self, configuration: int) -> FloatArray:
        """Return the reference of a configuration, shape (n_block, n_exp, n_sample, n_axis)."""
        result: FloatArray = self.reference[configuration % self.reference.shape[0]]
        return result

    def start_offset(self, configuration: int) -> FloatArray:
        """Where a motor has to start so that it moves about the configuration, and not away from it.

        The integral of the reference over a period has a mean, one to two amplitudes of the slow sine's
        travel; a motion that starts at the configuration *minus* this has it in its middle. Motor side, rad,
        shape (n_block, n_exp, n_axis).
        """
        travel = np.cumsum(self.realization(configuration), axis=2) * self.sample_time_s
        result: FloatArray = travel.mean(axis=2)
        return result
