"""How derivatives for the numbers of a body turn as these move: torques are linear in its ten inertial parameters.

A mass times a centre of mass is a moment, and adds to the moments of inertia about the joint: derivatives for masses,
centres and moments about the centre hold next to where they were taken only. In the barycentric parameters (mass, first
moments, moments of inertia about the body's frame) a motion's torque is linear (C. G. Atkeson, C. H. An, J. M.
Hollerbach, Estimation of inertial parameters of manipulator loads and links, 1986), so that derivatives elsewhere are
those that were taken, times a matrix of each body.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np
import scipy

from robid_core.arrays import FloatArray
from robid_core.parameters import FreeParameters
from robid_core.robot.file.parameter_places import MOMENTS


def turned_derivatives(
    free: FreeParameters, point: FloatArray, fixed: Collection[int] = ()
) -> Callable[[FloatArray], FloatArray]:
    """Return what turns derivatives that were taken at a point into those at another one.

    Bodies of which numbers are held, and points without moments about their centre, are left alone: their derivatives
    are those of the point.

    Parameters
    ----------
    free, point
        The free parameters and their coordinates, (n,).
    fixed
        Numbers of parameters whose derivatives are the same everywhere; so are those of their bodies.

    Returns
    -------
    Callable
        Given other coordinates (n,), a matrix (n, n): derivatives there are those at the point times it.
    """
    rows = [own for own in _whole_bodies(free) if not set(own) & set(fixed)]
    inverse = [np.linalg.inv(one) for one in _slopes(free, point, rows)]

    def turned(other: FloatArray) -> FloatArray:
        result = np.eye(len(free.names))
        for own, before, after in zip(rows, inverse, _slopes(free, other, rows), strict=True):
            result[np.ix_(own, own)] = before @ after
        return result

    return turned


def _whole_bodies(free: FreeParameters) -> list[list[int]]:
    """Numbers of mass, centre of mass and moments of each body of which all ten are free, but of points."""
    index = {name: i for i, name in enumerate(free.names)}
    found = []
    for joint in (joint for joint, root in free.root.items() if root.any()):
        names = (
            f"mass.{joint}",
            *(f"centre_of_mass.{joint}.{axis}" for axis in "xyz"),
            *(f"inertia.{joint}.{moment}" for moment in MOMENTS),
        )
        if all(name in index for name in names):
            found.append([index[name] for name in names])
    return found


def _slopes(free: FreeParameters, point: FloatArray, rows: list[list[int]]) -> list[FloatArray]:
    """Derivatives of the barycentric parameters of each body for its coordinates, (10, 10)."""
    if not rows:
        return []
    values, slope = free.values(point), free.jacobian(point)
    found = []
    for own in rows:
        mass, *rest = (values[free.names[i]] for i in own)
        found.append(_barycentric(mass, np.array(rest[:3])) @ slope[np.ix_(own, own)])
    return found


def _barycentric(mass: float, centre: FloatArray) -> FloatArray:
    """Derivatives of (m, m c, I + m (c c E - c c^T)) for (m, c, I), (10, 10)."""
    result = scipy.linalg.block_diag(1.0, mass * np.eye(3), np.eye(6))
    result[1:4, 0] = centre
    unit = np.eye(3)
    steiner = centre @ centre * unit - np.outer(centre, centre)
    for row, entry in enumerate(MOMENTS.values(), start=4):
        result[row, 0] = steiner[entry]
        for k in range(3):
            change = 2 * centre[k] * unit - np.outer(unit[k], centre) - np.outer(centre, unit[k])
            result[row, 1 + k] = mass * change[entry]
    return np.asarray(result, dtype=np.float64)
