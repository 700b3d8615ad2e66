"""What the coordinates of free parameters change of a robot's mechanism, by differences of its numbers alone.

Numbers of a mechanism follow from parameters without any mechanics: a central difference of 1e-5 in natural scales is
exact to some 1e-11, and costs two descriptions.
"""

from __future__ import annotations

from collections.abc import Sequence

from robid_core.arrays import FloatArray
from robid_core.mechanics.change import MechanismChange
from robid_core.parameters.free import FreeParameters
from robid_core.robot import Robot

STEP = 1e-5  # in natural scales
OF_CHAIN = ("mass", "centre_of_mass", "inertia")


def mechanism_change(
    free: FreeParameters, robot: Robot, point: FloatArray, index: Sequence[int]
) -> MechanismChange:
    """Return the tangents of the numbers of a robot's mechanism.

    Parameters
    ----------
    free
        The parameters.
    robot
        On which they are set, of as many coordinates wherever they are.
    point
        Their coordinates, shape (n_free,).
    index
        Numbers of the parameters that are asked for: the rows.

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> robot = robid.Robot.load("one_axis")
    >>> free = robid.FreeParameters.of_robot(robot, ["gear_stiffness.axis_1", "gear_damping.axis_1"])
    >>> change = robid.mechanism_change(free, robot, np.zeros(2), [0, 1])
    >>> change.stiffness.round(1).tolist()  # of the spring, to the logarithm of each
    [[80000.0], [0.0]]
    """
    here = free.set_on(robot, point)
    values, known = free.values(point), here.layout
    found = MechanismChange.none(here.mechanism, len(index))
    for row, i in enumerate(index):
        for step in (STEP, -STEP):
            moved = point.copy()
            moved[i] += step
            other = {
                name: value
                for name, value in free.values(moved).items()
                if value != values[name] and name in known
            }
            for name, value in _numbers(here.with_parameters(other)).items():
                getattr(found, name)[row] += value / (2 * step)
    return found


def _numbers(robot: Robot) -> dict[str, FloatArray]:
    """Return the numbers of a robot that a change of its mechanism knows."""
    mechanism = robot.mechanism
    stiffness, damping = robot.spring_arrays()
    return {
        **{name: getattr(mechanism.chain, name) for name in OF_CHAIN},
        "rotor_inertia": mechanism.rotor_inertia,
        "gear": mechanism.gear,
        "stiffness": stiffness,
        "damping": damping,
        "motor_damping": robot.drives.viscous,
    }
