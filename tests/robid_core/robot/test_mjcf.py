"""A robot written as MJCF: MuJoCo's model of the file is the robot's own, linearised about rest and in its limits.

Coordinates u of the file follow from those of the robot z = [motors; joints behind springs] by u = U z: a driven joint
turns by r_g q_m, the joint of a gear by the arm's angle less that.
"""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt
import pytest
from oracles.mujoco_robot import MujocoRobot
from oracles.robots import changed, drawn_robot

from robid_core import ConfigurationError, Robot
from robid_core.robot.mjcf import gear_joint_name, quaternion

FloatArray = npt.NDArray[np.float64]
STEP = 1e-6  # rad or m, of central differences


def model_of(robot: Robot) -> mujoco.MjModel:
    model = mujoco.MjModel.from_xml_string(robot.to_mjcf())
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS | mujoco.mjtDisableBit.mjDSBL_LIMIT
    return model


def coordinates(robot: Robot, model: mujoco.MjModel) -> FloatArray:
    """U, shape (n, n)."""
    own, mechanism = list(robot.mechanism.coordinate_names), robot.mechanism
    driven = {robot.chain.names[j]: axis for axis, j in enumerate(mechanism.arm)}
    gears = {gear_joint_name(robot, joint): joint for joint in driven}
    rows = np.zeros((model.nv, len(own)))
    for j in range(model.njnt):
        name = model.joint(j).name
        row = rows[model.jnt_qposadr[j]]
        if name in driven:
            row[: robot.n_axis] = robot.drives.gear[driven[name]]
        elif name in gears:
            row[: robot.n_axis] = -robot.drives.gear[driven[gears[name]]]
            row[own.index(gears[name])] = 1.0
        else:
            row[own.index(name)] = 1.0
    return rows


def acceleration(
    model: mujoco.MjModel, position: FloatArray, speed: FloatArray, torque: FloatArray
) -> FloatArray:
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = position, speed, torque
    mujoco.mj_forward(model, data)
    return np.array(data.qacc)


def mujoco_state_space(robot: Robot, angle: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """A and B of the file about the robot's rest, in the robot's coordinates; what is left there of free fall."""
    model = model_of(robot)
    u, rest = coordinates(robot, model), robot.equilibrium(angle[None])
    place, torque, n = u @ rest.position[0], rest.torque[0], model.nv
    still, back = np.zeros(n), np.linalg.inv(u)

    def slopes(moved: npt.NDArray[np.float64], of: int) -> FloatArray:
        columns = []
        for direction in moved.T:
            size = STEP / abs(direction).max()
            ends = []
            for sign in (1, -1):
                arguments = [place, still, torque]
                arguments[of] = arguments[of] + sign * size * direction
                ends.append(acceleration(model, *arguments))
            columns.append(back @ (ends[0] - ends[1]) / (2 * size))
        return np.array(columns).T

    a = np.block([[np.zeros((n, n)), np.eye(n)], [slopes(u, 0), slopes(u, 1)]])
    b = np.vstack([np.zeros((n, robot.n_axis)), slopes(np.eye(robot.n_axis), 2)])
    held, free = (acceleration(model, place, still, t) for t in (torque, 0 * torque))
    return a, b, float(abs(held).max() / abs(free).max())


def check(robot: Robot, angle: FloatArray) -> None:
    """1e-6 of the largest entry in each row: central differences of STEP round to 1e-9 of what springs give."""
    a, b, left = mujoco_state_space(robot, angle)
    ours = robot.linearize(angle, ("motor_angle",))
    scale = abs(ours.a).max(axis=1, keepdims=True)
    np.testing.assert_allclose(a / scale, ours.a / scale, rtol=0, atol=1e-6)
    np.testing.assert_allclose(b, ours.b, rtol=0, atol=1e-6 * abs(ours.b).max())
    assert left < 1e-6


@pytest.mark.parametrize("name", ["one_axis", "six_axis", "universal_arm", "seven_axis", "scara"])
def test_mujocos_linearisation_of_a_packaged_robot_is_ours(name: str) -> None:
    robot = Robot.load(name)
    lower, upper = (np.clip(ends, -2, 2) for ends in (robot.drives.lower, robot.drives.upper))
    check(robot, lower + np.random.default_rng(4).random(robot.n_axis) * (upper - lower))


@pytest.mark.parametrize(
    ("seed", "more"),
    [
        (1, {"tree": True, "prismatic": True, "n_bearing": 2}),
        (2, {"coupled": True, "n_bearing": 1}),
        (3, {"coupled": True, "prismatic": True, "n_bearing": 2}),
    ],
)
def test_trees_slides_and_coupled_gears_are_written(seed: int, more: dict[str, bool | int]) -> None:
    generator = np.random.default_rng(seed)
    robot = drawn_robot(generator, 4, **more)  # type: ignore[arg-type]
    check(robot, generator.normal(size=4) * 0.3)


@pytest.mark.parametrize("name", ["universal_arm", "scara"])
def test_in_motion_the_file_does_what_the_oracles_description_does(name: str) -> None:
    """Both are MuJoCo's, written by different code over different coordinates: equal to rounding."""
    robot = changed(Robot.load(name), every_axis={"friction": {"viscous": 2e-4}})
    model, oracle = model_of(robot), MujocoRobot(robot)
    u, n = coordinates(robot, model), oracle.model.nv
    generator = np.random.default_rng(5)
    angle = robot.equilibrium(generator.uniform(-0.1, 0.0, (1, robot.n_axis))).position[0]
    speed = np.linalg.solve(u, generator.normal(size=n))
    torque = generator.uniform(-1, 1, robot.n_axis) * robot.drives.torque_limit
    theirs = oracle.acceleration(angle, speed, torque)
    ours = np.linalg.solve(u, acceleration(model, u @ angle, u @ speed, torque))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9 * abs(theirs).max())


def test_rigid_gears_are_armatures() -> None:
    robot = changed(Robot.load("universal_arm"), every_axis={"gear": None})
    assert model_of(robot).nv == 6 + 2
    check(robot, np.array([0.3, -0.7, 0.9, 0.2, -0.4, 0.6]))


def test_friction_and_limits_are_those_of_the_motors_through_the_gear() -> None:
    robot = Robot.load("scara")
    model = mujoco.MjModel.from_xml_string(robot.to_mjcf())
    drives = robot.drives
    for axis, name in enumerate(robot.axis_names):
        joint, ratio = model.joint(name), 1 / drives.gear[axis, axis]
        place = int(joint.dofadr[0])
        assert model.dof_frictionloss[place] == pytest.approx(drives.coulomb[axis] * ratio, rel=1e-14)
        np.testing.assert_allclose(joint.range, [drives.lower[axis], drives.upper[axis]], rtol=1e-14)
        np.testing.assert_allclose(
            model.actuator(name).ctrlrange, np.array([-1, 1]) * drives.torque_limit[axis]
        )


def test_what_mujoco_lacks_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="no such flexible links, joint 'axis_2' carries one"):
        Robot.load("six_axis_flex").to_mjcf()
    pair = {"axis": (0.0, 1.0, 0.0), "mass": 2.0, "inertia": np.diag([0.02, 0.02, 0.02])}
    branches = changed(
        Robot.load("one_axis"),
        bodies=[{"joint": "left", **pair}, {"joint": "right", "translation": (0.5, 0.0, 0.0), **pair}],
        axes={name: {"rotor_inertia": 1e-3} for name in ("left", "right")},
        coupling=[[0.01, 0.002], [0.0, 0.01]],
    )
    with pytest.raises(
        ConfigurationError, match=r"the motor of left turns joints of different branches \(left, right"
    ):
        branches.to_mjcf()


def test_quaternions_give_the_rotation_back() -> None:
    for rotation in (np.eye(3), np.diag([1.0, -1, -1]), np.diag([-1.0, -1, 1]), np.diag([-1.0, 1, -1])):
        q, found = quaternion(rotation), np.zeros(9)
        mujoco.mju_quat2Mat(found, q)
        np.testing.assert_allclose(found.reshape(3, 3), rotation, atol=1e-15)
