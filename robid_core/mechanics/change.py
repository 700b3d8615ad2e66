"""What some parameters change of a mechanism: the tangents of its numbers, one row a parameter.

Derivatives of linear models are taken along these rows, so that whoever takes them need not know what a parameter is:
the mass of a body, a moment of it in some other scale, a payload that changes three numbers at once.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.mechanics.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class MechanismChange:
    """Derivatives of a mechanism's numbers and of its springs', shape (n_change, ...)."""

    mass: FloatArray
    """Of `Chain.mass`, (n_change, n_joint)."""
    centre_of_mass: FloatArray
    """(n_change, n_joint, 3)."""
    inertia: FloatArray
    """(n_change, n_joint, 3, 3)."""
    rotor_inertia: FloatArray
    """(n_change, n_axis)."""
    gear: FloatArray
    """Of the matrix `Mechanism.gear`, (n_change, n_axis, n_axis)."""
    stiffness: FloatArray
    """Of the springs, (n_change, n_spring)."""
    damping: FloatArray
    """Of the dampers, (n_change, n_spring)."""
    motor_damping: FloatArray
    """Viscous, at the motor shafts, (n_change, n_axis)."""

    @classmethod
    def none(cls, mechanism: Mechanism, count: int) -> Self:
        """Return `count` rows of zeros, to be written into."""
        n_axis, n_joint, n_spring = mechanism.n_axis, mechanism.chain.n_coordinate, mechanism.n_spring
        shapes = {
            "mass": (n_joint,),
            "centre_of_mass": (n_joint, 3),
            "inertia": (n_joint, 3, 3),
            "rotor_inertia": (n_axis,),
            "gear": (n_axis, n_axis),
            "stiffness": (n_spring,),
            "damping": (n_spring,),
            "motor_damping": (n_axis,),
        }
        return cls(**{name: np.zeros((count, *shape)) for name, shape in shapes.items()})

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self.mass)

    def rows(self, index: IntArray) -> Self:
        """Return some of the rows."""
        return replace(self, **{field.name: getattr(self, field.name)[index] for field in fields(self)})

    def of_mechanism(self) -> IntArray:
        """Return the numbers of the rows that change bodies, rotors or gears, not only springs and dampers."""
        names = ("mass", "centre_of_mass", "inertia", "rotor_inertia", "gear")
        parts = [getattr(self, name) for name in names]
        return np.flatnonzero(np.any([part.any(axis=tuple(range(1, part.ndim))) for part in parts], axis=0))

    def moved(self, mechanism: Mechanism, row: int, step: float) -> Mechanism:
        """Return the mechanism some way along a row; bodies are not checked, the way being that of a difference."""
        chain = copy.copy(mechanism.chain)
        for name in ("mass", "centre_of_mass", "inertia"):
            object.__setattr__(chain, name, getattr(chain, name) + step * getattr(self, name)[row])
        if not self.gear[row].any() and not self.rotor_inertia[row].any():
            return mechanism.with_bodies(chain)
        gear = mechanism.gear + step * self.gear[row]
        return replace(
            mechanism,
            chain=chain,
            gear=gear,
            rotor_inertia=mechanism.rotor_inertia + step * self.rotor_inertia[row],
        )
