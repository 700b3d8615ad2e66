"""The linear model against MuJoCo's transition derivatives, finite differences, and reciprocity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from oracles.mujoco_robot import MujocoRobot
from oracles.pinocchio_robot import PinocchioRobot
from oracles.robots import changed, drawn_robot, with_rigid_gears

from robid_core import Robot
from robid_core.mechanics import solve_equilibrium

FloatArray = npt.NDArray[np.float64]

ROBOTS: dict[str, Callable[[np.random.Generator], Robot]] = {
    "six_axis_true": lambda _: Robot.load("six_axis_true"),
    "coupled wrist": lambda g: drawn_robot(g, 4, coupled=True, n_bearing=4),
    "tree with sliding joints": lambda g: drawn_robot(
        g, 5, tree=True, prismatic=True, coupled=True, n_bearing=4
    ),
    "two rigid gears": lambda g: with_rigid_gears(drawn_robot(g, 4, n_bearing=2), "axis_2", "axis_4"),
}
FREQUENCY_HZ = np.geomspace(4.0, 80.0, 30)


@pytest.fixture(scope="module", params=ROBOTS)
def case(request: pytest.FixtureRequest) -> tuple[Robot, FloatArray]:
    """A robot and a configuration in which gravity bends its springs."""
    generator = np.random.default_rng(sum(map(ord, request.param)))
    robot = ROBOTS[request.param](generator)
    return robot, generator.uniform(-0.8, 0.8, robot.n_axis)


def _motor_response(a: FloatArray, b: FloatArray, n_axis: int) -> FloatArray:
    """Continuous response from torque to motor acceleration of x = [z; z'], (n_freq, n_axis, n_axis)."""
    s = 2j * np.pi * FREQUENCY_HZ[:, None, None]
    return np.asarray(s**2 * np.linalg.solve(s * np.eye(len(a)) - a, b.astype(complex))[:, :n_axis])


def test_state_space_is_what_mujocos_transition_derivatives_say(case: tuple[Robot, FloatArray]) -> None:
    robot, angle = case
    ours = robot.linearize(angle, motor_damping=np.zeros(robot.n_axis))
    stiffness, _ = robot.spring_arrays()
    rest = solve_equilibrium(robot.mechanism, stiffness, robot.motor_angle(angle))
    a, b = MujocoRobot(robot).slopes(rest.position, rest.torque, change=1e-5)
    n = len(rest.position)
    # Central differences of the acceleration: change^2 = 1e-10 of its third derivative, and rounding of
    # accelerations of 1 rad/s^2 over the change, 1e-11 of slopes of 1e6; the step of the transition (1e-4)
    # takes four digits of the slopes over speed.
    for block, tolerance in (((slice(n, None), slice(0, n)), 1e-9), ((slice(n, None), slice(n, None)), 1e-8)):
        assert abs(ours.a[block] - a[block]).max() < tolerance * abs(a[block]).max()
    assert abs(ours.b - b).max() < 1e-8 * abs(b).max()
    # Gravity stiffness is thousandths of the springs': it must be seen on its own.
    model = robot.second_order(angle, np.zeros(robot.n_axis))
    springs = (robot.mechanism.spring_directions.T * stiffness) @ robot.mechanism.spring_directions
    gravity = model.stiffness - springs
    theirs = -model.mass @ a[n:, :n] - springs
    assert abs(gravity - theirs).max() < 1e-4 * abs(gravity).max()


def test_responses_of_both_linear_models_agree(case: tuple[Robot, FloatArray]) -> None:
    robot, angle = case
    none = np.zeros(robot.n_axis)
    stiffness, _ = robot.spring_arrays()
    rest = solve_equilibrium(robot.mechanism, stiffness, robot.motor_angle(angle))
    theirs = _motor_response(
        *MujocoRobot(robot).slopes(rest.position, rest.torque, change=1e-5), robot.n_axis
    )
    ours = robot.response(angle[None], FREQUENCY_HZ, none[None], hold="continuous")[0]
    # 1e-9 of A, amplified at a resonance by at most 1 / (2 zeta), zeta about 0.01
    assert (abs(ours - theirs) < 1e-7 * abs(ours).max(axis=(1, 2), keepdims=True)).all()


def test_linear_model_is_the_slope_of_the_nonlinear_one_in_pinocchio(case: tuple[Robot, FloatArray]) -> None:
    robot, angle = case
    if any(axis.gear is None for axis in robot.description.axes.values()):
        return  # the robot over pinocchio has elastic gears only; MuJoCo has both
    # viscous friction in, Coulomb friction and offset out: its slope at rest is no constant of the robot
    robot = changed(robot, every_axis={"friction": {"viscous": 3e-3}})
    oracle, n_axis = PinocchioRobot(robot), robot.n_axis
    stiffness, _ = robot.spring_arrays()
    rest = solve_equilibrium(robot.mechanism, stiffness, robot.motor_angle(angle))
    n, still = len(rest.position), np.zeros(len(rest.position))
    ours = robot.linearize(angle)
    step = 1e-5

    def slope(move: FloatArray, push: FloatArray) -> FloatArray:
        up = oracle.acceleration(rest.position + move[:n], still + move[n:], rest.torque + push)
        down = oracle.acceleration(rest.position - move[:n], still - move[n:], rest.torque - push)
        return (up - down) / (2 * step)

    a = np.array([slope(step * row, np.zeros(n_axis)) for row in np.eye(2 * n)]).T
    b = np.array([slope(np.zeros(2 * n), step * row) for row in np.eye(n_axis)]).T
    # step^2 = 1e-10 of the third derivative; rounding 1e-16 of forces 1e3 times as large as accelerations,
    # over the step
    np.testing.assert_allclose(ours.a[n:], a, rtol=0, atol=1e-8 * abs(a).max())
    np.testing.assert_allclose(ours.b[n:], b, rtol=0, atol=1e-8 * abs(b).max())


def test_response_is_reciprocal_without_friction(case: tuple[Robot, FloatArray]) -> None:
    # Motor torque -> motor angle of a passive structure at rest: G = G^T, whatever the springs' dampers.
    robot, angle = case
    none = np.zeros((1, robot.n_axis))
    model = robot.linearize(angle, motor_damping=none[0])
    responses = {
        "continuous": robot.response(angle[None], FREQUENCY_HZ, none, hold="continuous")[0],
        "sampled": robot.response(angle[None], FREQUENCY_HZ, none)[0],
        "state space": _motor_response(
            model.a, model.b, robot.n_axis
        ),  # does not know that M and K are symmetric
    }
    for name, g in responses.items():
        scale = abs(g).max(axis=(1, 2), keepdims=True)
        assert (abs(g - g.swapaxes(1, 2)) < 1e-10 * scale).all(), name
        off_diagonal = abs(g - np.einsum("fii->fi", g)[:, :, None] * np.eye(robot.n_axis))
        assert off_diagonal.max() > 1e-3 * abs(g).max()  # or there was nothing to compare
