"""Cramer-Rao bounds: what no unbiased estimate from so many experiments can go below.

Noise of the measured angle and torque leaves ``V = Y - G U`` of each experiment; the true spectra U are nuisances, and
with n_exp = n_axis or more the information about G at a line is ``conj(U U^H) (x) C_V^-1`` (Pintelon and
Schoukens 2012, section 10.4), of vec(G) by columns. Through G it reaches the stiffnesses (thesis 4.4). With
distortion added to C_V the bounds are those of Gaussian noise of that size: nothing is known of better use of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core import Robot
from robid_core.estimation.information import covariance_of_parameters, information_of_rank_one

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


def noise_covariance(
    robot: Robot, response: ComplexArray, frequency_hz: FloatArray, n_sample: int, n_period: int = 1
) -> ComplexArray:
    """Covariance of V of one experiment that the sensors cause, averaged over its periods.

    ``(w^4 diag(s_q^2 + step^2 / 12) + G diag(s_u^2) G^H) / (n_sample n_period)``: noise of the angle and steps of the
    encoder (uniform, dithered by the motion), and noise of the torque. What the controller does with the
    former moves U and Y along G and leaves V alone.

    Parameters
    ----------
    robot
        Whose sensors measure.
    response
        G, (rad/s^2)/(N m), shape (..., n_freq, n_axis, n_axis).
    frequency_hz
        Shape (n_freq,).
    n_sample, n_period
        Samples of a period, and how many periods are averaged.

    Returns
    -------
    (rad/s^2)^2, DFT scaled by 1 / n_sample, shape (..., n_freq, n_axis, n_axis).
    """
    drives = robot.drives
    step = np.where(drives.encoder_counts > 0, 2 * np.pi / np.maximum(drives.encoder_counts, 1), 0.0)
    angle = np.diag(drives.position_noise**2 + step**2 / 12)
    fourth = ((2 * np.pi * frequency_hz) ** 4)[:, None, None]
    torque = (response * drives.torque_noise**2) @ response.conj().swapaxes(-1, -2)
    result: ComplexArray = (fourth * angle + torque) / (n_sample * n_period)
    return result


def response_variance(input_gram: ComplexArray, residual: ComplexArray) -> FloatArray:
    """Bound on the variance of each entry of G (real and imaginary part together).

    The diagonal of ``(U U^H)^-T (x) C_V``.

    Parameters
    ----------
    input_gram
        U U^H of all experiments, (N m)^2, shape (..., n_freq, n_axis, n_axis).
    residual
        C_V of one experiment, (rad/s^2)^2, same shape.
    """
    inputs = np.einsum("...jj->...j", np.linalg.inv(input_gram)).real
    outputs = np.einsum("...ii->...i", residual).real
    result: FloatArray = outputs[..., :, None] * inputs[..., None, :]
    return result


@dataclass(frozen=True, eq=False)
class ParameterBound:
    """Smallest standard errors of the logarithms of parameters, i.e. relative ones."""

    names: tuple[str, ...]
    covariance: FloatArray
    """Of the logarithms, shape (n_parameter, n_parameter)."""

    def standard_error(self, *names: str) -> FloatArray:
        """Relative standard error of the named parameters; of all without a name."""
        wanted = [self.names.index(name) for name in names or self.names]
        result: FloatArray = np.sqrt(np.diag(self.covariance)[wanted])
        return result


def parameter_bound(
    robot: Robot,
    pose: FloatArray,
    frequency_hz: FloatArray,
    input_gram: ComplexArray,
    residual: ComplexArray,
    motor_damping: FloatArray,
) -> ParameterBound:
    """Bound on stiffness, dampings of the same springs, and damping of the motors, all unknown, all logarithms.

    The model is linear with `motor_damping` in place of friction. Derivatives are taken at fixed sag of the springs;
    the sag's own change moves a bound by 0.2 % on six axes (test_reference_bounds).

    Parameters
    ----------
    robot
        At the true parameters.
    pose
        Configurations, joint side, rad, shape (n_pose, n_axis).
    frequency_hz
        Lines, shape (n_freq,).
    input_gram
        U U^H of all experiments of a pose, (N m)^2, shape (n_pose, n_freq, n_axis, n_axis).
    residual
        C_V of one experiment, (rad/s^2)^2, same shape.
    motor_damping
        N m s/rad, shape (n_pose, n_axis); one unknown factor an axis, common to the poses.

    Raises
    ------
    NotIdentifiable
        If some combination leaves no trace in the responses.
    """
    gradient = robot.response_with_gradient(pose, frequency_hz, motor_damping)
    stiffness, damping = robot.spring_arrays()
    s = 2j * np.pi * frequency_hz[:, None]
    names = (
        *robot.stiffness_names,
        *robot.damping_names,
        *(f"motor_damping.{name}" for name in robot.axis_names),
    )
    information = np.zeros((len(names), len(names)))
    for p in range(len(pose)):
        spring, motor = gradient.spring_vectors[p], gradient.motor_vectors[p]
        factors = np.concatenate(
            [np.broadcast_to(stiffness, (len(s), len(stiffness))), s * damping, s * motor_damping[p]], axis=1
        )
        information += information_of_rank_one(
            np.concatenate([spring, spring, motor], axis=1),
            -factors,
            input_gram[p],
            np.linalg.inv(residual[p]),
        )
    return ParameterBound(names, covariance_of_parameters(information, names))
