"""Arms whose torque along a motion pinocchio computes, friction written out here, as records of a drive."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from robid_core import Channel, DenseRun, Record, Robot

STEP = 1e-3
DRIVE = {"torque_limit": 1e3, "speed_limit": 1e3, "controller": {"speed_gain": 0.1}}
TILT = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]  # turns the z axis into the horizontal
# Two coupled revolute axes and a slide on top, all excited by gravity or motion.
ARM: dict[str, Any] = {
    "robid_robot": 1,
    "name": "arm",
    "bodies": [
        {"joint": "j1", "rotation": TILT, "mass": 8.0, "centre_of_mass": [0.2, 0.05, 0.0],
         "inertia": [[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.25]]},
        {"joint": "j2", "parent": "j1", "translation": [0.5, 0, 0], "mass": 5.0, "centre_of_mass": [0.15, 0, 0.02],
         "inertia": [[0.05, 0, 0], [0, 0.06, 0], [0, 0, 0.08]]},
        {"joint": "j3", "parent": "j2", "type": "prismatic", "axis": [1, 0, 0], "translation": [0.3, 0, 0], "mass": 2.0,
         "inertia": [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]]},
    ],
    "axes": {
        f"j{i}": {**DRIVE, "rotor_inertia": j, "friction": {"coulomb": c, "viscous": v, "offset": o, "speed": 0.05}}
        for i, j, c, v, o in ((1, 2e-3, 0.4, 0.02, 0.05), (2, 1e-3, 0.3, 0.01, -0.04), (3, 0.5, 3.0, 5.0, 0.2))
    },
    "coupling": [[0.02, 0, 0], [0.004, -0.025, 0], [0, 0, 1.0]],
}  # fmt: skip


def loaded(folder: Path, data: dict[str, Any]) -> Robot:
    path = folder / f"{data['name']}.yaml"
    path.write_text(json.dumps(data))
    return Robot.load(path.name, folder)


def pinocchio_model(robot: Robot) -> pin.Model:
    chain, model = robot.chain, pin.Model()
    for j in range(chain.n_coordinate):
        axis = chain.axis[j]
        prismatic = chain.joint_type[j] == 1
        joint = pin.JointModelPrismaticUnaligned(axis) if prismatic else pin.JointModelRevoluteUnaligned(axis)
        placement = pin.SE3(chain.rotation[j], chain.translation[j])
        index = model.addJoint(int(chain.parent[j]) + 1, joint, placement, chain.names[j])
        model.appendBodyToJoint(
            index, pin.Inertia(chain.mass[j], chain.centre_of_mass[j], chain.inertia[j]), pin.SE3.Identity()
        )
    model.gravity.linear = chain.gravity
    return model


def waves(
    n_axis: int, size: np.ndarray, seconds: float, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint motion as a sum of slow sines, with exact derivatives."""
    draw, time = np.random.default_rng(seed), np.arange(round(seconds / STEP)) * STEP
    omega = 2 * np.pi * draw.uniform(0.2, 1.2, (6, n_axis))
    phase, amplitude = draw.uniform(0, 2 * np.pi, (6, n_axis)), size * draw.uniform(0.2, 1, (6, n_axis))
    angle = omega[None] * time[:, None, None] + phase
    return (
        (amplitude * np.sin(angle)).sum(axis=1),
        (amplitude * omega * np.cos(angle)).sum(axis=1),
        -(amplitude * omega**2 * np.sin(angle)).sum(axis=1),
    )


def recording(
    robot: Robot, seed: int, seconds: float = 20.0, noise: float = 0.0, smooth_friction: bool = True
) -> Record:
    """What a drive would record: the torque comes from pinocchio and from friction written out here."""
    size = np.where(robot.chain.joint_type == 1, 0.05, 0.4)
    q, v, a = waves(robot.n_axis, size, seconds, seed)
    model = pinocchio_model(robot)
    data = model.createData()
    joint_torque = np.array([pin.rnea(model, data, *row) for row in zip(q, v, a, strict=True)])
    motor = [np.linalg.solve(robot.drives.gear, part.T).T for part in (q, v, a)]
    d = robot.drives
    direction = np.tanh(motor[1] / d.friction_speed) if smooth_friction else np.sign(motor[1])
    torque = joint_torque @ d.gear + d.rotor_inertia * motor[2] + d.viscous * motor[1]
    torque = torque + d.coulomb * direction + d.friction_offset
    torque += noise * np.random.default_rng(seed + 1000).normal(size=torque.shape)
    return record_of(robot, motor[0], torque)


def record_of(robot: Robot, position: np.ndarray, torque: np.ndarray, valid: bool = True) -> Record:
    def channel(values: np.ndarray, unit: str) -> Channel:
        return Channel("motor", unit, values[None, None, None, None])

    n = len(position)
    run = DenseRun(
        sample_time_s=STEP,
        channels={"motor_position": channel(position, "rad"), "motor_torque": channel(torque, "N m")},
        time_s=np.arange(n) * STEP,
        valid=np.full((1, 1, 1, 1, n), valid),
    )
    return Record(robot.axis_names, "computed", "continuous", (run,), np.zeros((1, robot.n_axis)))


def slide(folder: Path, **changes: Any) -> Robot:
    data = {
        "robid_robot": 1,
        "name": "slide",
        "bodies": [{"joint": "x", "type": "prismatic", "axis": [1, 0, 0], "mass": 90.0}],
        "axes": {"x": {**DRIVE, "rotor_inertia": 5.0, "friction": {"coulomb": 20.0, "viscous": 200.0, "offset": -3.0,
                                                                 "speed": 1e-3}}},
        **changes,
    }  # fmt: skip
    return loaded(folder, data)


def sticking(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Moves of a slide with rests between, where friction holds any force below its level: 20 N, sliding or not."""
    draw, time = np.random.default_rng(seed), np.arange(600) * STEP
    move = np.concatenate((np.zeros(200), 0.5 - 0.5 * np.cos(np.pi * time / 0.6), np.ones(200)))
    angle, force = [], []
    at, level = 0.0, 0.0
    for _ in range(16):
        to = draw.uniform(-0.4, 0.4)
        part = at + (to - at) * move
        velocity = np.gradient(part, STEP)
        held = np.where(np.arange(1000) < 200, level, draw.uniform(-20, 20))
        friction = np.where(velocity != 0, 20.0 * np.sign(velocity), held)
        inertia = 95.0 * np.gradient(velocity, STEP)
        angle.append(part)
        force.append(inertia + 200.0 * velocity + friction - 3.0)
        at, level = to, held[-1]
    force_of_all = np.concatenate(force)
    return np.concatenate(angle)[:, None], (force_of_all + draw.normal(0, 0.5, len(force_of_all)))[:, None]
