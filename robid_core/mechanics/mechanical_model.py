"""What torques act on: mechanism, springs, dampers and laws of a robot, and how they lie in memory for the loops.

Inside the loops, motors come *after* the other coordinates, so that eliminating from the last one up takes them
first: each touches few others. Robots whose `structure` is alike may stand side by side (see `chain_arrays`).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.compiled.memory import in_lanes, padded_rows
from robid_core.mechanics.chain import REVOLUTE
from robid_core.mechanics.chain_arrays import OF_STRUCTURE, numbers_of_chain
from robid_core.mechanics.dynamics import dynamics
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.terms import ForceTerm

POSES = 32  # in which the mobility of springs is looked at


@dataclass(frozen=True, eq=False)
class MechanicalModel:
    """A robot without controller and sensors."""

    mechanism: Mechanism
    stiffness: FloatArray
    """Of the springs, N m/rad, shape (n_spring,)."""
    damping: FloatArray
    """N m s/rad, shape (n_spring,)."""
    forces: tuple[ForceTerm, ...] = ()
    """Laws that act."""

    @property
    def structure(self) -> tuple[Any, ...]:
        """What robots must have in common to stand side by side: joints, gears, laws; not their numbers."""
        mechanism, chain = self.mechanism, self.mechanism.chain
        tree = numbers_of_chain(chain).tree[:, OF_STRUCTURE]
        places = (mechanism.arm, mechanism.elastic, mechanism.elastic_gear)
        return (
            mechanism.coordinate_names,
            tree.tobytes(),
            *(place.tobytes() for place in places),
            *((id(term.law), term.n_state, np.size(term.arguments), term.label) for term in self.forces),
        )


class PlantArrays(NamedTuple):
    """Mechanisms but for their chains: structure, and numbers as `in_lanes` lays them."""

    joint_column: (
        IntArray  # (n_joint, n_entry) where row j of T is not zero, filled up with column 0, value 0
    )
    joint_value: FloatArray
    spring_start: IntArray  # (n + 1,) first entry of each row of the spring matrix in the next two
    spring_column: IntArray  # (n_entry,)
    spring_value: FloatArray  # (n_entry, 2) of sum k_s e_s e_s^T, and of the dampers likewise
    constant: FloatArray  # (n, n) rotors, and springs and dampers as the implicit step adds them to the mass
    coupled: IntArray  # (n_entry, 2) where its lower triangle behind the motors is not zero
    fill: IntArray  # (n_axis, 1 + n) number and list of the coordinates before a motor that its elimination touches
    gear_column: (
        IntArray  # (n_axis, n_entry) row of the deflection of each elastic gear, filled up as joint_column
    )
    gear_value: FloatArray
    gear_spring: FloatArray  # (n_axis, 2) its stiffness and damping
    rigid_column: IntArray  # (n_axis, n_entry) torque of a rigid gear from (drive torque - rotor inertia x
    # acceleration)
    rigid_value: FloatArray
    rotor_inertia: FloatArray  # (n_axis,)


def motors_last(mechanism: Mechanism) -> IntArray:
    """Order of the coordinates inside the loop: internal coordinate i is coordinate order[i] of the mechanism."""
    return np.roll(np.arange(mechanism.n_coordinate), -mechanism.n_axis)


def spring_weights(mechanism: Mechanism, stiffness: FloatArray, implicit_step: float) -> FloatArray:
    """Share of each spring in the implicit step, s^2, shape (n_spring,): h^2 (1/4 - a), with a as near 1/6 as
    is stable.

    The midpoint rule (a = 0) swings at (2 / h) arctan(w h / 2); with a = 1/6 what the sampled angles show of elastic
    motion is of fourth order (L. Fox, E. T. Goodwin, 1949; Newmark's method with beta = 1/12), stable while
    ``h^2 sum a k e^T M^-1 e`` is below one. The sum is kept at one half at most, over poses drawn once: stiff
    springs and light bodies go back to the midpoint rule, which is stable for any.
    """
    if implicit_step == 0.0 or not len(stiffness):
        return np.zeros(len(stiffness))
    springs = mechanism.spring_directions
    mobility = np.einsum("si,rij,sj->rs", springs, _inverse_masses(mechanism), springs).max(axis=0)
    stiff = implicit_step**2 * stiffness * mobility
    a = np.minimum(1 / 6, 1 / (2 * len(stiffness) * np.maximum(stiff, np.finfo(float).tiny)))
    weight: FloatArray = implicit_step**2 * (0.25 - a)
    return weight


@functools.lru_cache(maxsize=32)
def _inverse_masses(mechanism: Mechanism) -> FloatArray:
    """Inverse mass matrices (n_pose, n, n) at the straight pose and poses drawn once for all."""
    n_joint = mechanism.chain.n_coordinate
    pose = np.random.default_rng(0).uniform(-np.pi, np.pi, (POSES, n_joint))
    pose[0] = 0.0
    pose[:, [int(j) for j in mechanism.elastic]] = 0.0  # what a spring holds hardly moves
    pose[:, mechanism.chain.joint_type != REVOLUTE] = 0.0
    joints, motors = mechanism.constraint_map, np.arange(mechanism.n_axis)
    mass = joints.T @ dynamics(mechanism.chain, pose).mass @ joints
    mass[:, motors, motors] += mechanism.rotor_inertia
    inverse = np.linalg.pinv(mass, hermitian=True)  # a massless coordinate has no say
    return np.asarray(inverse, dtype=np.float64)


def plant_arrays(
    models: Sequence[MechanicalModel], robots: IntArray, implicit_step: float, weights: Sequence[FloatArray]
) -> PlantArrays:
    """Lay robots of one structure out for the loop; `implicit_step` is 0 for an explicit method.

    `weights` are the `spring_weights` of that step, `robots` as of `in_lanes`.
    """
    first = models[0].mechanism
    n_axis, n, n_joint, order = first.n_axis, first.n_coordinate, first.chain.n_coordinate, motors_last(first)
    motors = np.arange(n - n_axis, n)
    joints = np.stack([model.mechanism.constraint_map[:, order] for model in models])
    springs = np.stack([model.mechanism.spring_directions[:, order] for model in models])
    rotors = np.stack([model.mechanism.rotor_inertia for model in models])
    stiffness = np.stack([model.stiffness for model in models])
    damping, weight = np.stack([model.damping for model in models]), np.stack(weights)
    turned = springs.swapaxes(1, 2)
    constant = (turned * (weight * stiffness + implicit_step / 2 * damping)[:, None]) @ springs
    constant[:, motors, motors] += rotors
    reach = (joints != 0).any(axis=0)
    touched = (constant != 0).any(axis=0) | (reach.T @ np.ones((n_joint, n_joint)) @ reach != 0)
    for model in models:
        for term in model.forces:
            there = term.direction[order] != 0
            touched |= there[:, None] & there[None, :]
    spring, damper = (turned * stiffness[:, None]) @ springs, (turned * damping[:, None]) @ springs
    row, column = np.nonzero(((spring != 0) | (damper != 0)).any(axis=0))
    elastic = np.flatnonzero(first.elastic_gear)
    transmission, gear_spring = np.zeros((len(models), n_axis, n)), np.zeros((len(models), n_axis, 2))
    transmission[:, elastic] = springs[:, : len(elastic)]
    gear_spring[:, elastic] = np.stack((stiffness, damping), axis=-1)[:, : len(elastic)]
    rigid = np.linalg.inv(np.stack([model.mechanism.gear for model in models])).swapaxes(1, 2).copy()
    rigid[:, first.elastic_gear] = 0.0
    (joint_column, joint_value), (gear_column, gear_value), (rigid_column, rigid_value) = (
        padded_rows(rows) for rows in (joints, transmission, rigid)
    )
    behind = (constant[:, : n - n_axis, : n - n_axis] != 0).any(axis=0)
    return PlantArrays(
        joint_column,
        in_lanes(list(joint_value), robots),
        np.searchsorted(row, np.arange(n + 1)).astype(np.int64),
        column.astype(np.int64),
        in_lanes(list(np.stack((spring[:, row, column], damper[:, row, column]), axis=-1)), robots),
        in_lanes(list(constant), robots),
        np.ascontiguousarray(np.argwhere(np.tril(behind)), dtype=np.int64),
        _fill(touched, n_axis),
        gear_column,
        in_lanes(list(gear_value), robots),
        in_lanes(list(gear_spring), robots),
        rigid_column,
        in_lanes(list(rigid_value), robots),
        in_lanes(list(rotors), robots),
    )


def _fill(touched: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], n_axis: int) -> IntArray:
    """What the elimination of each motor touches, see `PlantArrays.fill`; `touched` (n, n) is filled in."""
    n = len(touched)
    fill = np.zeros((n_axis, 1 + n), dtype=np.int64)
    for axis in range(n_axis - 1, -1, -1):  # eliminating one coordinate couples all that it touches
        motor = n - n_axis + axis
        before = np.flatnonzero(touched[motor, :motor])
        touched[np.ix_(before, before)] = True
        fill[axis, 0] = len(before)
        fill[axis, 1 : 1 + len(before)] = before
    return fill
