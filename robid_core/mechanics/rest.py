"""Mass, weight and gravity stiffness of a robot that stands still, over its generalised coordinates.

The chain knows its joints q; with q = T z (see `Mechanism`) the force on z is ``T^T g(T z)``, its slope
``T^T (dg/dq) T``, the inertia ``T^T M T`` and the rotors'.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.compiled.kernel import kernel
from robid_core.mechanics.dynamics import Dynamics, dynamics
from robid_core.mechanics.mechanism import Mechanism


def rows_times(rows: FloatArray, matrix: FloatArray) -> FloatArray:
    """``rows @ matrix``, each row summed alone: the library's product rounds otherwise for another number of rows."""
    product: FloatArray = (rows[..., None, :] * matrix.T).sum(axis=-1)
    return product


def terms_at_rest(mechanism: Mechanism, position: FloatArray) -> Dynamics:
    """Mass matrix with rotors, gravity force and gravity stiffness.

    Parameters
    ----------
    mechanism
        Chain, gears and springs; the springs' forces are not counted.
    position
        Generalised coordinates, shape (..., n_coordinate).

    Returns
    -------
    Arrays over the generalised coordinates: (..., n_coordinate, n_coordinate), (..., n_coordinate) and again
    (..., n_coordinate, n_coordinate).
    """
    z = np.asarray(position)
    joint, coordinate = np.nonzero(mechanism.constraint_map)
    value = mechanism.constraint_map[joint, coordinate]
    terms = dynamics(
        mechanism.chain, rows_times(z, mechanism.constraint_map.T).reshape(-1, mechanism.chain.n_coordinate)
    )
    n, n_row, motors = mechanism.n_coordinate, len(terms.bias), np.arange(mechanism.n_axis)
    mass, force, stiffness = np.zeros((n_row, n, n)), np.zeros((n_row, n)), np.zeros((n_row, n, n))
    mass[:, motors, motors] = mechanism.rotor_inertia
    collect(joint, coordinate, value, terms.mass, terms.bias, terms.gravity_stiffness, mass, force, stiffness)
    return Dynamics(mass.reshape(*z.shape, n), force.reshape(z.shape), stiffness.reshape(*z.shape, n))


@kernel
def collect(joint, coordinate, value, mass, bias, stiffness, masses, forces, stiffnesses):  # type: ignore[no-untyped-def]
    """Add ``T^T M T``, ``T^T g`` and ``T^T (dg/dq) T`` of every row; T by its entries that are not zero."""
    for row in range(bias.shape[0]):
        for e in range(len(value)):
            i, p = joint[e], coordinate[e]
            forces[row, p] += value[e] * bias[row, i]
            for f in range(len(value)):
                j, q, product = joint[f], coordinate[f], value[e] * value[f]
                masses[row, p, q] += product * mass[row, i, j]
                stiffnesses[row, p, q] += product * stiffness[row, i, j]
