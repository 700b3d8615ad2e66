"""An elastic structure as finite elements give it: mass and stiffness matrix, and where the nodes are.

Six degrees of freedom a node, ``[ux uy uz rx ry rz]``: displacement in m and small rotation in rad, axes of the node
coordinates. Degree of freedom d of node k is row ``6 k + d``. Matrices are numpy arrays or scipy.sparse ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError

Matrix = Any  # numpy array or scipy.sparse array

_SYMMETRY = 1e-6  # relative to the diagonals: what a text file with seven digits leaves
_DEFINITE = 1e-6  # eigenvalue of the matrix scaled to unit diagonal: rounding of seven digits over some tens of entries
_DOFS = ("ux", "uy", "uz", "rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class Structure:
    """Mass, stiffness and nodes of a linear elastic structure; matrices are stored exactly symmetric.

    Raises
    ------
    ConfigurationError
        Where a size does not fit, a number is not finite, a matrix is not symmetric or not positive semidefinite.
    """

    mass: Matrix
    """kg, kg m, kg m^2, shape (6 n_node, 6 n_node)."""
    stiffness: Matrix
    """N/m, N, N m, same shape."""
    nodes: FloatArray
    """m, shape (n_node, 3)."""
    name: str = "structure"
    """Where it came from, for messages."""

    def __post_init__(self) -> None:
        nodes = np.array(self.nodes, dtype=np.float64)
        if nodes.ndim != 2 or nodes.shape[1] != 3 or not len(nodes) or not np.isfinite(nodes).all():
            raise ConfigurationError(
                f"{self.name}: nodes need shape (n_node, 3) and finite numbers, they have shape {nodes.shape}"
            )
        object.__setattr__(self, "nodes", nodes)
        for label, letter in (("mass", "M"), ("stiffness", "K")):
            where = f"{self.name}: {label} matrix {letter}"
            given = _as_matrix(getattr(self, label), where)
            n = 6 * len(nodes)
            if given.shape != (n, n):
                raise ConfigurationError(
                    f"{where} has shape {given.shape}, but {len(nodes)} nodes with 6 degrees of freedom each need "
                    f"({n}, {n}); {_size_hint(given.shape, len(nodes))}"
                )
            object.__setattr__(self, label, symmetric(given, where))
            check_semidefinite(getattr(self, label), where)

    @property
    def n_node(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    def check_node(self, node: int, use: str) -> int:
        """Return a node number, or refuse one that is not there; `use` says what it is for."""
        if not 0 <= node < self.n_node:
            raise ConfigurationError(
                f"{self.name}: {use} node {node}: there are nodes 0 to {self.n_node - 1} (counted from 0)"
            )
        return int(node)

    def rigid_motion(self, about: npt.ArrayLike) -> FloatArray:
        """Displacement of every degree of freedom in the six rigid-body motions.

        Parameters
        ----------
        about
            Point of reference in m, shape (3,).

        Returns
        -------
        Columns: rotations about x, y, z through the point, then translations; shape (6 n_node, 6).
        """
        lever = self.nodes - np.asarray(about, dtype=np.float64)
        motion = np.zeros((self.n_node, 6, 6))
        motion[:, :3, :3] = np.cross(np.eye(3)[None], lever[:, None]).transpose(0, 2, 1)
        motion[:, 3:, :3] = np.eye(3)
        motion[:, :3, 3:] = np.eye(3)
        return motion.reshape(-1, 6)

    def stretching_motion(self, about: npt.ArrayLike) -> FloatArray:
        """Displacements ``(r_a e_b + r_b e_a) / 2`` from a point, for (a, b) = xx yy zz xy xz yz; shape (6 n_node, 6).

        A symmetric linear field turns nothing, so the rotations are 0. Its inner product with a mode, in the metric of
        the mass, is that mode's first-order change of the moments of mass: of beam elements, whose nodes do not tell
        how sections are stretched, up to (radius of gyration / length)^2 and (element / length)^2 / 17.
        """
        lever = self.nodes - np.asarray(about, dtype=np.float64)
        motion = np.zeros((self.n_node, 6, 6))
        for column, (a, b) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
            motion[:, b, column] += lever[:, a] / 2
            motion[:, a, column] += lever[:, b] / 2
        return motion.reshape(-1, 6)


def degree_of_freedom(row: int) -> str:
    """Name of a row: 'rz of node 3'."""
    return f"{_DOFS[row % 6]} of node {row // 6}"


def symmetric(matrix: Matrix, where: str) -> Matrix:
    """Return the symmetric part of a matrix that is symmetric up to rounding, or refuse it."""
    diagonal = np.sqrt(abs(matrix.diagonal()))
    skew = scipy.sparse.coo_array(matrix - matrix.T)
    scale = diagonal[skew.row] * diagonal[skew.col]
    limit = _SYMMETRY * np.maximum(scale, _SYMMETRY * diagonal.max(initial=0) ** 2)
    wrong = np.flatnonzero(abs(skew.data) > limit)
    if len(wrong):
        i, j = int(skew.row[wrong[0]]), int(skew.col[wrong[0]])
        raise ConfigurationError(
            f"{where} is not symmetric: [{i}, {j}] ({degree_of_freedom(i)}, {degree_of_freedom(j)}) differs from "
            f"[{j}, {i}] by {abs(skew.data[wrong[0]]):.3g}; was only one triangle exported?"
        )
    return (matrix + matrix.T) / 2


def check_semidefinite(matrix: Matrix, where: str) -> None:
    """Refuse a symmetric matrix with a negative eigenvalue.

    The matrix is scaled to a unit diagonal and shifted by `_DEFINITE`; a Cholesky factor exists, or it is indefinite.
    """
    diagonal = matrix.diagonal()
    if (diagonal < 0).any():
        row = int(np.argmin(diagonal))
        raise ConfigurationError(
            f"{where} is not positive semidefinite: {diagonal[row]:.3g} on the diagonal ({degree_of_freedom(row)})"
        )
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    if not is_definite(scaled(matrix, scale), _DEFINITE):
        raise ConfigurationError(
            f"{where} is not positive semidefinite: it has a negative eigenvalue; is the sign convention the same in "
            "all rows, and is it the whole matrix?"
        )


def scaled(matrix: Matrix, scale: FloatArray) -> Matrix:
    """Rows and columns times the scale."""
    if scipy.sparse.issparse(matrix):
        diagonal = scipy.sparse.diags_array(scale)
        return diagonal @ matrix @ diagonal
    return matrix * np.outer(scale, scale)


def is_definite(matrix: Matrix, shift: float = 0.0) -> bool:
    """Whether a symmetric matrix plus a multiple of the unit matrix is positive definite.

    Sparse: symmetric elimination without exchanging rows; the pivots have the signs of the eigenvalues (Sylvester).
    """
    if not scipy.sparse.issparse(matrix):
        try:
            scipy.linalg.cholesky(matrix + shift * np.eye(len(matrix)), lower=True)
        except np.linalg.LinAlgError:
            return False
        return True
    try:
        factor = scipy.sparse.linalg.splu(
            scipy.sparse.csc_array(matrix + shift * scipy.sparse.eye_array(matrix.shape[0])),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:  # a pivot is exactly zero
        return False
    in_place = np.array_equal(factor.perm_r, factor.perm_c)
    return bool(in_place and (factor.U.diagonal() > 0).all())


def _as_matrix(value: Any, where: str) -> Matrix:
    if scipy.sparse.issparse(value):
        value = scipy.sparse.csr_array(value, dtype=np.float64)
        entries = value.data
    else:
        try:
            entries = value = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise ConfigurationError(f"{where} is not a matrix of real numbers") from None
        if value.ndim != 2:
            raise ConfigurationError(f"{where} has {value.ndim} dimensions; a matrix has two")
    if not np.isfinite(entries).all():
        raise ConfigurationError(f"{where} holds a number that is not finite")
    return value


def _size_hint(shape: tuple[int, ...], n_node: int) -> str:
    if shape == (3 * n_node,) * 2:
        return "it has 3 a node: add the rotations of the interface nodes"
    if shape[0] < 6 * n_node:
        return "are rows of constrained degrees of freedom left out, or nodes listed that no element uses?"
    return "are nodes missing from the list?"
