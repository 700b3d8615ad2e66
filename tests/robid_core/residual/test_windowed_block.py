"""Records that do not repeat: spectra under a window, free vibration, and the torque of a cut of a simulated motion."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from oracles.slide import STEP, exact_run, reference, slide

from robid_core import DataRejected, FreeParameters, Robot
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.windowed import windowed_motion_of
from robid_core.mechanics import MotorMotion
from robid_core.residual import TorqueProblem, WindowedBlock, solve
from robid_core.residual.free_vibration import deviation_of, free_vibration, rms_vibration

T, N = 1e-3, 4000


@pytest.fixture(scope="module")
def robot(ideal: Robot) -> Robot:
    """Six axes without Coulomb friction, ideal sensors."""
    levels = [n for n in ideal.layout if n.endswith(".coulomb") and n.startswith("friction.")]
    return ideal.with_parameters(dict.fromkeys(levels, 0.0))


def speeds(n_sample: int, n_lane: int) -> np.ndarray:
    """Multisines of 4.5 to 70 Hz on a slow sine, one a lane."""
    generator, time = np.random.default_rng(3), T * np.arange(n_sample)
    speed = 9 * np.sin(np.pi * time)[None, :, None] * np.ones((n_lane, 1, 6))
    for hertz in (4.5, 10.3, 23.1, 47.3, 69.7):
        phase = generator.uniform(0, 2 * np.pi, (n_lane, 1, 6))
        speed = speed + 5 * np.sin(2 * np.pi * hertz * time[None, :, None] + phase)
    return speed


def test_acceleration_of_a_cut_is_that_of_the_motion() -> None:
    """A parabola and a sine, by their closed forms; the corner of the continuation is under the taper."""
    time = T * np.arange(N)
    angle = 0.3 * time**2 + 0.02 * np.sin(2 * np.pi * 7.3 * time + 0.4)
    second = 0.6 - 0.02 * (2 * np.pi * 7.3) ** 2 * np.sin(2 * np.pi * 7.3 * time + 0.4)
    motion = windowed_motion_of(angle[None, None, :, None], second[None, None, :, None], T, 80.0)
    error = (
        motion.acceleration_spectrum - motion.torque_spectrum
    )  # the "torque" is the true second derivative
    assert abs(error).max() < 1e-3 * abs(motion.torque_spectrum).max()


def test_what_comes_earlier_is_the_torque_and_not_the_window() -> None:
    """Half a sample, and three: a weight of 10 N m under the window has no delay, and a wave on it has.

    Turning the windowed spectrum instead moves the weight's taper, by 10 N m times its slope: 30 times the tolerance.
    """
    time = T * np.arange(N)

    def torque(late: float) -> np.ndarray:
        return 10.0 + 0.5 * np.sin(2 * np.pi * 7.3 * (time - late) + 0.4)[None, None, :, None]

    for late in (0.5 * T, 3 * T):
        motion, exact = (windowed_motion_of(torque(0.0), torque(by), T, 80.0) for by in (late, 0.0))
        found = motion.advanced_torque(np.array([late]))
        wrong = np.exp(1j * motion.omega[:, None] * late) * motion.torque_spectrum
        tolerance = 10.0 * late * 1e-2  # the continuation of a wave has a corner at the ends
        assert abs(found - exact.torque_spectrum).max() < tolerance
        assert abs(wrong - exact.torque_spectrum).max() > 30 * tolerance
        step = 1e-3 * T
        ends = [exact.advanced_torque(np.array([by])) for by in (-step, step)]
        slope = exact.advancing(exact.torque_spectrum)
        assert abs(slope - (ends[1] - ends[0]) / (2 * step)).max() < 1e-2 * abs(slope).max()


def test_free_vibration_is_that_of_the_simulator(robot: Robot) -> None:
    """Motors held, deflections deviate by what bends torques by a tenth of a N m: the difference of two runs."""
    angle = np.array([[0.3, 0.4, -0.3, 0.5, 0.6, 0.2]])
    motor = np.tile(robot.motor_angle(angle)[:, None, None], (1, 1, N, 1))
    motion = windowed_motion_of(motor, np.zeros_like(motor), T, 80.0)
    still = MotorMotion(motor[0, :, 0], np.zeros((1, 6)), np.zeros((1, N * 4, 6)))
    rest = robot.standing(angle)
    n_behind = rest.position.shape[1] - 6
    deviation = 1e-6 * np.random.default_rng(1).standard_normal(2 * n_behind)
    deviation[n_behind:] *= 50.0
    position, speed = rest.position.copy(), rest.speed.copy()
    position[:, 6:] += deviation[:n_behind]
    speed[:, 6:] += deviation[n_behind:]
    moved = robot.prescribe(still, dataclasses.replace(rest, position=position, speed=speed))
    torque = moved.torque - robot.prescribe(still, rest).torque
    theirs = motion.spectrum_of(torque[None])[0, 0]
    ours = (free_vibration(robot, motion)[0, 0] @ deviation) * motion.hold[:, None]
    # The simulator's torque is the mean over a sample, half a sample later; its first step begins without acceleration.
    half = np.exp(1j * motion.omega * T / 2)[:, None]
    assert abs(theirs - ours * half).max() < 0.02 * abs(theirs).max()


def test_a_start_in_motion_is_found_and_the_torque_given_back(robot: Robot) -> None:
    """A cut from the middle of a simulated motion: better starts leave a twentieth of what the first left."""
    reference = speeds(3000 + N, 2)
    run = robot.simulate(reference, np.tile([0.3, 0.4, -0.3, 0.5, 0.6, 0.2], (2, 1)))
    position, torque = (values[None, :, 3000:] for values in (run.position, run.torque))
    told = {f"sensors.{axis}.torque_noise": 0.01 for axis in robot.axis_names}
    noisy = robot.with_parameters({name: value for name, value in told.items() if name in robot.layout})
    assert "sensors.axis_1.torque_noise" in robot.layout
    block = WindowedBlock.of_record(
        noisy, windowed_motion_of(position, torque, T, 80.0), SpeedFunctions.of_widths((0.5,), 6)
    )
    free = FreeParameters.of_robot(noisy, ("friction.axis_1.viscous",))
    nothing, weight = np.zeros((3, 6)), np.tile(np.eye(6, dtype=complex), (len(block.motion.bin), 1, 1))
    left = []
    for _ in range(5):
        block.renew(free, np.zeros(1))
        residual = block.residual(block.predicted(noisy, np.zeros(1), nothing), 0.0)
        left.append(
            np.sqrt((np.abs(residual) ** 2).sum() / (np.abs(block.motion.torque_spectrum) ** 2).sum())
        )
        block.improve_initial_state(noisy, residual, 1e3 * weight)
    assert left[0] > 20 * left[-1]
    assert left[-1] < 3e-3


def test_derivatives_by_the_linear_model_over_time_are_those_of_two_prescribed_motions(robot: Robot) -> None:
    """About one pose, ringing from before the first sample, the motor of one axis drifting through its cut.

    0.01 rad at the joints change the linear model by about a hundredth, and what it rings with for a few periods by
    some. The linear model's spectra, windowed before they are
    filtered, miss more than a tenth of most derivatives.
    """
    names = ("gear_stiffness.axis_1", "bearing_damping.axis_2_x", "mass.axis_6", "centre_of_mass.axis_3.x")
    names += ("friction.axis_2.viscous", "rotor_inertia.axis_4")
    told = robot.with_parameters({f"sensors.{axis}.torque_noise": 0.01 for axis in robot.axis_names})
    time = T * np.arange(N)
    moved = np.cumsum(speeds(N, 2) - 9 * np.sin(np.pi * time)[None, :, None], axis=1) * T
    moved[:, :, 2] += 0.2 * time
    motor = moved + robot.motor_angle([0.3, 0.4, -0.3, 0.5, 0.6, 0.2])
    motion = windowed_motion_of(motor[None], np.zeros((1, 2, N, 6)), T, 80.0)
    block = WindowedBlock.of_record(told, motion, SpeedFunctions.of_widths((0.5,), 6))
    block.deviation = rms_vibration(told, block.angle, motion)[:, None] * np.array([1.0, -0.5])[:, None]
    free = FreeParameters.of_robot(told, names)
    block.renew(free, np.zeros(len(names)))
    rows = []
    for by_motion in ("bent", "all"):
        block.by_motion = by_motion
        block.differentiate(free, np.zeros(len(names)))
        rows.append([column.remainder + column.linear for column in block.simulated])
    spectra = [column.linear for column in block.simulated]
    assert len(spectra) == len(names)
    missed = []
    for name, ours, theirs, alone in zip(names, *rows, spectra, strict=True):
        assert np.linalg.norm(ours - theirs) < 0.03 * np.linalg.norm(theirs), name
        missed.append(np.linalg.norm(alone - theirs) / np.linalg.norm(theirs))
    assert np.median(missed) > 0.1


def test_deviations_that_are_seen_are_found(robot: Robot) -> None:
    """Of torques made from known deviations, in units of what is usual, those of slow modes to a hundredth."""
    motor = np.cumsum(speeds(N, 1), axis=1) * T + robot.motor_angle([0.3, 0.4, -0.3, 0.5, 0.6, 0.2])
    motion = windowed_motion_of(motor[None], np.zeros((1, 1, N, 6)), T, 80.0)
    vibration = free_vibration(robot, motion)
    prior = rms_vibration(robot, robot.joint_angle(motor.mean(axis=1)), motion)
    share = np.random.default_rng(2).standard_normal(vibration.shape[-1])
    residual = (vibration @ (share * prior[0]))[None, 0]
    weight = np.tile(1e4 * np.eye(6, dtype=complex), (len(motion.bin), 1, 1))
    found = deviation_of(residual, vibration, weight, prior)
    left = residual - np.einsum("cxfak,cxk->cxfa", vibration, found)
    assert np.abs(left).max() < 1e-3 * np.abs(residual).max()


def test_a_robot_that_tells_no_noise_is_refused(robot: Robot) -> None:
    motor = np.zeros((1, 1, N, 6))
    with pytest.raises(DataRejected, match="sensors: {torque_noise"):
        WindowedBlock.of_record(
            robot, windowed_motion_of(motor, motor, T, 80.0), SpeedFunctions.of_widths((0.5,), 6)
        )
    with pytest.raises(DataRejected, match="A05"):
        windowed_motion_of(motor * np.nan, motor, T, 80.0)
    with pytest.raises(DataRejected, match="a band up to 900 Hz"):
        windowed_motion_of(motor, motor, T, 900.0)


def test_a_rigid_axis_has_no_initial_state_that_is_unknown(tmp_path: Path) -> None:
    """Cuts of a mass on a slide, computed in closed form: its mass comes out of them within 0.2 %."""
    told = slide(tmp_path, coulomb=0.0)
    axis = told.description.axes["x"]
    sensors = axis.sensors.model_copy(update={"torque_noise": 1.0, "position_noise": 1e-8})
    axes = {"x": axis.model_copy(update={"sensors": sensors})}
    robot = dataclasses.replace(told, description=told.description.model_copy(update={"axes": axes}))
    robot = robot.with_parameters({"mass.x": 1.3 * told.parameter("mass.x")})
    position, force = exact_run(reference(6000), 0.1)
    rows = (1, 2, 3000, 1)
    motion = windowed_motion_of(position.reshape(rows), force.reshape(rows), STEP, 80.0)
    laws = SpeedFunctions.of_widths((0.01,), 1)
    block = WindowedBlock.of_record(robot, motion, laws)
    assert block.free_vibration(robot) is None
    free = FreeParameters.of_robot(robot, ("friction.x.viscous", "mass.x"), {"mass.x": 1.0})
    problem = TorqueProblem(free, (block,), laws.names)
    found = free.values(solve(problem, 4, 1e-4, lambda *_: None).point[:2])["mass.x"]
    assert found == pytest.approx(told.parameter("mass.x"), rel=2e-3)
