"""Ladder in time: each model's computed torque drives the same plant along a fast motion, as in figure 2.1.

Feedforward of motor angle, speed and torque from the model, feedback by the cascade of the drives. What the tool is off
by is what the model does not know.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import FloatArray, Robot
from robid_core.mechanics.feedforward import Feedforward, MotorFriction, Tool, computed_torque, drive_signals
from robid_core.mechanics.tool import pose_of
from studies.model_ladder.models import with_position_gain

TOOL = Tool("axis_6", (0.25, 0.03, 0.06))
START = (-0.4, 0.2, -0.1, -0.3, 0.6, -0.5)  # rad, arm joints
END = (0.4, 0.8, -0.6, 0.5, 0.1, 0.5)
POSITION_GAIN = 15.0  # 1/s
DWELL_S = 0.4  # at the start, at the far end, and back at the start


@dataclass(frozen=True)
class Tracking:
    """One run of one model on the plant, at the sampling instants."""

    time_s: FloatArray
    """(n_sample,)."""
    motor_error: FloatArray
    """Motor angle less its reference, joint side, rad, (n_sample, n_axis)."""
    tool_error: FloatArray
    """Tool less its wanted place, world axes, m, (n_sample, 3)."""
    torque: FloatArray
    """N m, (n_sample, n_axis)."""
    stop: int
    """Sample at which the wanted motion stands at the far end."""


def wanted_motion(duration_s: float, sample_time: float) -> tuple[FloatArray, int]:
    """Arm joint angles (n_sample, n_axis) from START to END and back, and the sample where END is reached.

    A polynomial of degree 11, five derivatives zero at its ends: 2.7 times the mean speed at most.
    """
    dwell, length = round(DWELL_S / sample_time), round(duration_s / sample_time)
    n = 3 * dwell + 2 * length
    coefficients = [0.0] * 6 + [462.0, -1980.0, 3465.0, -3080.0, 1386.0, -252.0]
    sample = np.arange(n)
    there, back = (
        np.polynomial.polynomial.polyval(np.clip((sample - first) / length, 0, 1), coefficients)
        for first in (dwell, 2 * dwell + length)
    )
    angle = np.array(START) + np.subtract(END, START) * (there - back)[:, None]
    return angle, dwell + length


def model_feedforward(model: Robot, angle: FloatArray) -> Feedforward:
    """Computed torque of a model for the tool of this study."""
    drives = model.drives
    stiffness, damping = model.spring_arrays()
    friction = MotorFriction(drives.coulomb, drives.viscous, drives.friction_speed, drives.friction_offset)
    return computed_torque(
        model.mechanism, stiffness, damping, angle, model.sample_time_s, friction=friction, tool=TOOL
    )


def track(plant: Robot, model: Robot, duration_s: float, aligned: bool = True) -> Tracking:
    """Run a model's computed torque on a plant.

    The drive holds the arm before the motion starts; the feedforward is what comes on top of that. Not `aligned`, speed
    and torque are given for the instant at which they are read: half a sample late.
    """
    plant, sample_time = with_position_gain(plant, POSITION_GAIN), plant.sample_time_s
    angle, stop = wanted_motion(duration_s, sample_time)
    ask = model_feedforward(model, angle)
    speed, torque = drive_signals(ask, sample_time) if aligned else (ask.motor_speed, ask.torque)
    run = plant.simulate(
        speed[None],
        plant.joint_angle(ask.motor_angle[:1]),
        position_reference=ask.motor_angle[None],
        torque_feedforward=(torque - torque[0])[None],
        keep_coordinates=True,
    )
    assert run.coordinates is not None
    coordinates = run.coordinates[0]
    joint = coordinates @ plant.mechanism.constraint_map.T
    straight = np.zeros_like(joint)
    straight[:, plant.mechanism.arm] = angle
    actual, wanted = (pose_of(plant.chain, q, TOOL.body, TOOL.point).position for q in (joint, straight))
    return Tracking(
        np.asarray(sample_time * np.arange(len(angle)), dtype=np.float64),
        plant.joint_angle(coordinates[:, : plant.n_axis] - ask.motor_angle),
        actual - wanted,
        run.torque[0],
        stop,
    )


def summary(run: Tracking, dwell: int) -> dict[str, float]:
    """The numbers of a run, mm and mrad.

    tool: distance from the wanted place; path: the same, less what the tool is off by at the start (a robot's static
    sag is often calibrated away); swing: largest distance from where the tool is at the end of the dwell at the far
    end, during that dwell; motor: over all axes, joint side.
    """
    tool = 1e3 * np.linalg.norm(run.tool_error, axis=1)
    path = 1e3 * np.linalg.norm(run.tool_error - run.tool_error[0], axis=1)
    rest = run.tool_error[run.stop : run.stop + dwell]
    swing = 1e3 * np.linalg.norm(rest - rest[-1], axis=1)
    motor = 1e3 * run.motor_error
    return {
        "tool_rms_mm": float(np.sqrt(np.mean(tool**2))),
        "tool_max_mm": float(tool.max()),
        "path_rms_mm": float(np.sqrt(np.mean(path**2))),
        "path_max_mm": float(path.max()),
        "swing_max_mm": float(swing.max()),
        "motor_rms_mrad": float(np.sqrt(np.mean(motor**2))),
        "motor_max_mrad": float(abs(motor).max()),
    }
