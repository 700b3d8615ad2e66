"""Flexible body from finite elements: reduce to root and tip, split off rigid motion, find the modes.

With T of the reduction, every displacement is ``R v + E eta``: R the six rigid motions about the root, E the columns of
T that hold the root still (six of the tip, and the fixed-interface modes). Since T holds rigid motion exactly, mass and
inertia are those of the whole structure, and the momentum of a mode is ``R^T M E``.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.flexible.body import FlexibleBody, body_of_shapes
from robid_core.mechanics.flexible.reduction import craig_bampton
from robid_core.mechanics.flexible.structure import Structure, degree_of_freedom

_FREE = 1e-6  # force of a rigid motion relative to the forces that cancel in it: seven digits in a text file
_RIGID = 1e-5  # of the rigid-body mass matrix


def flexible_body(
    structure: Structure, root: int, tip: int, n_fixed_mode: int = 0, damping_ratio: float = 0.01
) -> FlexibleBody:
    """Flexible body between two interface nodes, 6 + n_fixed_mode modes.

    Without fixed-interface modes this is Guyan's reduction: exact for loads at root and tip, too stiff for the inertia
    of the inside. `FlexibleBody.truncated` leaves out high modes.

    Parameters
    ----------
    structure
        A free structure: nothing clamped. The axes of its nodes become those of the root frame.
    root, tip
        Interface nodes, counted from 0.
    n_fixed_mode
        Fixed-interface modes (Craig and Bampton).
    damping_ratio
        Of every mode.

    Raises
    ------
    ConfigurationError
        If the stiffness resists rigid motion, or the mass is not that of a body; both come from other units, another
        order of degrees of freedom, or a structure that is still clamped.
    """
    if structure.check_node(root, "root") == structure.check_node(tip, "tip"):
        raise ConfigurationError(
            f"{structure.name}: root and tip are both node {root}; a link has two interfaces"
        )
    origin = structure.nodes[root]
    rigid = structure.rigid_motion(origin)
    _check_free(structure, rigid)
    reduction = craig_bampton(structure, (root, tip), n_fixed_mode)
    elastic = reduction.transformation[:, 6:]
    moved = structure.mass @ elastic
    mass, centre, inertia = rigid_properties(rigid.T @ (structure.mass @ rigid), structure.name)
    moments = structure.stretching_motion(origin).T @ moved
    return body_of_shapes(
        mass,
        centre,
        inertia,
        tip=structure.nodes[tip] - origin,
        tip_shapes=elastic[6 * tip + np.array([3, 4, 5, 0, 1, 2])],
        momentum=rigid.T @ moved,
        shape_mass=reduction.mass[6:, 6:],
        shape_stiffness=reduction.stiffness[6:, 6:],
        inertia_slope=inertia_of_moments(2 * moments),
        damping_ratio=damping_ratio,
    )


def rigid_properties(
    mass_matrix: FloatArray, name: str = "structure"
) -> tuple[float, FloatArray, FloatArray]:
    """Mass, centre of mass, and inertia about it, from the mass matrix of rigid motion.

    Parameters
    ----------
    mass_matrix
        Momentum [angular about the origin; linear] over velocity [angular; linear], shape (6, 6).
    name
        For the message.

    Raises
    ------
    ConfigurationError
        If the mass is not the same in all directions, or linear momentum does not turn with the body.
    """
    corner, moment = mass_matrix[3:, 3:], mass_matrix[:3, 3:]
    mass = float(np.trace(corner)) / 3
    size = np.sqrt(mass * np.trace(mass_matrix[:3, :3])) if mass > 0 else 0.0
    if (
        mass <= 0
        or abs(corner - mass * np.eye(3)).max() > _RIGID * mass
        or abs(moment + moment.T).max() > _RIGID * size
    ):
        along = ", ".join(f"{value:.6g}" for value in np.diag(corner))
        raise ConfigurationError(
            f"{name}: moved as a rigid body along x, y, z its mass is {along} kg; it must be the same and positive. "
            "Are the degrees of freedom ux uy uz rx ry rz node by node, and is the structure free?"
        )
    centre = np.array([moment[2, 1] - moment[1, 2], moment[0, 2] - moment[2, 0], moment[1, 0] - moment[0, 1]])
    centre = centre / (2 * mass)
    about = mass_matrix[:3, :3] - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return mass, centre, (about + about.T) / 2


def inertia_of_moments(moments: FloatArray) -> FloatArray:
    """Inertia from moments of mass ``sum m r_a r_b``, (a, b) = xx yy zz xy xz yz; shape (6, n) to (n, 3, 3)."""
    xx, yy, zz, xy, xz, yz = moments
    rows = ((yy + zz, -xy, -xz), (-xy, xx + zz, -yz), (-xz, -yz, xx + yy))
    return np.array(rows).transpose(2, 0, 1)


def _check_free(structure: Structure, rigid: FloatArray) -> None:
    force = abs(structure.stiffness @ rigid)
    size = abs(structure.stiffness) @ abs(rigid)
    worst = np.unravel_index(int(np.argmax(force - _FREE * size)), force.shape)
    if force[worst] > _FREE * size[worst]:
        motion = (
            "rotation about x",
            "rotation about y",
            "rotation about z",
            "motion along x",
            "motion along y",
            "motion along z",
        )
        raise ConfigurationError(
            f"{structure.name}: rigid {motion[int(worst[1])]} causes a force at {degree_of_freedom(int(worst[0]))}; a "
            "free structure gives none. Is it still clamped, are node coordinates in another unit than the "
            "matrices, or the degrees of freedom not ux uy uz rx ry rz node by node?"
        )
