"""What one block of experiments in a configuration tells about the stiffnesses: thesis (4.4) with (4.8).

The covariance of the response is the one that the excitation, the controller and the noise give: with
u = F (r - y) and y the motor speed, U = (F^-1 + G)^-1 R, so the Gram matrix of the inputs is
``S = T^-1 Phi_r T^-H``, T = F^-1 + G. The derivative for a spring is a rank-one product, so that each
information matrix is a product of small Gram matrices (`information_of_rank_one`).
"""

from __future__ import annotations

import numpy as np

from robid_core import ComplexArray, Excitation, FloatArray, Robot
from robid_core.estimation.information import information_of_rank_one


def reference_power(excitation: Excitation) -> FloatArray:
    """Sum over the experiments of one block of |R|^2 at each line and axis, shape (n_freq, n_axis).

    The mean over realisations and blocks; R is the DFT over the samples divided by their number.
    """
    spectrum = np.fft.rfft(excitation.reference, axis=3)[:, :, :, excitation.line] / excitation.n_sample
    power: FloatArray = (np.abs(spectrum) ** 2).sum(axis=2).mean(axis=(0, 1))
    return power


def information_matrices(
    robot: Robot,
    angle: FloatArray,
    frequency_hz: FloatArray,
    power: FloatArray,
    output_covariance: ComplexArray,
    motor_damping: FloatArray,
) -> FloatArray:
    """Information of one block of experiments about the logarithms of all stiffnesses.

    Parameters
    ----------
    robot
        Model at the parameters for which the design is made.
    angle
        Configurations, shape (n_config, n_axis).
    frequency_hz
        Lines, shape (n_freq,).
    power
        From `reference_power`, (rad/s)^2, shape (n_freq, n_axis).
    output_covariance
        Covariance of the motor accelerations' spectra, shape (n_freq, n_axis, n_axis).
    motor_damping
        Equivalent damping of friction, shape (n_axis,).

    Returns
    -------
    Shape (n_config, n_spring, n_spring).
    """
    omega = 2 * np.pi * frequency_hz
    n_spring = len(robot.stiffness_names)
    stiffness = robot.spring_arrays()[0][:n_spring]
    damping = np.broadcast_to(motor_damping, angle.shape).copy()
    g = robot.response_with_gradient(angle, frequency_hz, damping)
    speed_response = g.response / (1j * omega[:, None, None])
    d = robot.drives
    controller = d.speed_gain + d.integral_gain / (1j * omega[:, None])
    index = np.arange(robot.n_axis)
    closing = speed_response.copy()
    closing[..., index, index] += 1 / controller
    inverse = np.linalg.inv(closing)
    gram = (inverse * power[:, None, :]) @ np.conj(np.swapaxes(inverse, -1, -2))
    weight = np.linalg.inv(output_covariance).astype(np.complex128)
    factors = np.broadcast_to(-stiffness.astype(complex), (len(omega), len(stiffness)))
    return np.stack(
        [
            information_of_rank_one(g.spring_vectors[c, :, :n_spring], factors, gram[c], weight)
            for c in range(len(angle))
        ]
    )
