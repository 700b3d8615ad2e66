"""Acceleration of the nonlinear elastic robot with bent springs against MuJoCo and pinocchio."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from oracles.mujoco_robot import MujocoRobot
from oracles.pinocchio_robot import PinocchioRobot
from oracles.robots import changed, drawn_robot, drawn_state, with_rigid_gears

from robid_core import Robot
from robid_core.mechanics import dynamics, friction_torque, solve_equilibrium
from robid_core.mechanics.reference import acceleration_by_solving

FloatArray = npt.NDArray[np.float64]

# Of the terms that a force is the sum of, spring torques k (|r q_m| + |q|) above all: some ten roundings of
# 1e-16, and the condition of M in its own scaling (bodies a thousand times heavier than what hangs on them).
ROUNDING = 1e-12

ROBOTS: dict[str, Callable[[np.random.Generator], Robot]] = {
    "six_axis_true": lambda _: Robot.load("six_axis_true"),
    "one axis with two bearings": lambda g: drawn_robot(g, 1, n_bearing=2),
    "coupled wrist": lambda g: drawn_robot(g, 5, coupled=True, n_bearing=3),
    "tree with sliding joints": lambda g: drawn_robot(
        g, 6, tree=True, prismatic=True, coupled=True, n_bearing=8
    ),
    "twelve axes": lambda g: drawn_robot(g, 12, prismatic=True, n_bearing=14),
    "rigid coupled wrist": lambda g: with_rigid_gears(
        drawn_robot(g, 3, coupled=True, n_bearing=2), "axis_1", "axis_2", "axis_3"
    ),
    "two rigid gears": lambda g: with_rigid_gears(drawn_robot(g, 4, n_bearing=3), "axis_2", "axis_4"),
}


def _drawn(name: str) -> tuple[Robot, np.random.Generator]:
    generator = np.random.default_rng(sum(map(ord, name)))
    return ROBOTS[name](generator), generator


def _by_kernel(
    robot: Robot, position: FloatArray, speed: FloatArray, torque: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Acceleration from the compiled mass matrix and bias, and the size of what cancels in it: |M^-1| sum
    |terms|."""
    mechanism, d = robot.mechanism, robot.drives
    stiffness, damping = robot.spring_arrays()
    joints, springs, n_axis = mechanism.constraint_map, mechanism.spring_directions, robot.n_axis
    terms = dynamics(robot.chain, joints @ position, joints @ speed)
    mass = joints.T @ terms.mass @ joints
    mass[:n_axis, :n_axis] += np.diag(d.rotor_inertia)
    pull = stiffness * (springs @ position) + damping * (springs @ speed)
    force = -joints.T @ terms.bias - springs.T @ pull
    drag = friction_torque(speed[:n_axis], d.coulomb, d.viscous, d.friction_speed) + d.friction_offset
    force[:n_axis] += torque - drag
    inverse = np.linalg.inv(mass)
    # a deflection is the small difference of large angles
    bent = stiffness * (abs(springs) @ abs(position)) + damping * (abs(springs) @ abs(speed))
    each = abs(joints.T) @ abs(terms.bias) + abs(springs.T) @ bent
    each[:n_axis] += abs(torque) + abs(drag)
    return inverse @ force, abs(inverse) @ each


@pytest.mark.parametrize("name", ROBOTS)
def test_acceleration_with_bent_springs_is_mujocos(name: str) -> None:
    robot, generator = _drawn(name)
    twin, d = MujocoRobot(robot), robot.drives
    law = (d.coulomb, d.viscous, d.friction_speed, d.friction_offset)
    for _ in range(5):
        position, speed = drawn_state(generator, robot)
        torque = generator.normal(size=robot.n_axis)
        theirs = twin.acceleration(position, speed, torque)
        ours, size = _by_kernel(robot, position, speed, torque)
        assert (abs(ours - theirs) <= ROUNDING * size).all()
        written_out = acceleration_by_solving(
            robot.mechanism, *robot.spring_arrays(), law, position, speed, torque
        )
        assert (abs(written_out - theirs) <= ROUNDING * size).all()


@pytest.mark.parametrize("name", [name for name in ROBOTS if "rigid" not in name])
def test_acceleration_with_bent_springs_is_pinocchios(name: str) -> None:
    robot, generator = _drawn(name)
    oracle = PinocchioRobot(robot)
    for _ in range(5):
        position, speed = drawn_state(generator, robot)
        torque = generator.normal(size=robot.n_axis)
        ours, size = _by_kernel(robot, position, speed, torque)
        assert (abs(ours - oracle.acceleration(position, speed, torque)) <= ROUNDING * size).all()


@pytest.mark.parametrize("name", ROBOTS)
def test_the_equilibrium_is_at_rest_in_mujoco(name: str) -> None:
    robot, generator = _drawn(name)
    robot = changed(robot, every_axis={"friction": {}})
    twin = MujocoRobot(robot)
    stiffness, _ = robot.spring_arrays()
    motor = robot.motor_angle(generator.uniform(-1.0, 1.0, robot.n_axis))
    rest = solve_equilibrium(robot.mechanism, stiffness, motor)
    still = np.zeros_like(rest.position)
    _, size = _by_kernel(robot, rest.position, still, rest.torque)
    assert (abs(twin.acceleration(rest.position, still, rest.torque)) <= ROUNDING * size).all()
    sag = robot.mechanism.spring_directions @ rest.position
    assert abs(sag).max() > 1e-5  # or nothing was balanced


def test_the_twin_has_every_spring_of_the_robot() -> None:
    robot = Robot.load("six_axis_true")
    generator = np.random.default_rng(4)
    position, speed = drawn_state(generator, robot)
    torque, twin = np.zeros(6), MujocoRobot(robot)
    for name in (
        *robot.stiffness_names,
        *robot.damping_names,
        "rotor_inertia.axis_4",
        "friction.axis_5.coulomb",
    ):
        other = robot.with_parameters({name: 1.01 * robot.parameters()[name]})
        ours, size = _by_kernel(other, position, speed, torque)
        assert (abs(ours - twin.acceleration(position, speed, torque)) > ROUNDING * size).any(), name


def test_a_robot_without_an_exact_twin_is_refused() -> None:
    generator = np.random.default_rng(5)
    coupled = with_rigid_gears(drawn_robot(generator, 3, coupled=True), "axis_2")
    with pytest.raises(ValueError, match="a rigid gear is coupled to an elastic one"):
        MujocoRobot(coupled)
    forked = drawn_robot(np.random.default_rng(6), 4, tree=True, coupled=True)
    with pytest.raises(ValueError, match="its rigid gear couples branches"):
        MujocoRobot(with_rigid_gears(forked, *forked.axis_names))
