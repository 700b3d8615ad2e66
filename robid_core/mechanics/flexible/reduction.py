"""Fewer degrees of freedom: a structure seen from its interface nodes (thesis section 2.6).

The inner displacement is written as ``u_i = G u_b + Phi q``: G, the static answer of the inside to the interface,
``G = -K_ii^-1 K_ib`` (R. J. Guyan, AIAA J. 3, 1965; B. M. Irons, AIAA J. 3, 1965), and Phi, modes with the interface
held fixed, ``K_ii Phi = M_ii Phi w^2`` (R. R. Craig, M. C. C. Bampton, AIAA J. 6, 1968). Rigid motion and static
answers to interface loads are exact; frequencies can only come out too high (Rayleigh and Ritz).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.flexible.structure import (
    Matrix,
    Structure,
    degree_of_freedom,
    is_definite,
    scaled,
)

_MASSLESS = 1e-13  # 1 / w^2 relative to the lowest mode, below which a fixed-interface mode carries no mass
_FREE = (
    1e-14  # eigenvalue of the inner stiffness scaled to unit diagonal; rounding leaves some 1e-16 of a zero
)
_DENSE = 600  # inner degrees of freedom up to which eigenvalues are computed densely


@dataclass(frozen=True, eq=False)
class Reduction:
    """Reduced matrices; coordinates are six per interface node, as in `Structure`, then the fixed-interface modes."""

    mass: FloatArray
    """(n_reduced, n_reduced), n_reduced = 6 n_interface + n_mode."""
    stiffness: FloatArray
    """Same shape."""
    transformation: FloatArray
    """Displacement of all degrees of freedom = transformation @ reduced coordinates, (n_dof, n_reduced)."""
    interface: tuple[int, ...]
    """Nodes that were kept, in the order of the coordinates."""
    fixed_frequency_hz: FloatArray
    """Of the modes with the interface held fixed, (n_mode,)."""


def guyan(structure: Structure, interface: Sequence[int]) -> Reduction:
    """Static reduction to interface nodes; arguments and errors as `craig_bampton`, without modes."""
    return craig_bampton(structure, interface, 0)


def craig_bampton(structure: Structure, interface: Sequence[int], n_mode: int) -> Reduction:
    """Reduction to interface nodes and the lowest modes with the interface held fixed.

    Degrees of freedom with neither stiffness nor mass (rotations of solid elements) are left out and stay 0.

    Parameters
    ----------
    structure
        Mass and stiffness.
    interface
        Nodes to keep, counted from 0, each once.
    n_mode
        Fixed-interface modes to keep, lowest first, normalised to unit modal mass.

    Raises
    ------
    ConfigurationError
        For an unknown node, one named twice, none at all, a mechanism left inside, or too many modes.
    """
    nodes = [structure.check_node(node, "interface") for node in interface]
    if not nodes or len(set(nodes)) < len(nodes):
        raise ConfigurationError(f"{structure.name}: interface nodes {nodes}; name at least one, each once")
    kept = (6 * np.array(nodes)[:, None] + np.arange(6)).ravel()
    inner = np.setdiff1d(_present(structure), kept)
    m, k = structure.mass, structure.stiffness
    solve = _solver(k[inner][:, inner], inner, structure.name)
    modes, frequency = _fixed_modes(k[inner][:, inner], m[inner][:, inner], n_mode, structure.name)
    transformation = np.zeros((m.shape[0], len(kept) + n_mode))
    transformation[kept, np.arange(len(kept))] = 1.0
    if len(inner):
        transformation[inner, : len(kept)] = -solve(_dense(k[inner][:, kept]))
        transformation[inner, len(kept) :] = modes
    reduced = [transformation.T @ (matrix @ transformation) for matrix in (m, k)]
    # rows of the modes against the interface are zero in exact arithmetic, and w^2 among themselves
    reduced[1][len(kept) :] = reduced[1][:, len(kept) :] = 0.0
    modal = np.arange(len(kept), len(kept) + n_mode)
    reduced[1][modal, modal] = (2 * np.pi * frequency) ** 2
    mass, stiffness = (np.asarray((matrix + matrix.T) / 2, dtype=np.float64) for matrix in reduced)
    return Reduction(mass, stiffness, transformation, tuple(nodes), frequency)


def _present(structure: Structure) -> npt.NDArray[np.intp]:
    """Degrees of freedom with stiffness or mass."""
    return np.flatnonzero((structure.stiffness.diagonal() != 0) | (structure.mass.diagonal() != 0))


def _dense(matrix: Matrix) -> FloatArray:
    return np.asarray(matrix.toarray() if scipy.sparse.issparse(matrix) else matrix, dtype=np.float64)


def _solver(stiffness: Matrix, inner: npt.NDArray[np.intp], name: str) -> Callable[[FloatArray], FloatArray]:
    """Solve with the inner stiffness, which must be positive definite."""
    if not len(inner):
        return lambda right: right
    diagonal = stiffness.diagonal()
    if not (diagonal > 0).all():
        loose = degree_of_freedom(int(inner[np.argmin(diagonal)]))
        raise ConfigurationError(
            f"{name}: {loose} has mass but no stiffness; add the stiffness that holds it"
        )
    scale = 1 / np.sqrt(diagonal)
    if not is_definite(scaled(stiffness, scale), -_FREE):
        raise ConfigurationError(
            f"{name}: with the interface nodes held fixed some of the structure is still free to move; are all parts "
            "connected to an interface node?"
        )
    if scipy.sparse.issparse(stiffness):
        factor = scipy.sparse.linalg.splu(scipy.sparse.csc_array(stiffness))
        return lambda right: np.asarray(factor.solve(right), dtype=np.float64)
    triangle = scipy.linalg.cho_factor(stiffness)
    return lambda right: np.asarray(scipy.linalg.cho_solve(triangle, right), dtype=np.float64)


def _fixed_modes(stiffness: Matrix, mass: Matrix, n_mode: int, name: str) -> tuple[FloatArray, FloatArray]:
    """Lowest modes with the interface fixed, and their frequencies in Hz."""
    n = stiffness.shape[0]
    if not 0 <= n_mode <= n:
        raise ConfigurationError(
            f"{name}: {n_mode} fixed-interface modes; there are {n} inner degrees of freedom, ask for 0 to {n}"
        )
    if n_mode == 0:
        return np.zeros((n, 0)), np.zeros(0)
    if scipy.sparse.issparse(stiffness) and n > _DENSE and n_mode < n // 4:
        start: Any = np.ones(n)  # ARPACK's own start is drawn at random
        square, modes = scipy.sparse.linalg.eigsh(
            scipy.sparse.csc_array(stiffness), n_mode, scipy.sparse.csc_array(mass), sigma=0.0, v0=start
        )
        order = np.argsort(square)
        inverse, modes = 1 / square[order], modes[:, order]
    else:  # M x = mu K x with mu = 1 / w^2: K has an inverse, M need not have one
        inverse, modes = scipy.linalg.eigh(
            _dense(mass), _dense(stiffness), subset_by_index=(n - n_mode, n - 1)
        )
        inverse, modes = inverse[::-1], modes[:, ::-1]
    with_mass = inverse > _MASSLESS * inverse[0]
    if not with_mass.all():
        raise ConfigurationError(
            f"{name}: {n_mode} fixed-interface modes, but only {int(with_mass.sum())} carry mass; ask for fewer"
        )
    modes = modes / np.sqrt(np.einsum("ij,ij->j", modes, mass @ modes))
    modes = modes * np.sign(modes[np.argmax(abs(modes), axis=0), np.arange(n_mode)])
    return np.asarray(modes, dtype=np.float64), np.asarray(
        1 / (2 * np.pi * np.sqrt(inverse)), dtype=np.float64
    )
