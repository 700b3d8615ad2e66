"""How robot, controller and signals lie in memory for the inner loop of the simulation.

Inside, motors come *after* the other coordinates, so that eliminating from the last one up takes them first: each
touches few others.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robid_core.mechanics.chain import FloatArray, IntArray
from robid_core.mechanics.dynamics import aligned_arrays, chain_arrays, chain_work
from robid_core.mechanics.mechanism import Mechanism


class PlantArrays(NamedTuple):
    """Everything about the robot that the loop reads; `tree` to `gravity` are the fields of `ChainArrays`."""

    tree: IntArray
    body: FloatArray
    ancestor: FloatArray
    gravity: FloatArray
    joint_column: IntArray  # (n_joint, width) where row j of T is not zero, filled up with column 0, value 0
    joint_value: FloatArray
    spring_start: IntArray  # (n + 1,) first entry of each row of the spring matrix in the next two
    spring_column: IntArray  # (n_entry,)
    spring_value: FloatArray  # (n_entry, 2) of sum k_s e_s e_s^T, and of the dampers likewise
    motor_law: FloatArray  # (n_axis, 4) Coulomb torque, viscous gain, friction speed, offset
    constant: FloatArray  # (n, n) rotors, and springs and dampers as the implicit step adds them to the mass
    fill: IntArray  # (n_axis, 1 + n) number and list of the coordinates before a motor that its elimination touches


class StepWork(NamedTuple):
    """Memory of one step; `record` to `gravity_stiffness` are the fields of `ChainWork`."""

    record: FloatArray
    screw: FloatArray
    momentum: FloatArray
    mass: FloatArray
    bias: FloatArray
    gravity_stiffness: FloatArray
    joint: FloatArray  # (n_joint,) where the chain is evaluated
    joint_speed: FloatArray  # (n_joint,)
    middle: FloatArray  # (n,) where M, c, g and friction are evaluated
    middle_speed: FloatArray  # (n,)
    spring: FloatArray  # (n,) position that bends the springs
    right: FloatArray  # (n,) right-hand side, then acceleration
    pivot: FloatArray  # (n,) inverse pivots
    system: FloatArray  # (n, n) lower triangle
    stage: FloatArray  # (4, n) accelerations of the stages
    torque: FloatArray  # (n_axis,)


class LaneState(NamedTuple):
    """State of robot and controller, one row a lane, motors after the other coordinates; changed in place."""

    position: FloatArray  # (n_lane, n)
    speed: FloatArray  # (n_lane, n)
    acceleration: FloatArray  # (n_lane, n) of the last step, for the extrapolation of the next
    integral: FloatArray  # (n_lane, n_axis) N m
    reference: FloatArray  # (n_lane, n_axis) rad
    measured: FloatArray  # (n_lane, n_axis) rad, at the last sample
    holding_torque: FloatArray  # (n_lane, n_axis) N m


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


def motors_last(mechanism: Mechanism) -> IntArray:
    """Order of the coordinates inside the loop: internal coordinate i is coordinate order[i] of the mechanism."""
    return np.roll(np.arange(mechanism.n_coordinate), -mechanism.n_axis)


def step_work(mechanism: Mechanism) -> StepWork:
    """Allocate the memory of one lane."""
    n, n_joint = mechanism.n_coordinate, mechanism.chain.n_coordinate
    shapes = ((n_joint,), (n_joint,), (n,), (n,), (n,), (n,), (n,), (n, n), (4, n), (mechanism.n_axis,))
    return StepWork(*chain_work(n_joint), *aligned_arrays(*shapes))


def plant_arrays(
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    friction: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    implicit_step: float,
) -> PlantArrays:
    """Lay the robot out for the loop; `implicit_step` is 0 for an explicit method."""
    n_axis, n, n_joint = mechanism.n_axis, mechanism.n_coordinate, mechanism.chain.n_coordinate
    order, motors = motors_last(mechanism), np.arange(n - n_axis, n)
    joints, springs = mechanism.constraint_map[:, order], mechanism.spring_directions[:, order]
    half = implicit_step / 2
    constant = (springs.T * (half * half * stiffness + half * damping)) @ springs
    constant[motors, motors] += mechanism.rotor_inertia
    touched = (constant != 0) | (abs(joints.T) @ np.ones((n_joint, n_joint)) @ abs(joints) != 0)
    fill = np.zeros((n_axis, 1 + n), dtype=np.int64)
    for motor in motors[::-1]:  # eliminating one coordinate couples all that it touches
        before = np.flatnonzero(touched[motor, :motor])
        touched[np.ix_(before, before)] = True
        fill[motor - motors[0], 0] = len(before)
        fill[motor - motors[0], 1 : 1 + len(before)] = before
    spring, damper = (springs.T * stiffness) @ springs, (springs.T * damping) @ springs
    row, column = np.nonzero((spring != 0) | (damper != 0))
    return PlantArrays(
        *chain_arrays(mechanism.chain),
        *padded_rows(joints),
        np.searchsorted(row, np.arange(n + 1)).astype(np.int64),
        column.astype(np.int64),
        np.ascontiguousarray(np.column_stack((spring[row, column], damper[row, column]))),
        np.ascontiguousarray(np.column_stack(friction), dtype=np.float64),
        np.ascontiguousarray(constant),
        fill,
    )


def padded_rows(matrix: FloatArray) -> tuple[IntArray, FloatArray]:
    """Columns and values of the nonzero entries of each row, filled up with zeros at column 0."""
    width = int((matrix != 0).sum(axis=1).max(initial=1))
    column = np.zeros((len(matrix), width), dtype=np.int64)
    value = np.zeros((len(matrix), width))
    for i, row in enumerate(matrix):
        there = np.flatnonzero(row)
        column[i, : len(there)], value[i, : len(there)] = there, row[there]
    return column, value
