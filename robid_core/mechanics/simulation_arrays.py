"""How robot, effects, controller and signals lie in memory for the simulation; the last axis of states is the lanes.

Inside the simulation, motors come *after* the other coordinates, so that eliminating from the last one up takes
them first: each touches few others.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from robid_core.mechanics.chain import REVOLUTE, FloatArray, IntArray
from robid_core.mechanics.dynamics import dynamics
from robid_core.mechanics.laws import N_INPUT, N_OUTPUT, Entries, Kind, entries_of
from robid_core.mechanics.layout import (
    ChainArrays,
    ChainWork,
    aligned_arrays,
    chain_arrays,
    chain_work,
    padded_rows,
)
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.terms import CHANNELS, ForceTerm, SignalTerm

POSES = 32  # in which the mobility of springs is looked at


class PlantArrays(NamedTuple):
    """The mechanism but for its chain."""

    joint_column: IntArray  # (n_joint, width) where row j of T is not zero, filled up with column 0, value 0
    joint_value: FloatArray
    spring_start: IntArray  # (n + 1,) first entry of each row of the spring matrix in the next two
    spring_column: IntArray  # (n_entry,)
    spring_value: FloatArray  # (n_entry, 2) of sum k_s e_s e_s^T, and of the dampers likewise
    constant: FloatArray  # (n, n) rotors, and springs and dampers as the implicit step adds them to the mass
    fill: IntArray  # (n_axis, 1 + n) number and list of the coordinates before a motor that its elimination touches
    transmission: FloatArray  # (n_axis, n) row of the deflection of each elastic gear
    gear_spring: FloatArray  # (n_axis, 2) its stiffness and damping
    rigid: FloatArray  # (n_axis, n_axis) torque of a rigid gear from (drive torque - rotor inertia x acceleration)
    rotor_inertia: FloatArray  # (n_axis,)


class TermArrays(NamedTuple):
    """Laws that act, as data: nothing is compiled anew for another set of them."""

    force: (
        IntArray  # (n_force, 10) entry of the law; n_state, first state, first argument; acts where it sees
    )
    # (implicit);
    # axis of the gear whose torque it is part of, or -1; ends of direction, coordinate and load in `column`
    signal: IntArray  # (n_signal, 6) entry of the law; n_state, first state, first argument; axis; channel
    column: IntArray  # (n_entry,)
    value: FloatArray  # (n_entry,)
    argument: FloatArray  # (n_argument,)
    weight: FloatArray  # (n_force,) of the slope in position, as `spring_weights`
    loads: IntArray  # (1,) whether any law asks for a load


class StepWork(NamedTuple):
    """Memory of one step beside that of the chain; last axis: lanes."""

    joint: FloatArray  # (n_joint,) where the chain is evaluated
    joint_speed: FloatArray  # (n_joint,)
    middle: FloatArray  # (n,) where M, c, g and laws are evaluated
    middle_speed: FloatArray  # (n,)
    spring: FloatArray  # (n,) position that bends the springs
    start: FloatArray  # (n,) position at the start of the step, for laws with a state
    right: FloatArray  # (n,) right-hand side, then acceleration
    pivot: FloatArray  # (n,) inverse pivots
    system: FloatArray  # (n, n) lower triangle
    stage: FloatArray  # (4, n) accelerations of the stages
    torque: FloatArray  # (n_axis,) acting
    command: FloatArray  # (n_axis,) held
    load: FloatArray  # (n_axis,) torque that the transmissions pass
    force: FloatArray  # (n_force,) of each law
    slope: FloatArray  # (n_force,) what its slopes add to the system
    place: FloatArray  # (6,) what goes into a law, and what comes out
    next_state: FloatArray  # (n_state,)


class LaneState(NamedTuple):
    """State of robot and controller, motors after the other coordinates; changed in place."""

    position: FloatArray  # (n_block, n, width)
    speed: FloatArray  # (n_block, n, width)
    acceleration: FloatArray  # (n_block, n, width) of the last step, for the extrapolation of the next
    integral: FloatArray  # (n_block, n_axis, width) N m
    reference: FloatArray  # (n_block, n_axis, width) rad
    measured: FloatArray  # (n_block, n_axis, width) rad, at the last sample
    holding_torque: FloatArray  # (n_block, n_axis, width) N m
    law_state: FloatArray  # (n_block, n_state, width)


class ControlArrays(NamedTuple):
    """The cascade controller and its clock."""

    gains: FloatArray  # (n_axis, 6) speed, integral, position, speed feedforward, torque limit, encoder step
    sample_time: float
    n_step: int  # integration steps a sample
    runge_kutta: bool


class Signals(NamedTuple):
    """Inputs and outputs, (n_lane, n_sample, n); an input of no rows is absent, so is the output `coordinates`."""

    speed_reference: FloatArray
    position_reference: FloatArray
    torque_feedforward: FloatArray
    position_noise: FloatArray
    torque_noise: FloatArray
    position: FloatArray
    torque: FloatArray
    coordinates: FloatArray
    saturated: IntArray  # (n_lane, n_axis) samples at the torque limit
    diverged: IntArray  # (n_lane,) sample at which the lane was stopped, -1 if it was not
    force: FloatArray  # (n_lane, n_force) of the laws when the lane was stopped


class Arrays(NamedTuple):
    """Everything about the robot that the loop reads."""

    chain: ChainArrays
    plant: PlantArrays
    terms: TermArrays


class Work(NamedTuple):
    """Everything that the loop writes on the way."""

    chain: ChainWork
    step: StepWork


def motors_last(mechanism: Mechanism) -> IntArray:
    """Order of the coordinates inside the loop: internal coordinate i is coordinate order[i] of the mechanism."""
    return np.roll(np.arange(mechanism.n_coordinate), -mechanism.n_axis)


def work_memory(mechanism: Mechanism, n_force: int, n_state: int, width: int) -> Work:
    """Allocate the memory of one block of lanes."""
    n, n_joint, n_axis = mechanism.n_coordinate, mechanism.chain.n_coordinate, mechanism.n_axis
    shapes = (
        *((n_joint,), (n_joint,)),
        *((n,), (n,), (n,), (n,), (n,), (n,), (n, n), (4, n)),
        *((n_axis,), (n_axis,), (n_axis,), (n_force,), (n_force,), (N_INPUT + N_OUTPUT,), (n_state,)),
    )
    memory = aligned_arrays(*((*(max(size, 1) for size in shape), width) for shape in shapes))
    return Work(chain_work(n_joint, width), StepWork(*memory))


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
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    forces: Sequence[ForceTerm],
    implicit_step: float,
    weight: FloatArray,
) -> PlantArrays:
    """Lay the robot out for the loop; `implicit_step` is 0 for an explicit method.

    `weight` are the `spring_weights` of that step.
    """
    n_axis, n, n_joint = mechanism.n_axis, mechanism.n_coordinate, mechanism.chain.n_coordinate
    order, motors = motors_last(mechanism), np.arange(n - n_axis, n)
    joints, springs = mechanism.constraint_map[:, order], mechanism.spring_directions[:, order]
    half = implicit_step / 2
    constant = (springs.T * (weight * stiffness + half * damping)) @ springs
    constant[motors, motors] += mechanism.rotor_inertia
    touched = (constant != 0) | (abs(joints.T) @ np.ones((n_joint, n_joint)) @ abs(joints) != 0)
    for term in forces:
        there = term.direction[order] != 0
        touched |= there[:, None] & there[None, :]
    fill = np.zeros((n_axis, 1 + n), dtype=np.int64)
    for motor in motors[::-1]:  # eliminating one coordinate couples all that it touches
        before = np.flatnonzero(touched[motor, :motor])
        touched[np.ix_(before, before)] = True
        fill[motor - motors[0], 0] = len(before)
        fill[motor - motors[0], 1 : 1 + len(before)] = before
    spring, damper = (springs.T * stiffness) @ springs, (springs.T * damping) @ springs
    row, column = np.nonzero((spring != 0) | (damper != 0))
    transmission, gear_spring = np.zeros((n_axis, n)), np.zeros((n_axis, 2))
    elastic = np.flatnonzero(mechanism.elastic_gear)
    transmission[elastic] = springs[: len(elastic)]
    gear_spring[elastic] = np.column_stack((stiffness, damping))[: len(elastic)]
    rigid: FloatArray = np.ascontiguousarray(np.linalg.inv(mechanism.gear).T, dtype=np.float64)
    rigid[mechanism.elastic_gear] = 0.0
    return PlantArrays(
        *padded_rows(joints),
        np.searchsorted(row, np.arange(n + 1)).astype(np.int64),
        column.astype(np.int64),
        np.ascontiguousarray(np.column_stack((spring[row, column], damper[row, column]))),
        np.ascontiguousarray(constant),
        fill,
        transmission,
        gear_spring,
        rigid,
        mechanism.rotor_inertia.copy(),
    )


def term_arrays(
    mechanism: Mechanism,
    forces: Sequence[ForceTerm],
    signals: Sequence[SignalTerm],
    single: bool,
    implicit_step: float,
    weight: FloatArray,
) -> tuple[TermArrays, list[Entries]]:
    """Lay the laws out for the loop; the entries must live as long as their addresses are used.

    A law along a spring has the weight of that spring, any other that of the midpoint.
    """
    spring_weight = dict(zip(map(tuple, mechanism.spring_directions.tolist()), weight.tolist(), strict=True))
    weights = [spring_weight.get(tuple(term.direction.tolist()), implicit_step**2 / 4) for term in forces]
    order = motors_last(mechanism)
    column: list[int] = []
    value: list[float] = []
    argument: list[float] = []
    rows: dict[str, list[list[int]]] = {"force": [], "signal": []}
    keep = []
    n_state = 0
    gears = dict(
        zip(map(tuple, mechanism.spring_directions), np.flatnonzero(mechanism.elastic_gear), strict=False)
    )
    terms: list[ForceTerm | SignalTerm] = [*forces, *signals]
    for term in terms:
        kind: Kind = "force" if isinstance(term, ForceTerm) else "signal"
        entries = entries_of(term.law, kind, term.n_state, term.label)
        keep.append(entries)
        head = [entries.single if single else entries.lanes, term.n_state, n_state, len(argument)]
        argument += np.asarray(term.arguments, dtype=float).tolist()
        n_state += term.n_state
        if isinstance(term, SignalTerm):
            rows["signal"].append([*head, term.axis, CHANNELS.index(term.channel)])
            continue
        ends = [len(column)]
        for entry in (term.direction[order], term.coordinate[order], term.load):
            column += np.flatnonzero(entry).tolist()
            value += entry[np.flatnonzero(entry)].tolist()
            ends.append(len(column))
        acts_where_it_sees = int(np.array_equal(term.direction, term.coordinate))
        gear = int(gears.get(tuple(term.direction.tolist()), -1))
        rows["force"].append([*head, acts_where_it_sees, gear, *ends])
    return TermArrays(
        np.array(rows["force"], dtype=np.int64).reshape(-1, 10),
        np.array(rows["signal"], dtype=np.int64).reshape(-1, 6),
        np.array([*column, 0], dtype=np.int64),
        np.array([*value, 0.0]),
        np.array([*argument, 0.0]),
        np.array(weights, dtype=np.float64),
        np.array([any(np.any(term.load) for term in forces)], dtype=np.int64),
    ), keep


def robot_arrays(mechanism: Mechanism, plant: PlantArrays, terms: TermArrays) -> Arrays:
    """Put chain, plant and laws together."""
    return Arrays(chain_arrays(mechanism.chain), plant, terms)
