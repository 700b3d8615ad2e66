"""Prescribed motion: the inverse of the simulator, from closed loops back to the torques that made them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robid_core import ConfigurationError, NotTrustworthy, Robot
from robid_core.mechanics import MechanicalModel
from robid_core.mechanics.prescribed import (
    MotorMotion,
    mean_over_smooth,
    periodic_motion,
    prescribe,
)
from robid_core.mechanics.response import hold_factor
from robid_core.mechanics.simulate import Simulation
from robid_core.robot.plant import standing

STEP = 2.5e-4
ANGLE = np.array(
    [[0.1, 0.5, 0.2, 0.1, 0.3, 0.1], [-0.6, 0.1, 0.4, -0.8, -0.4, 1.0], [0.9, -0.3, 0.0, 0.5, 0.9, 0.2]]
)
EVERYTHING = """\
effects:
  grease: {use: friction.stribeck, on: axis_2}
  load: {use: friction.load_dependent, on: axis_3, side: gear}
  bristle: {use: friction.lugre, on: axis_4}
  hard: {use: transmission.stiffening, on: axis_2}
  play: {use: transmission.backlash, on: axis_5, with: {gap: 3.0e-4}}
  hook: {use: transmission.bouc_wen, on: axis_6}
  tool: {use: load.payload, on: axis_6}
"""


def robot_of(folder: Path, text: str, base: str = "six_axis") -> Robot:
    path = folder / "robot.yaml"
    path.write_text(f"robid_robot: 1\nname: tried\nbase: {base}\n{text}")
    return Robot.load(str(path))


def shaken(robot: Robot, n_lane: int, n_sample: int, sample_time: float) -> np.ndarray:
    """Speed references that begin and end at rest."""
    generator = np.random.default_rng(2)
    time = np.arange(n_sample) * sample_time
    phase = generator.uniform(0, 2 * np.pi, (n_lane, 1, robot.n_axis))
    window = np.sin(np.pi * np.arange(n_sample) / n_sample)[:, None] ** 2
    return 8.0 * window * np.sin(2 * np.pi * 12 * time[:, None] + phase)


def integrated(angle: np.ndarray, step: float) -> MotorMotion:
    """The accelerations and speeds with which the integrator made these angles, from rest."""
    speed, found = np.zeros_like(angle[:, 0]), []
    for before, after in zip(angle[:, :-1].swapaxes(0, 1), angle[:, 1:].swapaxes(0, 1), strict=True):
        found.append(2 * (after - before - step * speed) / step**2)
        speed = speed + step * found[-1]
    return MotorMotion(angle[:, 0], np.zeros_like(angle[:, 0]), np.stack(found, axis=1))


def prescribed_again(robot: Robot, angle: np.ndarray, coordinates: np.ndarray) -> Simulation:
    """Prescribe what the motors did in a simulation that began at rest at these joint angles."""
    motion = integrated(coordinates[..., : robot.n_axis], STEP)
    state = standing(robot, robot.motor_angle(angle))
    (run,) = prescribe([model_of(robot)], [state], motion, sample_time=STEP, step=STEP, keep_coordinates=True)
    return run


def model_of(robot: Robot) -> MechanicalModel:
    return MechanicalModel(robot.mechanism, *robot.spring_arrays(), robot.forces)


@pytest.mark.parametrize("n_lane", [1, 3])
@pytest.mark.parametrize(
    ("base", "effects"), [("six_axis", ""), ("six_axis", EVERYTHING), ("one_axis", ""), ("six_axis_flex", "")]
)
def test_a_simulated_motion_gives_back_its_torques(
    tmp_path: Path, base: str, effects: str, n_lane: int
) -> None:
    robot = robot_of(tmp_path, effects, base)
    n_axis = robot.n_axis
    angle, reference = ANGLE[:n_lane, :n_axis], shaken(robot, n_lane, 400, STEP)
    run = robot.simulate(reference, angle, sample_time=STEP, step=STEP, keep_coordinates=True)
    assert run.coordinates is not None
    back = prescribed_again(robot, angle, run.coordinates)
    # Accelerations from angles: eps * 100 rad / h^2 * 400 steps of an alternating sum = 1.4e-4 rad/s^2, times an
    # inertia of 3e-3 kg m^2 at the motor; bodies move the angles by rounding only.
    np.testing.assert_allclose(back.torque, run.torque[:, :-1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(back.coordinates, run.coordinates[:, :-1], rtol=0, atol=1e-9)
    assert back.coordinates is not None
    np.testing.assert_array_equal(back.position, back.coordinates[..., :n_axis])


def test_rigid_gears_and_coupled_wrists_give_back_their_torques(tmp_path: Path) -> None:
    six = Robot.load("six_axis").description
    axes = {
        n: a.model_copy(update={"gear": None}) if n in ("axis_1", "axis_5") else a
        for n, a in six.axes.items()
    }
    gear = np.diag([1 / a.gear_ratio for a in six.axes.values()])
    gear[5, 4] = 0.3 * gear[4, 4]
    robot = Robot(six.model_copy(update={"axes": axes, "coupling": tuple(map(tuple, gear.tolist()))}))
    reference = shaken(robot, 3, 400, STEP)
    run = robot.simulate(reference, ANGLE, sample_time=STEP, step=STEP, keep_coordinates=True)
    assert run.coordinates is not None
    back = prescribed_again(robot, ANGLE, run.coordinates)
    np.testing.assert_allclose(back.torque, run.torque[:, :-1], rtol=0, atol=1e-6)


def test_lanes_and_threads_change_no_bit(tmp_path: Path) -> None:
    robot = robot_of(tmp_path, EVERYTHING)
    generator = np.random.default_rng(4)
    angle = generator.uniform(-0.5, 0.5, (11, 6))
    acceleration = 200 * generator.standard_normal((11, 80, 6))
    motor = robot.motor_angle(angle)
    motion = MotorMotion(motor, np.zeros((11, 6)), acceleration)
    state = standing(robot, motor)
    one, two = (robot.prescribe(motion, state, n_thread=n) for n in (1, 2))
    np.testing.assert_array_equal(one.torque, two.torque)
    assert one.torque.shape == (11, 20, 6)
    for lane in (0, 7, 10):
        alone = MotorMotion(motor[[lane]], np.zeros((1, 6)), acceleration[[lane]])
        single = robot.prescribe(alone, standing(robot, motor[[lane]]))
        np.testing.assert_array_equal(single.torque[0], one.torque[lane])


def test_a_run_goes_on_from_the_state_it_ended_in(tmp_path: Path) -> None:
    robot = robot_of(tmp_path, EVERYTHING)
    acceleration = 300 * np.random.default_rng(5).standard_normal((3, 160, 6))
    motor, still = robot.motor_angle(ANGLE), np.zeros((3, 6))
    whole = robot.prescribe(MotorMotion(motor, still, acceleration), standing(robot, motor))
    first = robot.prescribe(MotorMotion(motor, still, acceleration[:, :80]), standing(robot, motor))
    rest = MotorMotion(first.state.position[:, :6], first.state.speed[:, :6], acceleration[:, 80:])
    second = robot.prescribe(rest, first.state)
    np.testing.assert_array_equal(second.torque, whole.torque[:, 20:])


def test_a_motion_made_several_times_is_that_of_its_accelerations_one_time_after_another(
    tmp_path: Path,
) -> None:
    robot = robot_of(tmp_path, EVERYTHING)
    once = 300 * np.random.default_rng(6).standard_normal((3, 40, 6))
    motor, still = robot.motor_angle(ANGLE), np.zeros((3, 6))
    rest = standing(robot, motor)
    thrice = robot.prescribe(MotorMotion(motor, still, np.tile(once, (1, 3, 1))), rest)
    again = robot.prescribe(MotorMotion(motor, still, once), rest, periods=3)
    np.testing.assert_array_equal(again.torque, thrice.torque)
    np.testing.assert_array_equal(again.state.position, thrice.state.position)


def test_a_closed_loop_in_steady_state_gives_back_its_held_torques_below_a_tenth_of_the_sampling_rate() -> (
    None
):
    robot = Robot.load("six_axis").without_friction()  # whose corners a band limit cuts
    n_sample, time = 1000, np.arange(1000) * 1e-3
    generator = np.random.default_rng(7)
    reference = np.zeros((3, n_sample, 6))
    for line in (3, 7, 19, 37, 61, 79):
        phase = generator.uniform(0, 2 * np.pi, (3, 1, 6))
        reference += 1.5 * np.cos(2 * np.pi * line * time[:, None] + phase)
    run = robot.simulate(np.tile(reference, (1, 20, 1)), ANGLE, keep_coordinates=True)
    assert run.coordinates is not None
    last = slice(-n_sample, None)
    motor, torque = run.coordinates[:, last, :6], run.torque[:, last]
    still = standing(robot, motor[:, 0])
    drift = run.coordinates[:, -1, :6] - run.coordinates[:, -1 - n_sample, :6]
    assert abs(drift).max() < 2e-5
    motion = periodic_motion(motor, 1e-3, STEP, 400.0)
    twice = MotorMotion(motion.angle, motion.speed, np.tile(motion.acceleration, (1, 25, 1)))  # rings out
    state = still.moving(robot.mechanism, motion.speed)
    back = robot.prescribe(twice, state)
    ours, theirs = (np.fft.rfft(x, axis=1)[:, 1:100] for x in (back.torque[:, last], torque))
    line = np.arange(1.0, 100.0)
    held = hold_factor(2 * np.pi * line, 1e-3)[0]
    ours = ours / (mean_over_smooth(line, 1e-3, STEP) * held)[:, None]
    # Between the samples the motion is taken as band-limited; a held torque moves the motor with images too, at line f
    # by (f / (1 kHz - f))^3 of itself: 6e-4 at 79 Hz.
    error = np.sqrt((abs(ours - theirs) ** 2).sum(axis=1) / (abs(theirs) ** 2).sum(axis=1))
    assert error.max() < 1e-3


def test_what_is_no_motion_is_refused() -> None:
    robot = Robot.load("six_axis")
    motor = robot.motor_angle(ANGLE)
    state = standing(robot, motor)
    gap, endless = np.zeros((3, 80, 6)), np.zeros((3, 80, 6))
    gap[2, -1, 5], endless[0, 0, 0] = np.nan, np.inf
    for acceleration, why in (
        (np.zeros((3, 81, 6)), "4 steps a sample"),
        (np.zeros((3, 80, 5)), "give"),
        (gap, "NaN or infinite"),
        (endless, "NaN or infinite"),
    ):
        with pytest.raises(ConfigurationError, match=why):
            robot.prescribe(MotorMotion(motor, np.zeros((3, 6)), acceleration), state)
    wild = MotorMotion(motor, np.zeros((3, 6)), np.full((3, 4000, 6), 1e7))
    with pytest.raises(NotTrustworthy, match="prescribe: lane 0 left all bounds"):
        robot.prescribe(wild, state)
