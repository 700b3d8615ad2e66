"""What the bench knows of one plant in one pose: its best linear approximation, and what to expect of a measurement.

The judge of accuracy is one measurement of 24 experiments (four blocks of six, two periods, as much as the thesis
took): G_BLA is averaged until its own standard error is a tenth of that one's, or a stated share.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from reference.best_linear_approximation import Moments
from reference.bounds import noise_covariance, response_variance
from reference.excitation_class import ExcitationClass
from reference.metrics import seen_entries
from reference.plants import without_effects

from robid_core import Robot

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]

JUDGE_BLOCKS, JUDGE_PERIODS = 4, 2


@dataclass(frozen=True, eq=False)
class ReferencePose:
    """One plant in one pose under one class of excitations."""

    robot: Robot
    """The machine, with its sensors."""
    angle: FloatArray
    """The pose, joint side, rad, shape (n_axis,)."""
    excitation: ExcitationClass
    moments: Moments
    speed_rms: FloatArray
    """Of the motors without the slow sine, rad/s, shape (n_axis,)."""
    sine_speed: FloatArray
    """Amplitude of the slow sine that the motors follow, rad/s, shape (n_axis,)."""
    saturated: float
    """Largest share of samples of a motor and experiment at the torque limit."""
    transient: float
    """What the settling left over, as a share of the distortion (root mean square over axes and lines)."""

    @property
    def frequency_hz(self) -> FloatArray:
        """Excited frequencies, shape (n_freq,)."""
        return self.excitation.frequency_hz

    @property
    def response(self) -> ComplexArray:
        """G_BLA, (rad/s^2)/(N m), shape (n_freq, n_axis, n_axis), [output, input]."""
        return self.moments.response

    @property
    def standard_error(self) -> FloatArray:
        """Of each entry of G_BLA itself (real and imaginary part together)."""
        result: FloatArray = np.sqrt(self.moments.variance)
        return result

    @property
    def motor_damping(self) -> FloatArray:
        """E[df/dv] of the motors' friction under this motion, N m s/rad, shape (n_axis,)."""
        return self.robot.equivalent_motor_damping(self.speed_rms, self.sine_speed)

    @property
    def linear_response(self) -> ComplexArray:
        """Response of the linearised robot with `motor_damping`: what a fit would have to match.

        Without ripple: over motions of many of its periods its gain is one.
        """
        bare = without_effects(self.robot)
        result: ComplexArray = bare.response(self.angle[None], self.frequency_hz, self.motor_damping[None])[0]
        return result

    def residual(self, n_period: int = JUDGE_PERIODS, *, distortion: bool = True) -> ComplexArray:
        """Covariance of V = Y - G U of one experiment: noise averaged over periods, and distortion."""
        noise = noise_covariance(
            self.robot, self.response, self.frequency_hz, self.excitation.n_sample, n_period
        )
        result: ComplexArray = noise + self.moments.distortion if distortion else noise
        return result

    def response_bound(
        self, n_block: int = JUDGE_BLOCKS, n_period: int = JUDGE_PERIODS, *, distortion: bool = True
    ) -> FloatArray:
        """Cramer-Rao bound on the variance of each entry (with distortion: as if it were Gaussian noise)."""
        return response_variance(
            n_block * self.moments.input_gram, self.residual(n_period, distortion=distortion)
        )

    def measured_variance(self, n_block: int = JUDGE_BLOCKS, n_period: int = JUDGE_PERIODS) -> FloatArray:
        """Variance of each entry of an average over blocks: scatter of the realisations, and noise.

        Unlike `response_bound` it takes the distortion as it is over the entries, not as Gaussian noise of V.
        """
        noise = self.response_bound(1, n_period, distortion=False)
        return (self.moments.block_variance + noise) / n_block

    @property
    def seen(self) -> BoolArray:
        """Entries that the judging measurement sees above 10 dB: the mask of every metric."""
        return seen_entries(self.response, self.measured_variance())

    @property
    def precision(self) -> float:
        """Standard error of G_BLA over that of the judging measurement, root mean square over entries and lines."""
        return float(np.sqrt(np.mean(self.moments.variance / self.measured_variance())))

    def with_more(self, moments: Moments, saturated: float) -> ReferencePose:
        """Return the pose with another batch in it."""
        return replace(self, moments=self.moments + moments, saturated=max(self.saturated, saturated))
