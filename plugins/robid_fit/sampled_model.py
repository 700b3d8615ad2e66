"""A robot about an operating point as a sampled predictor model, and its derivatives for the robot's parameters.

``M z'' + D z' + K z = B (torque + d)``, torque held between samples: A and B are exact (matrix exponential). d is what
the model leaves out at each motor, a random walk, so that constant torques, gravity on the way and slow friction do not
pull at springs; with the measured torque's own white noise it is the process noise (L. Ljung, System Identification,
1999, section 4.3). Outputs are the motors' angles, with white noise each.
"""

from __future__ import annotations

import numpy as np
import scipy

from robid_core import FloatArray
from robid_core.mechanics import SecondOrderModel
from robid_fit.innovations import Predictor, PredictorSlopes
from robid_fit.kalman_gain import gain_slopes, steady_kalman_gain

N_NOISE = 3  # of each motor: white torque, walking torque, angle


class SampledModel:
    """One configuration: state [z, z', d], input the measured torque, output the motors' angles.

    Parameters
    ----------
    mass, damping, stiffness
        Of the robot there, shape (n_coordinate, n_coordinate).
    sample_time
        T, s.
    noise
        Standard deviations, shape (3, n_axis): of the torque in N m, of what it walks in N m / sqrt(s), of the angle in
        rad.
    """

    def __init__(
        self,
        mass: FloatArray,
        damping: FloatArray,
        stiffness: FloatArray,
        sample_time: float,
        noise: FloatArray,
    ) -> None:
        self.sample_time, self.noise = sample_time, noise
        self._inverse_mass = np.linalg.inv(mass)
        self._damping, self._stiffness = damping, stiffness
        n, n_axis = len(mass), noise.shape[1]
        self._walk = np.arange(2 * n, 2 * n + n_axis)
        self._generator = sample_time * self._motion(stiffness, damping)
        self.transition: FloatArray = scipy.linalg.expm(self._generator)
        self.input = self.transition[:, self._walk].copy()
        self.input[self._walk] = 0.0  # what a torque does, d does; but it leaves d alone
        self.output = np.eye(n_axis, 2 * n + n_axis)
        self._kalman = steady_kalman_gain(self.transition, self.output, self._process(), self.noise[2] ** 2)

    @classmethod
    def of(cls, model: SecondOrderModel, config: int, sample_time: float, noise: FloatArray) -> SampledModel:
        """Return one configuration of a robot's second-order model."""
        return cls(model.mass[config], model.damping[config], model.stiffness[config], sample_time, noise)

    @property
    def predictor(self) -> Predictor:
        """Its innovations form."""
        found = self._kalman
        return Predictor(self.transition, self.input, self.output, found.gain, found.innovation)

    def slopes(self, mass: FloatArray, damping: FloatArray, stiffness: FloatArray) -> PredictorSlopes:
        """Differentiate the predictor, first for what moves these matrices, then for the logarithm of each noise.

        Parameters
        ----------
        mass, damping, stiffness
            Derivatives of the robot's matrices, shape (n_free, n_coordinate, n_coordinate).
        """
        n_free, n_axis, n_state = len(mass), self.noise.shape[1], len(self.transition)
        n, n_all = mass.shape[1], len(mass) + self.noise.size
        in_transition = np.zeros((n_all, n_state, n_state))
        moves = slice(n, 2 * n)
        for i in range(n_free):
            direction = np.zeros_like(self._generator)
            direction[:, : 2 * n] = self.sample_time * self._motion(stiffness[i], damping[i])[:, : 2 * n]
            direction[:n] = 0.0
            direction[moves] -= self._inverse_mass @ mass[i] @ self._generator[moves]
            in_transition[i] = scipy.linalg.expm_frechet(self._generator, direction, compute_expm=False)
        b, in_b = self.input, in_transition[:, :, self._walk]
        in_process = np.zeros_like(in_transition)
        half = in_b * self.noise[0] ** 2 @ b.T
        in_process += half + half.swapaxes(1, 2)
        in_measurement = np.zeros((n_all, n_axis))
        for a in range(n_axis):
            white, walk, angle = (n_free + kind * n_axis + a for kind in range(N_NOISE))
            in_process[white] = 2 * self.noise[0, a] ** 2 * np.outer(b[:, a], b[:, a])
            place = self._walk[a]
            in_process[walk, place, place] = 2 * self.noise[1, a] ** 2 * self.sample_time
            in_measurement[angle, a] = 2 * self.noise[2, a] ** 2
        in_gain, in_innovation = gain_slopes(
            self.transition, self.output, self._kalman, in_transition, in_process, in_measurement
        )
        return PredictorSlopes(in_transition, in_b, in_gain, in_innovation)

    def _motion(self, stiffness: FloatArray, damping: FloatArray) -> FloatArray:
        """Time derivative of the state [z, z', d] from the state, shape (n_state, n_state)."""
        n, n_axis = len(self._inverse_mass), self.noise.shape[1]
        found = np.zeros((2 * n + n_axis,) * 2)
        found[:n, n : 2 * n] = np.eye(n)
        found[n : 2 * n, :n] = -self._inverse_mass @ stiffness
        found[n : 2 * n, n : 2 * n] = -self._inverse_mass @ damping
        found[n : 2 * n, 2 * n :] = self._inverse_mass[:, :n_axis]
        return found

    def _process(self) -> FloatArray:
        """Covariance of what disturbs the state within a sample."""
        process: FloatArray = self.input * self.noise[0] ** 2 @ self.input.T
        process[self._walk, self._walk] += self.noise[1] ** 2 * self.sample_time
        return process
