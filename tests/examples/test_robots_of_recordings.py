"""Robot files of published recordings: the torque of their motions is that of their bodies, but for friction.

No fit of bodies: a table or a coupling that is read wrong shows. What is told is held against what was recorded, with
an offset, Coulomb and viscous friction of each motor fitted beside. The figures in the tests are those of the files as
they are; they are no claims about the robots.
"""

from __future__ import annotations

import functools
import os
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pinocchio
import pytest
import scipy
from oracles.pinocchio_robot import PinocchioChain

from robid_core import Robot
from robid_core.mechanics import MotorMotion

FloatArray = npt.NDArray[np.float64]
PROJECT = Path(__file__).parents[2]
DATA = Path(os.environ.get("ROBID_DATA", PROJECT.parent / "shared" / "data"))
KUKA, STAUBLI = DATA / "kuka_kr300" / "trajectory_A.mat", DATA / "staubli_tx40"
EDGE_S = 0.4  # at both ends, where filters have not settled

kuka_data = pytest.mark.skipif(
    not KUKA.is_file(),
    reason=f"{KUKA} is absent; get it from github JonasWeigand/Robot_Identification and set ROBID_DATA",
)
staubli_data = pytest.mark.skipif(
    not (STAUBLI / "motor_torque.csv").is_file(),
    reason=f"{STAUBLI} is absent; get it from the examples of FIGAROH (github thanhndv212/figaroh) and set ROBID_DATA",
)


def robot_of(example: str, folder: Path | None = None, *changes: tuple[str, str]) -> Robot:
    """The robot of an example, or of a copy of its file in a folder with some texts replaced."""
    path = PROJECT / "examples" / example / "robot.yaml"
    if folder is None:
        return Robot.load(str(path))
    text = path.read_text()
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "changed.yaml").write_text(text)
    return Robot.load("changed.yaml", folder)


def smooth(values: FloatArray, sample_time_s: float, cutoff_hz: float) -> FloatArray:
    """Without phase, along the first axis."""
    b, a = scipy.signal.butter(4, cutoff_hz, fs=1 / sample_time_s)
    return np.asarray(scipy.signal.filtfilt(b, a, values, axis=0))


def torque_along(robot: Robot, motor_angle: FloatArray) -> FloatArray:
    """Motor torque that a robot takes for a motion, all that its file tells in it, (n_sample, n_axis)."""
    n_step = round(robot.sample_time_s / robot.step_s)
    motion = scipy.interpolate.CubicSpline(
        robot.sample_time_s * np.arange(len(motor_angle)), motor_angle, axis=0
    )
    speed = motion(robot.step_s * np.arange(n_step * (len(motor_angle) - 1) + 1), 1)
    steps = np.diff(speed, axis=0) / robot.step_s
    run = robot.prescribe(MotorMotion(motor_angle[:1], speed[:1], steps[None]))
    return np.asarray(run.torque[0])


def share_left(recorded: FloatArray, told: FloatArray, speed: FloatArray, width: float) -> FloatArray:
    """Standard deviation of what friction of each motor leaves of the difference, over that of the record, (n_axis,).

    `width` is that of Coulomb friction's change of sign, rad/s at the motor.
    """
    left = []
    for tau, model, v in zip(recorded.T, told.T, speed.T, strict=True):
        columns = np.stack([np.tanh(v / width), v, np.ones_like(v)], axis=1)
        difference = tau - model
        difference = difference - columns @ np.linalg.lstsq(columns, difference, rcond=None)[0]
        left.append(difference.std() / tau.std())
    return np.array(left)


@functools.cache
def kuka_recording() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Motor angles, speeds and torques below 10 Hz, (n_sample, 6) each."""
    record = scipy.io.loadmat(KUKA, struct_as_record=False, squeeze_me=True)["rec"]
    motor = robot_of("kuka_kr300").motor_angle(np.radians(record.act_pos_mot_deg.T))
    angle, torque = (smooth(x, 0.004, 10.0) for x in (motor, record.act_torque_abs_nm.T))
    return angle, np.gradient(angle, 0.004, axis=0), torque


def kuka_left(robot: Robot) -> FloatArray:
    angle, speed, torque = kuka_recording()
    told = torque_along(robot, angle)
    inner = slice(round(EDGE_S / 0.004), -round(EDGE_S / 0.004))
    return share_left(*(x[inner] for x in (torque[: len(told)], told, speed[: len(told)])), 2.5)


@kuka_data
def test_the_kuka_takes_the_recorded_torque() -> None:
    """Of axes 1 to 3 friction alone leaves 0.58, 0.75 and 0.70 of the torque."""
    left = kuka_left(robot_of("kuka_kr300"))
    assert (left[:3] < [0.23, 0.31, 0.46]).all(), left
    _, speed, torque = kuka_recording()
    inner = slice(100, -100)
    friction_alone = share_left(torque[inner], np.zeros_like(torque[inner]), speed[inner], 2.5)
    assert (left[:3] < 0.65 * friction_alone[:3]).all(), (left, friction_alone)
    assert (left < friction_alone).all(), (left, friction_alone)


@kuka_data
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("offset_deg: 180 ", "offset_deg: 90 "),
        ("offset_deg: -90\n", "offset_deg: 0\n"),
        ("convention: classic", "convention: modified"),
        ("rotation: [[1, 0, 0], [0, -1, 0], [0, 0, -1]]", "rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]"),
        ("mass: 200.0,", "mass: 0.0,"),
    ],
)
def test_a_kuka_that_is_read_wrong_does_not(old: str, new: str, tmp_path: Path) -> None:
    right = kuka_left(robot_of("kuka_kr300"))[:3]
    wrong = kuka_left(robot_of("kuka_kr300", tmp_path, (old, new)))[:3]
    assert np.linalg.norm(wrong) > 1.2 * np.linalg.norm(right), (wrong, right)


def test_the_kukas_cylinder_is_the_gas_spring_of_its_source() -> None:
    """Isothermal nitrogen in what the piston leaves of two bladders; vertical is 5 degrees from the shortest length."""
    robot = robot_of("kuka_kr300")
    without = robot.with_parameters({"effect.cylinder.preload": 0.0})
    area, held, moved = np.pi / 4 * (0.055**2 - 0.030**2), 0.8, 0.2
    for degrees in (-40.0, 0.0, 30.0, 70.0):
        turned = np.radians(degrees + 5.0)
        length = np.sqrt(held**2 + moved**2 - 2 * held * moved * np.cos(turned))
        volume = 2 * 0.48e-3 - area * (length - (held - moved))
        pressure = 1.01 * 296.8 * 328.0 * 2 * 0.0795 / volume
        expected = pressure * area * held * moved * np.sin(turned) / length
        still = np.tile(robot.motor_angle([0.0, np.radians(degrees), 0.0, 0.0, 0.0, 0.0]), (4, 1))
        torque = torque_along(robot, still) - torque_along(without, still)
        np.testing.assert_allclose(torque[0, 1] * 1872 / 7, expected, rtol=1e-4)  # digits of the file
        np.testing.assert_allclose(np.delete(torque, 1, axis=1), 0.0, atol=1e-9)


@functools.cache
def staubli_recording() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Motor angles, speeds and torques below 20 Hz, (n_sample, 6) each."""
    angle, torque = (
        smooth(np.loadtxt(STAUBLI / f"motor_{name}.csv", delimiter=",", skiprows=1), 0.0002, 20.0)
        for name in ("position", "torque")
    )
    return angle, np.gradient(angle, 0.0002, axis=0), torque


@staubli_data
def test_the_staubli_takes_the_recorded_torque() -> None:
    """Of axes 1 to 3 friction alone leaves 0.59, 0.72 and 0.42 of the torque."""
    robot = robot_of("staubli_tx40")
    angle, speed, torque = staubli_recording()
    told = torque_along(robot, angle)
    inner = slice(round(EDGE_S / 0.0002), -round(EDGE_S / 0.0002))
    torque, told, speed = (x[: len(told)][inner] for x in (torque, told, speed))
    left, friction_alone = (share_left(torque, model, speed, 1.0) for model in (told, np.zeros_like(told)))
    assert (left[:4] < [0.06, 0.08, 0.11, 0.11]).all(), left
    assert (left[:3] < 0.25 * friction_alone[:3]).all(), (left, friction_alone)
    assert (left < friction_alone).all(), (left, friction_alone)


@staubli_data
def test_the_staublis_table_is_its_urdf() -> None:
    """Joint frames, masses and inertias are those of the URDF, zeros of axes 2 and 3 apart; printed to 0.001."""
    model = pinocchio.buildModelFromUrdf(str(STAUBLI / "tx40_mdh_modified.urdf"))
    data, chain = model.createData(), PinocchioChain(robot_of("staubli_tx40").chain)
    zero = np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])
    for q in np.random.default_rng(0).uniform(-2, 2, (10, 6)):
        speed, acceleration = np.random.default_rng(1).uniform(-2, 2, (2, 6))
        theirs = pinocchio.rnea(model, data, q + zero, speed, acceleration)
        np.testing.assert_allclose(
            chain.force(q, speed, acceleration), theirs, rtol=0, atol=1e-8 * np.abs(theirs).max()
        )


def test_motors_of_the_coupled_wrist_share_the_torque_of_joint_six() -> None:
    """q = R^-1 q_motor, and torques of joints are R^T times those of motors."""
    robot = robot_of("staubli_tx40")
    r = np.diag([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
    r[5, 4] = 32.0
    motor = np.random.default_rng(2).uniform(-60, 60, (5, 6))
    angle = np.linalg.solve(r, motor.T).T
    np.testing.assert_allclose(robot.joint_angle(motor), angle, atol=1e-13)
    chain = PinocchioChain(robot.chain)
    gravity = np.array([chain.gravity(q) for q in angle])
    np.testing.assert_allclose(robot.gravity_torque(angle) @ r, gravity, rtol=0, atol=1e-9)
