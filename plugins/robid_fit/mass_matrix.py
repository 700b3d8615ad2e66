"""Whether estimated inertias belong to any robot: the mass matrix at the motors must be positive wherever it was.

Least squares know nothing of that; a robot whose matrix is not positive gains energy from being accelerated, and its
simulation diverges.
"""

from __future__ import annotations

import numpy as np

from robid_core import Doubt, FloatArray, Robot
from robid_fit.rigid_model import RigidMotion, torque_columns

MOST_POSES = 50  # of a record; a motion that shows inertias visits its extremes often


def mass_matrix(robot: Robot, value: FloatArray, position: FloatArray) -> FloatArray:
    """Mass matrix at the motors: column j is the torque of a unit acceleration of motor j, less that of none.

    Parameters
    ----------
    robot
        Geometry and gears; without elastic coordinates.
    value
        A value for every column of `torque_columns`, shape (n_parameter,).
    position
        Of the motors, rad, shape (n_pose, n_axis).

    Returns
    -------
    Shape (n_pose, n_axis, n_axis), kg m^2 at the shafts.
    """
    n_pose, n_axis = position.shape
    acceleration = np.repeat(np.vstack([np.zeros(n_axis), np.eye(n_axis)]), n_pose, axis=0)
    repeated = np.tile(position, (n_axis + 1, 1))
    motion = RigidMotion(repeated, np.zeros_like(repeated), acceleration)
    torque = torque_columns(robot, motion, robot.drives.friction_speed).regressor @ value
    rest, *columns = torque.reshape(n_axis + 1, n_pose, n_axis)
    return np.stack([column - rest for column in columns], axis=2)


def mass_matrix_doubts(robot: Robot, value: FloatArray, position: FloatArray) -> tuple[Doubt, ...]:
    """Doubt estimates with which the mass matrix is not positive in some pose of the motion; see `mass_matrix`."""
    poses = position[:: -(-len(position) // MOST_POSES)]
    wrong = np.linalg.eigvalsh(mass_matrix(robot, value, poses))[:, 0] <= 0
    if not wrong.any():
        return ()
    sentence = (
        f"the estimated mass matrix is not positive in {wrong.sum()} of {len(poses)} poses of the motion"
    )
    remedy = (
        "check the sign of torque and position, record motions with more acceleration, or hold what they do not "
        "show (unknowns)"
    )
    return (Doubt("mass matrix", sentence, remedy),)
