"""Straight beams in space: their stiffness and mass per length, and finite elements for them.

Two nodes an element, twelve degrees of freedom: extension and torsion with linear shapes, two bendings with cubic
(Hermite) ones, consistent mass; no shear deformation (J. S. Przemieniecki, Theory of Matrix Structural Analysis,
1968, chapters 5 and 11). With `section_inertia` about y and z the beam is Rayleigh's, without it Euler and Bernoulli's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.flexible.structure import Structure


@dataclass(frozen=True)
class Beam:
    """A uniform beam along x from the origin; y and z are principal axes of its section.

    Raises
    ------
    ConfigurationError
        For a stiffness, mass or length that is not positive.
    """

    length: float
    """m."""
    mass_per_length: float
    """kg/m."""
    axial_stiffness: float
    """E A, N."""
    torsional_stiffness: float
    """G J, N m^2."""
    bending_stiffness: tuple[float, float]
    """E I about y (motion in z) and about z (motion in y), N m^2."""
    section_inertia: tuple[float, float, float]
    """Moment of inertia of the section per length about x, y, z, kg m^2/m; about y and z it may be 0."""

    def __post_init__(self) -> None:
        for name in (
            "length",
            "mass_per_length",
            "axial_stiffness",
            "torsional_stiffness",
            "bending_stiffness",
        ):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if not (np.isfinite(value) & (value > 0)).all():
                raise ConfigurationError(f"beam: {name} is {value.tolist()}; give a positive number")
        x, y, z = self.section_inertia
        if not (x > 0 and y >= 0 and z >= 0):
            raise ConfigurationError(
                f"beam: section_inertia is {self.section_inertia}; about x it is positive, about y and z not negative"
            )

    @property
    def mass(self) -> float:
        """Mass of the beam, kg."""
        return self.mass_per_length * self.length

    def inertia(self, length: float) -> FloatArray:
        """Inertia of a piece of the beam about its own centre, kg m^2, shape (3, 3)."""
        across = self.mass_per_length * length**3 / 12
        return np.diag(np.array(self.section_inertia) * length + [0.0, across, across])

    def structure(self, n_element: int, sparse: bool = False) -> Structure:
        """Finite elements of equal length; node 0 is the root, node `n_element` the tip.

        Parameters
        ----------
        n_element
            Number of elements, at least 1. A bending frequency comes out high by the fraction
            ``(wave number * element length)^4 / 1440``.
        sparse
            Whether the matrices are scipy.sparse ones.
        """
        if n_element < 1:
            raise ConfigurationError(f"beam: {n_element} elements; give at least 1")
        mass, stiffness = element_matrices(self, self.length / n_element)
        n = 6 * (n_element + 1)
        rows = 6 * np.arange(n_element)[:, None] + np.arange(12)
        place = (np.repeat(rows, 12, axis=1).ravel(), np.tile(rows, 12).ravel())
        whole = [
            scipy.sparse.coo_array((np.tile(element.ravel(), n_element), place), shape=(n, n)).tocsr()
            for element in (mass, stiffness)
        ]
        nodes = np.zeros((n_element + 1, 3))
        nodes[:, 0] = np.linspace(0, self.length, n_element + 1)
        first, second = whole if sparse else (matrix.toarray() for matrix in whole)
        return Structure(first, second, nodes, name=f"beam of {n_element} elements")


def hollow_square(
    length: float,
    side: float,
    wall: float,
    modulus: float = 2.1e11,  # Pa, steel
    poisson: float = 0.3,
    density: float = 7850.0,  # kg/m^3, steel
    rotary_inertia: bool = True,
) -> Beam:
    """Return a beam of hollow square section, of steel if nothing else is said.

    Area, second moments and, for a thin closed wall, Bredt's torsion constant ``wall * (side - wall)^3``.

    Parameters
    ----------
    length, side, wall
        m; side is the outer one.
    modulus, poisson, density
        Of the material, Pa, 1, kg/m^3.
    rotary_inertia
        Whether sections have inertia against bending (Rayleigh); without, a piece shorter than some 2.5 sides has an
        inertia that no body has.
    """
    if not 0 < wall < side / 2:
        raise ConfigurationError(
            f"beam: wall {wall:g} m of a square of {side:g} m; it is less than half of it"
        )
    inner = side - 2 * wall
    area, second = side**2 - inner**2, (side**4 - inner**4) / 12
    across = density * second if rotary_inertia else 0.0
    return Beam(
        length=length,
        mass_per_length=density * area,
        axial_stiffness=modulus * area,
        torsional_stiffness=modulus / (2 + 2 * poisson) * wall * (side - wall) ** 3,
        bending_stiffness=(modulus * second, modulus * second),
        section_inertia=(2 * density * second, across, across),
    )


def element_matrices(beam: Beam, length: float) -> tuple[FloatArray, FloatArray]:
    """Consistent mass and stiffness of one element, each (12, 12), in the order of `Structure`.

    Parameters
    ----------
    beam
        Stiffness and mass per length.
    length
        Of the element, m.
    """
    n = length
    mass, stiffness = np.zeros((12, 12)), np.zeros((12, 12))
    line = np.array([[2.0, 1.0], [1.0, 2.0]]) * n / 6
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]]) / n
    for dof, inertia, rigidity in (
        (0, beam.mass_per_length, beam.axial_stiffness),
        (3, beam.section_inertia[0], beam.torsional_stiffness),
    ):
        at = np.ix_([dof, dof + 6], [dof, dof + 6])
        mass[at] += inertia * line
        stiffness[at] += rigidity * spring
    moving = n / 420 * np.array(
        [
            [156, 22 * n, 54, -13 * n],
            [22 * n, 4 * n**2, 13 * n, -3 * n**2],
            [54, 13 * n, 156, -22 * n],
            [-13 * n, -3 * n**2, -22 * n, 4 * n**2],
        ]
    )  # fmt: skip
    turning = 1 / (30 * n) * np.array(
        [
            [36, 3 * n, -36, 3 * n],
            [3 * n, 4 * n**2, -3 * n, -(n**2)],
            [-36, -3 * n, 36, -3 * n],
            [3 * n, -(n**2), -3 * n, 4 * n**2],
        ]
    )  # fmt: skip
    bending = 1 / n**3 * np.array(
        [
            [12, 6 * n, -12, 6 * n],
            [6 * n, 4 * n**2, -6 * n, 2 * n**2],
            [-12, -6 * n, 12, -6 * n],
            [6 * n, 2 * n**2, -6 * n, 4 * n**2],
        ]
    )  # fmt: skip
    # in the plane of x and z a positive slope is a negative rotation about y
    for dofs, sign, inertia, rigidity in (
        ([1, 5, 7, 11], 1, beam.section_inertia[2], beam.bending_stiffness[1]),
        ([2, 4, 8, 10], -1, beam.section_inertia[1], beam.bending_stiffness[0]),
    ):
        signs = np.outer([1, sign, 1, sign], [1, sign, 1, sign])
        mass[np.ix_(dofs, dofs)] += signs * (beam.mass_per_length * moving + inertia * turning)
        stiffness[np.ix_(dofs, dofs)] += signs * rigidity * bending
    return mass, stiffness
