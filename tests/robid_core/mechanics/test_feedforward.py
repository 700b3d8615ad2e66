"""Computed torque: against pinocchio, against equilibria, and by robots that follow it to a micrometre."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

sys.path.append(str(Path(__file__).parents[2]))
from oracles.pinocchio_robot import PinocchioChain
from oracles.robots import drawn_robot, with_rigid_gears

from robid_core import ConfigurationError, Robot
from robid_core.mechanics import Mechanism
from robid_core.mechanics.feedforward import (
    Feedforward,
    MotorFriction,
    Tool,
    computed_torque,
    derivative,
    drive_signals,
)
from robid_core.mechanics.tool import pose_of, turned_by

TOOL = Tool("axis_6", (0.25, 0.03, 0.06))
T = 1e-3


def friction_of(robot: Robot) -> MotorFriction:
    d = robot.drives
    return MotorFriction(d.coulomb, d.viscous, d.friction_speed, d.friction_offset)


def feedforward_of(robot: Robot, angle: np.ndarray, **options: object) -> Feedforward:
    stiffness, damping = robot.spring_arrays()
    friction = friction_of(robot)
    return computed_torque(robot.mechanism, stiffness, damping, angle, T, friction=friction, **options)  # type: ignore[arg-type]


def smooth_step(n: int, first: int, length: int) -> np.ndarray:
    """From 0 to 1 with five derivatives zero at both ends."""
    s = np.clip((np.arange(n) - first) / length, 0, 1)
    coefficients = [0.0] * 6 + [462.0, -1980.0, 3465.0, -3080.0, 1386.0, -252.0]
    return np.polynomial.polynomial.polyval(s, coefficients)


# Poses ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_poses_and_jacobians_are_those_of_pinocchio(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = drawn_robot(rng, 5, tree=True, prismatic=True, n_bearing=3).chain
    twin, position = PinocchioChain(chain), rng.normal(size=(4, chain.n_coordinate))
    body, point = chain.names[-1], rng.normal(size=3)
    found = pose_of(chain, position, body, point)
    for row, q in enumerate(position):
        pinocchio.computeJointJacobians(twin.model, twin.data, q[twin.back])
        joint = twin.model.getJointId(body)
        place = twin.data.oMi[joint]
        np.testing.assert_allclose(found.rotation[row], place.rotation, atol=1e-13)
        np.testing.assert_allclose(found.position[row], place.act(point), atol=1e-13)
        world = pinocchio.getJointJacobian(twin.model, twin.data, joint, pinocchio.WORLD)[:, twin.place]
        moved = world[:3] + np.cross(world[3:], place.act(point), axis=0)
        np.testing.assert_allclose(found.jacobian[row], np.concatenate((world[3:], moved)), atol=1e-12)


def test_jacobians_of_flexible_links_are_slopes_of_their_poses() -> None:
    """Central differences over 1e-5 of coordinates of order 1: truncation and rounding below 1e-9."""
    chain = Robot.load("six_axis_flex").chain
    rng = np.random.default_rng(4)
    q = np.where(chain.joint_type == 2, 0.2, 1.0) * rng.normal(size=chain.n_coordinate)
    pose = pose_of(chain, q, "axis_6", TOOL.point)
    for j, unit in enumerate(np.eye(chain.n_coordinate)):
        after, before = (pose_of(chain, q + sign * 1e-5 * unit, "axis_6", TOOL.point) for sign in (1, -1))
        moved = (after.position - before.position) / 2e-5
        turned = turned_by(after.rotation, before.rotation) / 2e-5
        np.testing.assert_allclose(pose.jacobian[:, j], np.concatenate((turned, moved)), atol=1e-8)


# Derivatives ------------------------------------------------------------------------------------------------


def test_derivatives_of_polynomials_are_exact_up_to_the_ends() -> None:
    """Degree 8 over t in [0, 1]; rounding is 1e-16 times the largest weight, 2 per sample and 400 samples a second."""
    t = np.linspace(0, 1, 400)
    polynomial = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 2.0, 0.3, -0.7, 0.9])
    signal = np.stack([polynomial(t), -polynomial(t)], axis=1)
    rate = derivative(signal, t[1], band_hz=30.0)
    exact = polynomial.deriv()(t)
    np.testing.assert_allclose(rate, np.stack([exact, -exact], axis=1), atol=1e-11)


@pytest.mark.parametrize(("share", "error"), [(1 / 6, 1e-5), (1 / 3, 2e-3)])
def test_derivatives_of_sines_are_as_exact_as_the_docstring_says(share: float, error: float) -> None:
    omega, t = 2 * np.pi * 90 * share, np.arange(1000) * T
    rate = derivative(np.sin(omega * t), T, band_hz=90.0)[50:-50]
    assert abs(rate / omega - np.cos(omega * t)[50:-50]).max() < error


def test_derivatives_of_a_period_are_exact_in_the_band_and_nothing_beyond() -> None:
    t = np.arange(500) * T
    kept, dropped = np.sin(2 * np.pi * 40 * t), np.cos(2 * np.pi * 120 * t)
    rate = derivative(kept + dropped, T, periodic=True)
    np.testing.assert_allclose(rate, 80 * np.pi * np.cos(2 * np.pi * 40 * t), atol=1e-9)


def test_a_motion_too_short_for_its_derivatives_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="20 samples; derivatives up to 100 Hz need 33"):
        derivative(np.zeros(20), T)


# Torques ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_torque_of_rigid_robots_is_that_of_pinocchio(seed: int) -> None:
    """A period of sines, differentiated in closed form for pinocchio; coupled gears, branches, sliding joints."""
    rng = np.random.default_rng(seed)
    robot = drawn_robot(rng, 5, tree=True, prismatic=True, coupled=True)
    robot = with_rigid_gears(robot, *robot.axis_names)
    n, omega = 400, 2 * np.pi / (400 * T)
    t = np.arange(n)[:, None] * T
    amplitude, phase = rng.normal(size=(2, 5, 1, 1))
    order = np.array([1, 2, 3, 5, 2])
    start = rng.normal(size=5)
    amplitude, phase = rng.uniform(0.1, 0.4, 5), rng.uniform(0, 6, 5)
    turn = order * omega * t + phase
    angle = start + amplitude * np.sin(turn)
    speed, acceleration = (
        amplitude * order * omega * np.cos(turn),
        -amplitude * (order * omega) ** 2 * np.sin(turn),
    )
    found = feedforward_of(robot, angle, periodic=True)
    twin, gear, d = PinocchioChain(robot.chain), robot.drives.gear, robot.drives
    for k in range(0, n, 37):
        force = twin.force(angle[k], speed[k], acceleration[k])
        motor_speed, motor_acceleration = (
            np.linalg.solve(gear, rate) for rate in (speed[k], acceleration[k])
        )
        friction = d.coulomb * np.tanh(motor_speed / d.friction_speed) + d.viscous * motor_speed
        expected = d.rotor_inertia * motor_acceleration + gear.T @ force + friction + d.friction_offset
        np.testing.assert_allclose(found.torque[k], expected, rtol=1e-8, atol=1e-9 * abs(expected).max())
        np.testing.assert_allclose(found.motor_speed[k], motor_speed, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(found.motor_angle @ gear.T, angle, atol=1e-12)


def test_an_elastic_gear_asks_for_the_fourth_derivative() -> None:
    """Pendulum of inertia J on a spring k, d: with tau = J q'' + m g l sin q the motor's angle is q + delta.

    Exact: k delta + d delta' = tau at one frequency is a division by k + i w d. Series of the code: relative error
    (w d / k)^3 of delta.
    """
    robot = drawn_robot(np.random.default_rng(8), 1)
    chain = replace(robot.chain, gravity=np.zeros(3))
    m = robot.mechanism
    mechanism = Mechanism(chain, m.gear, m.rotor_inertia, m.arm, m.elastic, m.elastic_gear)
    stiffness, damping = np.array([2e4]), np.array([30.0])
    n, line = 500, 3
    omega, amplitude = 2 * np.pi * line / (n * T), 0.3
    t = np.arange(n) * T
    angle = amplitude * np.sin(omega * t)[:, None]
    inertia = float(
        chain.axis[0] @ chain.inertia[0] @ chain.axis[0]
        + chain.mass[0] * np.sum(np.cross(chain.axis[0], chain.centre_of_mass[0]) ** 2)
    )
    found = computed_torque(mechanism, stiffness, damping, angle, T, periodic=True)
    load = -(omega**2) * inertia * amplitude / 1j * np.exp(1j * omega * t)
    delta = load / (stiffness[0] + 1j * omega * damping[0])
    ratio = 1 / robot.drives.gear[0, 0]
    motor = ratio * (amplitude / 1j * np.exp(1j * omega * t) + delta)
    size = (omega * damping[0] / stiffness[0]) ** 3 * abs(delta).max()
    np.testing.assert_allclose(found.motor_angle[:, 0], motor.real, atol=1.1 * size * abs(ratio))
    torque = -(omega**2) * mechanism.rotor_inertia[0] * motor + load / ratio
    assert abs(found.torque[:, 0] - torque.real).max() < 1e-5 * abs(torque).max()
    assert abs(delta).max() > 1e-3  # the deflection is seen


def test_at_rest_the_tool_stands_where_it_is_wanted_although_everything_sags() -> None:
    """The oracle is the equilibrium of the elastic robot at the motor angles that come out."""
    robot = Robot.load("six_axis_flex")
    robot = robot.without_effect(*robot.description.effects)
    for pose in ([0.2, 0.7, -0.5, 0.3, 0.9, 0.1], [-0.5, 0.3, 0.1, -0.8, -0.7, 0.4]):
        found = feedforward_of(robot, np.tile(pose, (40, 1)), tool=TOOL, iterations=8)
        rest = robot.equilibrium(robot.joint_angle(found.motor_angle[:1]))
        straight = np.zeros((1, robot.chain.n_coordinate))
        straight[:, robot.mechanism.arm] = pose
        actual, wanted, sagged = (
            pose_of(robot.chain, joint, TOOL.body, TOOL.point)
            for joint in (rest.joint, straight, robot.equilibrium(np.array([pose])).joint)
        )
        assert np.linalg.norm(sagged.position - wanted.position) > 3e-3
        assert np.linalg.norm(actual.position - wanted.position) < 1e-8
        assert np.linalg.norm(turned_by(actual.rotation, wanted.rotation)) < 1e-7
        still = friction_of(robot).offset
        np.testing.assert_allclose(found.torque[0], rest.torque[0] + still, atol=1e-9)


def test_a_robot_follows_its_own_computed_torque_and_not_that_of_a_rigid_one() -> None:
    """Fast motion of an elastic robot with bearings: micrometres at the tool where the rigid model leaves millimetres.

    Half a sample of delay alone, taken out by `drive_signals`, costs more than all the rest.
    """
    robot = Robot.load("six_axis")
    plain = {
        name: axis.model_copy(
            update={
                "sensors": axis.sensors.model_copy(update={"encoder_counts": 0.0}),
                "controller": axis.controller.model_copy(update={"position_gain": 15.0}),
            }
        )
        for name, axis in robot.description.axes.items()
    }
    robot = Robot(robot.description.model_copy(update={"axes": plain}))
    stiff = {name: axis.model_copy(update={"gear": None}) for name, axis in plain.items()}
    rigid = Robot(robot.description.model_copy(update={"axes": stiff, "bearings": {}}))
    start, way = np.array([-0.2, 0.2, -0.1, -0.3, 0.6, -0.5]), np.array([0.5, 0.4, -0.3, 0.5, 0.2, 0.5])
    step = smooth_step(1300, 100, 800)
    angle = start + way * step[:, None]
    straight = np.zeros((len(angle), robot.chain.n_coordinate))
    straight[:, robot.mechanism.arm] = angle
    wanted = pose_of(robot.chain, straight, TOOL.body, TOOL.point).position

    def tool_error(ask: Feedforward, aligned: bool = True) -> float:
        speed, torque = drive_signals(ask, T) if aligned else (ask.motor_speed, ask.torque)
        run = robot.simulate(
            speed[None],
            robot.joint_angle(ask.motor_angle[:1]),
            position_reference=ask.motor_angle[None],
            torque_feedforward=(torque - torque[0])[None],
            keep_coordinates=True,
        )
        assert run.coordinates is not None
        joint = run.coordinates[0] @ robot.mechanism.constraint_map.T
        actual = pose_of(robot.chain, joint, TOOL.body, TOOL.point).position
        return float(np.linalg.norm(actual - wanted, axis=1).max())

    own = feedforward_of(robot, angle, tool=TOOL)
    best, late, worst = tool_error(own), tool_error(own, False), tool_error(feedforward_of(rigid, angle))
    assert best < 2e-5
    assert late > 10 * best
    assert worst > 5e-3


def test_what_cannot_be_followed_is_refused() -> None:
    robot = Robot.load("six_axis")
    stiffness, damping = robot.spring_arrays()
    with pytest.raises(ConfigurationError, match=r"shape \(50, 5\); give finite angles \(n_sample, 6\)"):
        computed_torque(robot.mechanism, stiffness, damping, np.zeros((50, 5)), T)
    stiffness[-2] = 0.0
    with pytest.raises(ConfigurationError, match="elastic joint 'axis_3_x' has no stiffness"):
        computed_torque(robot.mechanism, stiffness, damping, np.zeros((50, 6)), T)
