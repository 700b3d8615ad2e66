"""How chain, robot, controller and signals lie in memory for the compiled loops.

Inside the simulation, motors come *after* the other coordinates, so that eliminating from the last one up takes
them first: each touches few others.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robid_core.mechanics.chain import PRISMATIC, Chain, FloatArray, IntArray
from robid_core.mechanics.mechanism import Mechanism


class ChainArrays(NamedTuple):
    """A chain as the kernels read it: joint axes along local x, y or z. Plain arrays: they pass without counting."""

    tree: IntArray  # (n, 3) parent; 0, 1, 2: revolute about local x, y, z, 3: prismatic along z; is rotation not 1
    body: FloatArray  # (n, 22) rotation by rows 0-8, translation 9, mass 12, mass times centre 13, inertia
    # about the joint frame's origin xx yy zz xy xz yz 16
    ancestor: FloatArray  # (n, n) [j, i] is 1 where joint i moves body j, else 0
    gravity: FloatArray  # (3,)


class ChainWork(NamedTuple):
    """Memory of one evaluation, owned by the caller so that inner loops allocate nothing."""

    record: FloatArray  # (n, 40) axes x y z of the joint frame in world 0-8, origin 9, velocity of the base
    # point 12 (angular, linear), its acceleration 18, composite inertia about the world's origin xx yy zz xy xz yz
    # 24, mass times centre 30, mass 33, moment 34 and force 37 on what hangs on the joint
    screw: FloatArray  # (8, n) joint axis and its moment 0-5; sine and cosine of the joint angle 6, 7
    momentum: FloatArray  # (6, n) of what hangs on joint j, for a unit rate of joint j
    mass: FloatArray  # (n, n) lower triangle of the mass matrix
    bias: FloatArray  # (n,) c + g
    gravity_stiffness: FloatArray  # (n, n) lower triangle of dg/dq


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


def chain_arrays(chain: Chain) -> ChainArrays:
    """Turn every joint frame so that its axis is a local one, and list who moves whom."""
    n = chain.n_coordinate
    local, turns = zip(*map(_local_axis, chain.axis, chain.joint_type), strict=True)
    turn = np.array(turns)
    ancestor = np.eye(n)
    for j, parent in enumerate(chain.parent):
        if parent >= 0:
            ancestor[j] += ancestor[parent]
    parent_turn = np.where((chain.parent >= 0)[:, None, None], turn[chain.parent], np.eye(3))
    unturn, parent_unturn = turn.transpose(0, 2, 1), parent_turn.transpose(0, 2, 1)
    centre = (unturn @ chain.centre_of_mass[:, :, None])[:, :, 0]
    moved = (
        np.einsum("ni,ni->n", centre, centre)[:, None, None] * np.eye(3)
        - centre[:, :, None] * centre[:, None]
    )
    inertia = unturn @ chain.inertia @ turn + chain.mass[:, None, None] * moved
    rotation = parent_unturn @ chain.rotation @ turn
    body = np.concatenate(
        (
            rotation.reshape(n, 9),
            (parent_unturn @ chain.translation[:, :, None])[:, :, 0],
            chain.mass[:, None],
            chain.mass[:, None] * centre,
            inertia[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
        ),
        axis=1,
    )
    turned = (rotation != np.eye(3)).any(axis=(1, 2))
    tree = np.column_stack((chain.parent, local, turned)).astype(np.int64)
    return ChainArrays(np.ascontiguousarray(tree), np.ascontiguousarray(body), ancestor, chain.gravity.copy())


def chain_work(n: int) -> ChainWork:
    """Allocate the memory of one evaluation for n joints."""
    return ChainWork(*aligned_arrays((n, 40), (8, n), (6, n), (n, n), (n,), (n, n)))


def aligned_arrays(*shapes: tuple[int, ...]) -> list[FloatArray]:
    """Allocate zeros side by side, each at the start of a cache line.

    Where numpy happens to put small arrays makes an inner loop up to 1.6 times slower in one process than in another.
    """
    line = 64 // 8
    sizes = [-(-math.prod(shape) // line) * line for shape in shapes]
    memory = np.zeros(sum(sizes) + line)
    start = -memory.ctypes.data % 64 // 8
    starts = [start + sum(sizes[:i]) for i in range(len(shapes))]
    return [memory[at : at + math.prod(s)].reshape(s) for at, s in zip(starts, shapes, strict=True)]


def _local_axis(axis: FloatArray, joint_type: int) -> tuple[int, FloatArray]:
    """Return how the kernel calls the joint, and the axes in which it is one of the local ones."""
    aligned = np.flatnonzero(axis == 1.0)
    if joint_type != PRISMATIC and len(aligned):
        return int(aligned[0]), np.eye(3)
    z = axis / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[np.argmin(abs(z))], z)
    x /= np.linalg.norm(x)
    return 3 if joint_type == PRISMATIC else 2, np.column_stack((x, np.cross(z, x), z))


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
