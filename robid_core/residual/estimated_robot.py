"""The robot that a torque fit found: its friction as a robot file can say it, the rest as it was estimated.

A fit has functions of speed beside viscous friction, and what is viscous among them only their sum tells. A robot file
has four numbers of friction, which are those nearest to that sum (`estimation/torque/nearest_friction.py`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import scipy

from robid_core.arrays import FloatArray
from robid_core.artifacts import Model
from robid_core.estimation.torque.nearest_friction import NearestFriction, nearest_friction
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.parameters import FreeParameters
from robid_core.residual.problem import friction_columns
from robid_core.robot import Robot

NOT_NEGATIVE = (".coulomb", ".viscous")


def friction_of_motors(
    robot: Robot,
    speeds: Sequence[FloatArray],
    laws: SpeedFunctions,
    free: FreeParameters,
    point: FloatArray,
    covariance: FloatArray,
    held: Collection[str] = (),
) -> tuple[NearestFriction, ...]:
    """Return the friction of each motor, nearest to the functions of speed that a fit found.

    Parameters
    ----------
    robot
        The robot that the fit was given.
    speeds
        Of each motor, as they were measured where it counts, rad/s, (n_sample,) each (`TorqueProblem.speeds`).
    laws
        Functions of speed.
    free
        The parameters that were free.
    point, covariance
        The unknowns that were found: coordinates of the free parameters, coefficients of the functions of speed and
        of a constant torque (N m, axis by axis for each), others; (n_unknown,) and (n_unknown, n_unknown).
    held
        Parameters `friction.<axis>.speed` that stay as the robot has them.
    """
    unknown, spread = _in_own_units(free, point, covariance)
    of_motors, found = friction_columns(free, len(laws.names)), []
    for a, (axis, columns) in enumerate(zip(robot.axis_names, of_motors, strict=True)):
        found.append(
            nearest_friction(
                laws.of_axis(a),
                unknown[columns],
                spread[np.ix_(columns, columns)],
                speeds[a],
                float(robot.drives.friction_speed[a]),
                held=f"friction.{axis}.speed" in held,
            )
        )
    return tuple(found)


def estimated_robot(
    robot: Robot,
    laws: SpeedFunctions,
    free: FreeParameters,
    point: FloatArray,
    covariance: FloatArray,
    friction: Sequence[NearestFriction],
) -> Model:
    """What a torque fit gives back; arguments as of `friction_of_motors`, and what that returns.

    `robot` is the one that was told; widths that were held at other values are set, and not estimated.
    """
    unknown, spread = _in_own_units(free, point, covariance)
    rubbing = [f"friction.{axis}.viscous" for axis in robot.axis_names]
    rows = {name: np.eye(len(point))[i] for i, name in enumerate(free.names) if name not in rubbing}
    values = {name: float(row @ unknown) for name, row in rows.items()}
    of_motors, own = friction_columns(free, len(laws.names)), np.zeros((0, 0))
    for a, (axis, one, columns) in enumerate(zip(robot.axis_names, friction, of_motors, strict=True)):
        for kind, value, slope in zip(one.names, one.value.tolist(), one.slope, strict=True):
            name = f"friction.{axis}.{kind}"
            values[name] = max(value, 0.0) if name.endswith(NOT_NEGATIVE) else value
            rows[name] = np.zeros(len(point))
            rows[name][columns] = slope
        own = scipy.linalg.block_diag(own, one.beyond)
        if one.width != robot.drives.friction_speed[a]:
            values.setdefault(f"friction.{axis}.speed", one.width)  # of laws that hold another one
    mapped = np.stack(list(rows.values()))
    total: FloatArray = mapped @ spread @ mapped.T
    total[len(total) - len(own) :, len(total) - len(own) :] += own
    return robot.model(values, tuple(rows), total)


def _in_own_units(
    free: FreeParameters, point: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Unknowns, those of the robot in their own units instead of coordinates, and their covariance."""
    n = len(free.names)
    slope = np.eye(len(point))
    slope[:n, :n] = free.jacobian(point[:n])
    return np.concatenate((list(free.values(point[:n]).values()), point[n:])), slope @ covariance @ slope.T
