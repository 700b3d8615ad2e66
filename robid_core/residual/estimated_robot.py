"""The robot that a torque fit found: its friction as a robot file can say it, the rest as it was estimated.

A robot file has ``coulomb tanh(v / speed) + viscous v + offset``; the fit has functions of speed beside the viscous
part, and what is viscous among them only their sum tells. The file's numbers are those nearest to that sum over the
measured speeds, by least squares; `speed` stays the file's. This is a linear map, by which the covariance goes, too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import Model
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.parameters import FreeParameters
from robid_core.robot import Robot


def estimated_robot(
    robot: Robot,
    motions: Sequence[MotionSpectra],
    laws: SpeedFunctions,
    free: FreeParameters,
    point: FloatArray,
    covariance: FloatArray,
) -> Model:
    """What a torque fit gives back.

    Parameters
    ----------
    robot
        The robot that the fit was given.
    motions
        What was measured, block by block.
    laws
        Functions of speed.
    free
        The parameters that were free.
    point, covariance
        The unknowns that were found: coordinates of the free parameters, coefficients of the functions of speed and
        of a constant torque (N m, axis by axis for each), delays; (n_unknown,) and (n_unknown, n_unknown).
    """
    n, n_axis = len(free.names), robot.n_axis
    slope = np.eye(len(point))
    slope[:n, :n] = free.jacobian(point[:n])
    unknown = np.concatenate((list(free.values(point[:n]).values()), point[n:]))
    place = {name: i for i, name in enumerate(free.names)}
    rubbing = [f"friction.{axis}.viscous" for axis in robot.axis_names]
    rows = {name: np.eye(len(point))[i] for name, i in place.items() if name not in rubbing}
    coefficients = n + np.arange(len(laws.names) * n_axis).reshape(-1, n_axis)
    speed = np.concatenate([motion.rate(1).reshape(-1, n_axis) for motion in motions])
    for a, axis in enumerate(robot.axis_names):
        viscous = place.get(rubbing[a])
        columns = [*coefficients[:, a], viscous] if viscous is not None else [*coefficients[:, a]]
        share = shares(
            speed[:, a], laws.of_axis(a), float(robot.drives.friction_speed[a]), viscous is not None
        )
        for kind, row in zip(("coulomb", "offset", "viscous"), share, strict=False):
            rows[f"friction.{axis}.{kind}"] = np.zeros(len(point))
            rows[f"friction.{axis}.{kind}"][columns] = row
    mapped = np.stack(list(rows.values()))
    values = {
        name: max(value, 0.0) if name.endswith((".coulomb", ".viscous")) else value
        for name, value in zip(rows, (mapped @ unknown).tolist(), strict=True)
    }
    spread: FloatArray = mapped @ slope @ covariance @ slope.T @ mapped.T
    return robot.model(values, tuple(rows), spread)


def shares(speed: FloatArray, laws: SpeedFunctions, friction_speed: float, viscous: bool) -> FloatArray:
    """What each function of speed adds to a robot file's friction, by least squares over the measured speeds.

    Parameters
    ----------
    speed
        Of one motor, rad/s, shape (n_sample,).
    laws
        Functions of speed, of this motor.
    friction_speed
        Of ``tanh(v / speed)`` in the robot file.
    viscous
        Whether viscous friction is free: it is then told anew, else it is held.

    Returns
    -------
    Rows coulomb, offset (and viscous); columns the functions, a constant (and a viscous part): (2, n_law + 1), or (3,
    n_law + 2).
    """
    extra = [speed] if viscous else []
    told = np.stack([np.tanh(speed / friction_speed), np.ones_like(speed), *extra])
    rubbing = [told @ torque[:, 0] for torque in laws.along(speed[:, None])]
    gram = told @ told.T
    result: FloatArray = np.linalg.solve(gram, np.stack([*rubbing, *gram[:, 1:].T], axis=1))
    return result
