"""What the slow motion of the arm makes of a response: a mean over the poses that it visits, in closed loop.

While a slow sine carries the arm to and fro its inertia changes. References act on the closed loop, so what an
estimator averages over the poses q is ``S = (I + G F)^-1 G``, from a torque beside the controller's to acceleration, F
the controller's feedback; what it then calls the response is ``S (I - F S)^-1``, which is neither the response in the
middle pose nor the mean of the responses. The mean is taken by the rule of Gauss and Chebyshev with three nodes along
each principal axis of the motion, exact for sines to fourth order of each; the arm is taken as at rest in each pose, so
lines should be farther from resonances than the slow sine's frequency.
"""

from __future__ import annotations

import numpy as np

from robid_core import ComplexArray, FloatArray, Frf, Robot
from robid_core.estimation.response.controller import controller_response, feedback_from_acceleration
from robid_fit.response_weights import with_floor

NODE = np.sqrt(1.5)
"""Of the three-node rule for sines, in standard deviations; each node weighs a third, so does the middle."""


def slow_motion_gain(robot: Robot, frf: Frf, motor_damping: FloatArray) -> ComplexArray:
    """Factors that the motion gives the entries of a response, shape (n_config, n_freq, n_axis, n_axis).

    Parameters
    ----------
    robot
        Its controller is taken as the one that moved the robot.
    frf
        Poses, lines and the covariance of the motion.
    motor_damping
        Of the equivalent friction, N m s/rad, shape (n_config, n_axis).
    """
    n_config, n_axis = frf.angle.shape
    if frf.travel_covariance is None:
        return np.ones((n_config, len(frf.frequency_hz), n_axis, n_axis), dtype=np.complex128)
    loop = controller_response(robot.drives, robot.sample_time_s, frf.frequency_hz)
    feedback = feedback_from_acceleration(loop, frf.frequency_hz)
    eigen, axes = np.linalg.eigh(frf.travel_covariance)
    # Columns: one node for each principal axis.
    along = NODE * axes * np.sqrt(np.maximum(eigen, 0.0))[:, None]
    steps = robot.joint_angle(along.transpose(2, 0, 1))
    poses = frf.angle + np.concatenate((np.zeros((1, n_config, n_axis)), steps, -steps))
    responses = [robot.response(pose, frf.frequency_hz, motor_damping, frf.torque_hold) for pose in poses]
    one = np.eye(n_axis)
    middle, *others = [np.linalg.solve(one + g * feedback[:, None, :], g) for g in responses]
    mean = middle + sum(moved - middle for moved in others) / 3
    result: ComplexArray = mean @ np.linalg.inv(one - feedback[:, :, None] * mean) / with_floor(responses[0])
    return result
