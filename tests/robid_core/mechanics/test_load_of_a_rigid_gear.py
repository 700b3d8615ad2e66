"""What a rigid gear passes is the torque of the bodies: friction of the motor before it is none of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robid_core import Robot, RobotMotion, forces_along

RATIO, ROTOR, COULOMB, SHARE = 100.0, 1.2e-3, 0.5, 0.3
MASS, LEVER, INERTIA = 40.0, 0.5, 3.5
FILE = f"""
robid_robot: 1
name: pendulum
bodies:
  - joint: axis_1
    axis: [0, 1, 0]
    mass: {MASS}
    centre_of_mass: [{LEVER}, 0, 0]
    inertia: [[2, 0, 0], [0, {INERTIA}, 0], [0, 0, 2]]
axes:
  axis_1:
    gear_ratio: {RATIO}
    rotor_inertia: {ROTOR}
    friction: {{coulomb: {COULOMB}, viscous: 2.0e-3}}
    torque_limit: 30
    speed_limit: 400
    position_limits: [-9, 9]
    controller: {{speed_gain: 0.08, integral_gain: 0.64}}
effects:
  gear: {{use: friction.load_dependent, on: axis_1, with: {{coulomb: 0, load_coulomb: {SHARE}, load_excess: 0}}}}
"""


@pytest.mark.parametrize("n_lane", [1, 8])
def test_friction_of_the_motor_is_no_load_of_its_gear(tmp_path: Path, n_lane: int) -> None:
    """Against the equation of motion written out; with motor friction in the load torques are 20 % off.

    Held torques and differences of the angle agree to the change of the friction's smooth sign within a sample, which
    is left out by looking at speeds above 10 rad/s only; the steps are 1/4 ms, the motion has 2 Hz: 1e-3 of the torque.
    """
    path = tmp_path / "pendulum.yaml"
    path.write_text(FILE)
    robot = Robot.load(str(path))
    time = robot.sample_time_s * np.arange(2000)
    speed = np.repeat(40.0 * np.sin(2 * np.pi * 2 * time)[None, :, None], n_lane, axis=0)
    run = robot.simulate(speed, np.zeros((n_lane, 1)))
    q, torque = run.position[-1, :, 0], run.torque[-1, :, 0]
    v = (q[2:] - q[:-2]) / (2 * robot.sample_time_s)
    a = (q[2:] - 2 * q[1:-1] + q[:-2]) / robot.sample_time_s**2
    joint, joint_acceleration = q[1:-1] / RATIO, a / RATIO
    own = INERTIA + MASS * LEVER**2
    load = (own * joint_acceleration - MASS * 9.81 * LEVER * np.cos(joint)) / RATIO
    sign = np.sign(v)
    expected = ROTOR * a + load + COULOMB * sign + 2e-3 * v + SHARE * np.abs(load) * sign
    acting = 0.5 * (torque[1:-1] + torque[:-2])  # about the sample: held before it and after it
    kept = (np.abs(v) > 10.0) & (np.arange(len(v)) > 200)
    left = (acting - expected)[kept]
    assert np.sqrt(np.mean(left**2)) < 0.01 * np.sqrt(np.mean(expected[kept] ** 2))


def test_laws_along_a_motion_see_the_same_load(tmp_path: Path) -> None:
    """From torques of motors alone: friction that grows with the load it is part of the torque of is found by turns."""
    path = tmp_path / "pendulum.yaml"
    path.write_text(FILE)
    robot = Robot.load(str(path))
    step = 1e-3
    time = step * np.arange(1000)
    angle = 3.0 + 3.2 * (1 - np.cos(2 * np.pi * time))
    speed = np.gradient(angle, step)
    acceleration = np.gradient(speed, step)
    load = (
        (INERTIA + MASS * LEVER**2) * acceleration / RATIO - MASS * 9.81 * LEVER * np.cos(angle / RATIO)
    ) / RATIO
    sign = np.tanh(speed / 0.5)
    torque = ROTOR * acceleration + load + (COULOMB + SHARE * np.abs(load)) * sign + 2e-3 * speed
    motion = RobotMotion(angle[None, :, None], speed[None, :, None], step, torque=torque[None, :, None])
    (law,) = forces_along(robot, motion).of("gear")
    np.testing.assert_allclose(law.load[0], load, rtol=1e-9, atol=1e-9 * np.abs(load).max())
    np.testing.assert_allclose(law.run.force[0], SHARE * np.abs(load) * sign, rtol=1e-9, atol=1e-9)


SERVO = """
robid_robot: 1
name: servo
sample_time_s: 0.002
step_s: {step}
bodies:
  - {{joint: shoulder, axis: [0, 1, 0], mass: 0.5, centre_of_mass: [0, 0, -0.1],
     inertia: [[0, 0, 0], [0, 0, 0], [0, 0, 0]]}}
axes:
  shoulder:
    rotor_inertia: 0.0017
    torque_constant: 0.37
    torque_limit: 10
    speed_limit: 20
    servo: {{duty_gain: 1.15, supply_voltage: 7.4, resistance: 3.8}}
effects:
  gear:
    use: friction.quadratic_load
    on: shoulder
    with: {{coulomb: 0.005, load_coulomb: 0.11, load_square: 1.2, excess: 0.8, stribeck_speed: 0.43, viscous: 0.01,
           speed: 0.02}}
"""


def test_friction_that_grows_faster_than_its_load_holds_and_does_not_shake(tmp_path: Path) -> None:
    """Friction takes its own part of the load: with that of the step before, the simulation left all bounds.

    It did at any step, where ``dF/dT`` is above ``(J + I) / I = 1.3``. Steps of a millisecond and of a quarter agree
    within 0.02 rad of 1.3.
    """
    found = []
    for step in (1e-3, 2.5e-4):
        path = tmp_path / f"servo_{step}.yaml"
        path.write_text(SERVO.format(step=step))
        robot = Robot.load(str(path))
        time = 2e-3 * np.arange(3000)
        wanted = (0.9 * np.sin(2 * np.pi * 0.4 * time) + 0.4 * np.sin(2 * np.pi * 1.1 * time))[None, :, None]
        run = robot.simulate(np.gradient(wanted, 2e-3, axis=1), np.zeros((1, 1)), position_reference=wanted)
        found.append(run.position[0, :, 0])
    assert np.ptp(found[0]) > 1.0
    assert np.sqrt(((found[0] - found[1]) ** 2).mean()) < 0.02
