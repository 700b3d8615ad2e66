"""Effects of a robot file in the robot: rest positions, linear models and motion agree with one another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import root

from robid_core import ConfigurationError, Robot
from robid_core.mechanics.reference import dynamics_by_jacobians

POSE = np.array([[0.3, 0.5, -0.4, 0.2, 0.6, -0.1]])


def _robot(tmp_path: Path, effects: str, base: str = "six_axis") -> Robot:
    path = tmp_path / "robot.yaml"
    path.write_text(f"robid_robot: 1\nname: tried\nbase: {base}\neffects:\n{effects}")
    return Robot.load(str(path))


SPRINGS = """\
  stiff: {use: transmission.stiffening, on: axis_2, side: gear, with: {cubic: 2.0e+10}}
  balance: {use: load.counterbalance, on: axis_2}
  hose: {use: load.cable_spring, on: axis_5, with: {stiffness: 300}}
"""


def test_the_arm_rests_where_gravity_and_nonlinear_springs_balance(tmp_path: Path) -> None:
    robot = _robot(tmp_path, SPRINGS)
    mechanism = robot.mechanism
    stiffness, _ = robot.spring_arrays()
    springs, joints, n_axis = mechanism.spring_directions, mechanism.constraint_map, robot.n_axis
    motor = robot.motor_angle(POSE)[0]

    def pull(free: Any) -> Any:
        """Torques on the coordinates behind the motors, by the laws called one by one from Python."""
        z = np.concatenate((motor, free))
        total = joints.T @ dynamics_by_jacobians(mechanism.chain, joints @ z, 0 * (joints @ z)).bias
        total += springs.T @ (stiffness * (springs @ z))
        for term in robot.forces:
            state = np.zeros(term.n_state)
            force, _, _ = term.law(term.coordinate @ z, 0.0, 0.0, state, state.copy(), term.arguments, 0.0)
            total += term.direction * force
        return total[n_axis:]

    rest = robot.equilibrium(POSE)
    scale = abs(
        joints.T @ dynamics_by_jacobians(mechanism.chain, rest.joint[0], 0 * rest.joint[0]).bias
    ).max()
    # Newton stops where its last step is 1e-13 (1 + |z|) rad, z up to 73 rad at the motors, times the stiffest spring
    np.testing.assert_allclose(pull(rest.position[0, n_axis:]) / scale, 0.0, atol=1e-8)
    solved = root(pull, rest.position[0, n_axis:] + 1e-5, tol=1e-12)
    np.testing.assert_allclose(rest.position[0, n_axis:], solved.x, rtol=0, atol=1e-10)
    plain = Robot.load("six_axis").equilibrium(POSE)
    assert abs(rest.position - plain.position).max() > 1e-5  # and it is not where it rests without them


def test_a_robot_at_its_rest_position_stays_there(tmp_path: Path) -> None:
    # Held by the torque of the equilibrium and the speed controllers, which differentiate one encoder count (6e-6 rad)
    # now and then: the arm stays within a count of the motors.
    run = _robot(tmp_path, SPRINGS).simulate(np.zeros((1, 300, 6)), POSE, keep_coordinates=True)
    moved = abs(run.coordinates - run.coordinates[:, :1]).max(axis=(0, 1))
    assert moved[:6].max() < 6e-6
    assert moved[6:].max() < 6e-6 / 51 * 2


def test_the_linear_model_has_the_slope_of_the_nonlinear_springs(tmp_path: Path) -> None:
    robot = _robot(tmp_path, SPRINGS)
    second = robot.second_order(POSE)
    mechanism = robot.mechanism
    stiffness, _ = robot.spring_arrays()
    springs, joints = mechanism.spring_directions, mechanism.constraint_map
    z = robot.equilibrium(POSE).position[0]

    def pull(z: Any) -> Any:
        total = joints.T @ dynamics_by_jacobians(mechanism.chain, joints @ z, 0 * (joints @ z)).bias
        total += springs.T @ (stiffness * (springs @ z))
        for term in robot.forces:
            force, _, _ = term.law(
                term.coordinate @ z, 0.0, 0.0, np.zeros(0), np.zeros(0), term.arguments, 0.0
            )
            total += term.direction * force
        return total

    step = 1e-6
    slope = np.array([(pull(z + step * e) - pull(z - step * e)) / (2 * step) for e in np.eye(len(z))]).T
    # central differences: rounding 1e-16 of torques of 1e3 N m over 2e-6, and step^2 / 6 of the third derivative
    # (cubic 6 k3 = 1.2e11 N m/rad^3: 0.02 N m/rad)
    np.testing.assert_allclose(second.stiffness[0], slope, rtol=1e-7, atol=0.1)


def test_a_small_motion_about_rest_is_that_of_the_linear_model(tmp_path: Path) -> None:
    signals = "  lag: {use: drive.current_loop, on: axis_3}\n  late: {use: sensing.delay, on: axis_3}\n"
    robot = _robot(tmp_path, SPRINGS + signals)
    quiet = robot.without_friction()
    n_sample, n_period, lines = 1000, 6, np.arange(6, 80, 7)
    t = 1e-3 * np.arange(n_sample * n_period)
    rng = np.random.default_rng(4)
    push = np.zeros((6, len(t), 6))
    for e in range(6):
        phases = rng.uniform(0, 2 * np.pi, len(lines))
        push[e, :, e] = 1e-3 * np.cos(2 * np.pi * lines * t[:, None] + phases).sum(axis=1)
    description = quiet.description
    axes = {name: axis.model_copy(update={"sensors": axis.sensors.model_copy(update={"encoder_counts": 0.0})})
            for name, axis in description.axes.items()}  # fmt: skip
    quiet = Robot(description.model_copy(update={"axes": axes}))
    run = quiet.simulate(np.zeros_like(push), np.tile(POSE, (6, 1)), torque_feedforward=push, step=6.25e-5)
    last = slice((n_period - 1) * n_sample, None)
    omega = 2 * np.pi * lines
    y = -(omega[:, None, None] ** 2) * np.fft.fft(run.position[:, last], axis=1)[:, lines].transpose(1, 2, 0)
    u = np.fft.fft(run.torque[:, last], axis=1)[:, lines].transpose(1, 2, 0)
    measured = y @ np.linalg.inv(u)
    expected = quiet.response(POSE, lines.astype(float))[0]
    size = abs(expected).max(axis=(1, 2), keepdims=True)
    plain = Robot.load("six_axis").response(POSE, lines.astype(float))[0]
    # left over: warping (w h)^2 / 12 of the step at the resonances, 2e-4 of a frequency over a width of 3 % of it
    assert (abs(measured - expected) / size).max() < 1e-3
    assert (abs(plain - expected) / size).max() > 0.05  # and the effects are well above that


def test_structure_effects_change_the_robot_that_everything_sees(tmp_path: Path) -> None:
    loaded = _robot(tmp_path, "  tool: {use: load.payload, with: {mass: 20}}\n")
    bare = Robot.load("six_axis")
    heavier = loaded.gravity_torque(POSE) - bare.gravity_torque(POSE)
    assert abs(heavier[0, 1]) > 0.1
    assert loaded.description.effects
    assert not loaded.structure.effects
    again = Robot.load(str(_written(tmp_path, loaded)))
    assert again.description == loaded.description
    np.testing.assert_array_equal(again.gravity_torque(POSE), loaded.gravity_torque(POSE))


def _written(folder: Path, robot: Robot) -> Path:
    path = folder / "again.yaml"
    path.write_text(robot.to_yaml())
    return path


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("{use: friction.stribek, on: axis_2}", "did you mean 'friction.stribeck'"),
        ("{use: friction.stribeck, on: axis_9}", "axis_9"),
        ("{use: friction.stribeck, on: axis_2, side: tooth}", "no side 'tooth'; it has motor"),
        ("{use: friction.stribeck, on: axis_2, with: {breakway: 1}}", "did you mean 'breakaway'"),
        ("{use: friction.stribeck, on: axis_2, with: {breakaway: -1}}", "outside"),
        ("{use: transmission.backlash, on: axis_7, side: gear}", "axis_7"),
    ],
)
def test_an_effect_that_cannot_be_where_it_is_put_is_told(tmp_path: Path, entry: str, told: str) -> None:
    with pytest.raises(ConfigurationError, match=told):
        _ = _robot(tmp_path, f"  tried: {entry}\n").forces


def test_friction_on_the_arm_damps_the_linear_model_under_the_speeds_it_is_told(tmp_path: Path) -> None:
    robot = _robot(
        tmp_path, "  seal: {use: friction.coulomb_tanh, on: axis_2, side: arm, with: {coulomb: 40}}\n"
    )
    rms, sine = np.full((1, 6), 3.0), np.full((1, 6), 8.0)
    without, under = robot.second_order(POSE), robot.second_order(POSE, motor_speed=(rms, sine))
    added = under.damping[0] - without.damping[0]
    joint = robot.mechanism.constraint_map[robot.mechanism.arm[1]]
    assert np.count_nonzero(added) == 1
    ratio = 121.0
    from robid_core.mechanics import equivalent_damping

    parameters = robot.parameters()
    expected = equivalent_damping(3.0 / ratio, 8.0 / ratio, 40.0, 0.0, parameters["effect.seal.speed"])
    assert joint @ added @ joint == pytest.approx(float(expected), rel=1e-3)


def test_ripple_over_many_turns_leaves_the_response_alone(tmp_path: Path) -> None:
    waves = """\
  cog: {use: drive.torque_ripple, on: axis_2, with: {relative: 0.02, order: 6, phase: 0.7}}
  resolver: {use: sensing.resolver_ripple, on: axis_3, with: {amplitude: 1.0e-3, order: 2, phase: 0.3}}
"""
    lines = np.array([5.0, 40.0])
    rippled, plain = (
        _robot(tmp_path, waves).response(POSE, lines),
        Robot.load("six_axis").response(POSE, lines),
    )
    np.testing.assert_allclose(rippled, plain, rtol=1e-9)


def test_a_rest_position_does_not_depend_on_what_is_asked_beside_it(tmp_path: Path) -> None:
    robot = _robot(tmp_path, SPRINGS)
    poses = np.concatenate((POSE, np.random.default_rng(2).uniform(-1, 1, (16, 6))))
    together, alone = robot.equilibrium(poses), robot.equilibrium(POSE)
    np.testing.assert_array_equal(together.torque[:1], alone.torque)
    np.testing.assert_array_equal(together.position[:1], alone.position)


def test_a_motors_friction_with_a_memory_damps_as_coulombs_where_its_bristle_is_stiff() -> None:
    """Dahl's law is Coulomb's where the path of its bristle, F_c / sigma, is far shorter than that of the motion.

    Here 5e-5 rad against 5 rad/s / (2 pi 18 Hz) = 0.04 rad; what remains is the scatter of one realisation, 1 %.
    """
    bare = Robot.load("one_axis").with_parameters({"friction.axis_1.coulomb": 0.0})
    level, frequency = {"coulomb": 0.5}, np.geomspace(4, 80, 40)
    sharp = bare.with_effect("rub", "friction.coulomb", "axis_1", values=level)
    bristle = bare.with_effect("rub", "friction.dahl", "axis_1", values={**level, "stiffness": 1e4})
    speeds = np.array([[5.0]]), np.array([[9.0]])
    expected = sharp.equivalent_motor_damping(*speeds)
    assert np.abs(bristle.equivalent_motor_damping(*speeds, frequency) / expected - 1) < 0.01
    with_mean = bristle.equivalent_motor_damping(*speeds, np.concatenate(([0.0], frequency)))
    np.testing.assert_array_equal(with_mean, bristle.equivalent_motor_damping(*speeds, frequency))
    for none in (None, [], [0.0]):
        with pytest.raises(ConfigurationError, match="`equivalent_motor_damping`: frequency_hz"):
            bristle.equivalent_motor_damping(*speeds, none)
