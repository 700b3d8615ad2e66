"""Measurements on MuJoCo's robot: another engine for bodies and springs, friction and control compiled beside it.

The robot is written from its file (`tests/oracles/mjcf.py`). Controller, encoder, friction and ripple are a callback of
MuJoCo in machine code, so that one call runs a whole experiment; they know nothing of robid's kernels.
"""

from __future__ import annotations

import functools
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

if str(Path(__file__).parents[2] / "tests") not in sys.path:
    sys.path.append(str(Path(__file__).parents[2] / "tests"))

from oracles.callback import STAGES, compiled, counts, installed, table
from oracles.drives import of_axes
from oracles.mjcf import mjcf

from robid_core import FloatArray, Robot

STEPS = 4  # of MuJoCo a sample
(POSITION, SPEED, APPLIED, CONTROL, REFERENCE, NOISE, MEASURED, DEMANDED, MOTORS, LOOP, COUNTS) = range(11)
(N_AXIS, N_STEP, N_LATE, CALL) = range(4)  # of COUNTS
(COULOMB, VISCOUS, OFFSET, ZERO_SPEED, BREAKAWAY, STRIBECK_SPEED, EXPONENT, RIPPLE, RIPPLE_ORDER, WAVE, WAVE_ORDER,
 SPEED_GAIN, INTEGRAL_GAIN, POSITION_GAIN, FEEDFORWARD, LIMIT, COUNTS_PER_RAD) = range(17)  # fmt: skip
(WANTED, LAST, INTEGRAL, TORQUE, PREVIOUS) = range(5)  # of LOOP


def _act(_model, _data):  # type: ignore[no-untyped-def]
    counted = counts(COUNTS)
    n_axis, n_step = counted[N_AXIS], counted[N_STEP]
    call = counted[CALL]
    counted[CALL] = call + 1
    step, stage = call // STAGES, call % STAGES
    sample, part = step // n_step, step % n_step
    position, speed = table(POSITION, 1, n_axis)[0], table(SPEED, 1, n_axis)[0]
    applied, control = table(APPLIED, 1, n_axis)[0], table(CONTROL, 1, n_axis)[0]
    motors, loop = table(MOTORS, 17, n_axis), table(LOOP, 6, n_axis)
    if stage == 0 and part == 0:
        reference, noise = (
            table(REFERENCE, sample + 1, n_axis)[sample],
            table(NOISE, sample + 1, n_axis)[sample],
        )
        measured, demanded = table(MEASURED, sample + 1, n_axis), table(DEMANDED, sample + 1, n_axis)
        time = loop[5, 0]
        for a in range(n_axis):
            angle = position[a] + motors[WAVE, a] * np.sin(motors[WAVE_ORDER, a] * position[a]) + noise[a]
            if motors[COUNTS_PER_RAD, a] > 0:
                angle = np.rint(angle * motors[COUNTS_PER_RAD, a]) / motors[COUNTS_PER_RAD, a]
            rate = (angle - loop[LAST, a]) / time
            if sample == 0:
                rate = 0.0
            loop[LAST, a] = angle
            error = motors[FEEDFORWARD, a] * reference[a] - rate
            error += motors[POSITION_GAIN, a] * (loop[WANTED, a] - angle)
            loop[WANTED, a] += time * reference[a]
            loop[INTEGRAL, a] += time * motors[INTEGRAL_GAIN, a] * error
            torque = motors[SPEED_GAIN, a] * error + loop[INTEGRAL, a]
            loop[PREVIOUS, a] = loop[TORQUE, a]
            loop[TORQUE, a] = min(max(torque, -motors[LIMIT, a]), motors[LIMIT, a])
            measured[sample, a] = angle
            demanded[sample, a] = loop[TORQUE, a]
    row = PREVIOUS if part < counted[N_LATE] else TORQUE
    for a in range(n_axis):
        v = speed[a]
        excess = motors[BREAKAWAY, a] * np.exp(-((abs(v) / motors[STRIBECK_SPEED, a]) ** motors[EXPONENT, a]))
        level = motors[COULOMB, a] + excess
        applied[a] = -level * np.tanh(v / motors[ZERO_SPEED, a]) - motors[VISCOUS, a] * v - motors[OFFSET, a]
        control[a] = loop[row, a] + motors[RIPPLE, a] * np.sin(motors[RIPPLE_ORDER, a] * position[a])


@functools.cache
def _compiled() -> Any:
    return compiled(_act)


@dataclass(frozen=True)
class Hidden:
    """What a plant has beside its robot file, every field of shape (n_axis,) but the lag."""

    breakaway: FloatArray
    """Excess over the Coulomb level at standstill, N m."""
    stribeck_speed: FloatArray
    """rad/s."""
    exponent: FloatArray
    ripple: FloatArray
    """Of the torque, N m."""
    ripple_order: FloatArray
    """Per turn of the motor."""
    wave: FloatArray
    """Of the measured angle, rad."""
    wave_order: FloatArray
    late: float
    """Samples after which a torque acts; whole steps of MuJoCo."""

    @classmethod
    def nothing(cls, n_axis: int) -> Hidden:
        """Return a plant without anything hidden."""
        zero, one = np.zeros(n_axis), np.ones(n_axis)
        return cls(zero, one, one, zero, one, zero, one, 0.0)


def described(robot: Robot, step: float) -> str:
    """MuJoCo's description of a robot; payloads are bodies of their own, fixed to the ones that carry them."""
    payloads = {
        label: entry for label, entry in robot.description.effects.items() if entry.use == "load.payload"
    }
    root = ElementTree.fromstring(mjcf(robot.without_effect(*payloads), "RK4", step))
    for label, entry in payloads.items():
        size = entry.with_
        moment = size["mass"] * size["radius_of_gyration"] ** 2
        place = " ".join(repr(size[key]) for key in "xyz")
        carrier = next(body for body in root.iter("body") if body.get("name") == f"body.{entry.on}")
        body = ElementTree.SubElement(carrier, "body", {"name": f"payload.{label}", "pos": place})
        inertial = {"pos": "0 0 0", "mass": repr(size["mass"]), "diaginertia": " ".join([repr(moment)] * 3)}
        ElementTree.SubElement(body, "inertial", inertial)
    return ElementTree.tostring(root, encoding="unicode")


class ForeignPlant:
    """MuJoCo's model of a robot with linear springs and motor friction, in closed loop."""

    def __init__(self, robot: Robot, hidden: Hidden, steps: int = STEPS) -> None:
        self.robot, self.hidden, self.steps = robot, hidden, steps
        self.model = mujoco.MjModel.from_xml_string(described(robot, robot.sample_time_s / steps))
        self.data = mujoco.MjData(self.model)
        friction = [of_axes(robot, "friction", key) for key in ("coulomb", "viscous", "offset", "speed")]
        loop = [
            of_axes(robot, "controller", key)
            for key in ("speed_gain", "integral_gain", "position_gain", "speed_feedforward")
        ]
        self.motors = np.ascontiguousarray(
            [
                *friction, hidden.breakaway, hidden.stribeck_speed, hidden.exponent,
                hidden.ripple, hidden.ripple_order, hidden.wave, hidden.wave_order, *loop,
                of_axes(robot, "torque_limit"), of_axes(robot, "sensors", "encoder_counts") / (2 * np.pi),
            ]
        )  # fmt: skip

    def measure(
        self,
        reference: FloatArray,
        angle: FloatArray,
        generator: np.random.Generator,
        torque_noise: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Measured motor angle and torque of one experiment, (n_sample, n_axis) each.

        Parameters
        ----------
        reference
            Motor speed, rad/s, (n_sample, n_axis).
        angle
            Joint-side motor angles at the start, (n_axis,).
        generator
            Draws the sensors' noise; that of the angle acts through the controller.
        torque_noise
            Standard deviation, N m, (n_axis,).
        """
        robot, data, n_axis = self.robot, self.data, self.robot.n_axis
        reference = np.ascontiguousarray(reference, dtype=np.float64)
        deviation = of_axes(robot, "sensors", "position_noise")
        noise = generator.standard_normal(reference.shape) * deviation
        measured, demanded = np.zeros_like(reference), np.zeros_like(reference)
        rest, hold = robot.equilibrium(angle[None]).position[0], robot.gravity_torque(angle[None])[0]
        mujoco.mj_resetData(self.model, data)
        data.qpos[:] = rest
        loop = np.zeros((6, n_axis))
        loop[WANTED] = loop[LAST] = rest[:n_axis]
        loop[INTEGRAL] = loop[TORQUE] = loop[PREVIOUS] = hold
        loop[5] = robot.sample_time_s
        late = round(self.hidden.late * self.steps)
        numbers = np.array([n_axis, self.steps, late, 0], dtype=np.int64)
        arrays = (data.qpos, data.qvel, data.qfrc_applied, data.ctrl, reference, noise, measured, demanded)
        with installed(_compiled(), (*arrays, self.motors, loop, numbers)):
            mujoco.mj_step(self.model, data, len(reference) * self.steps)
        if not np.isfinite(measured).all():
            raise RuntimeError("MuJoCo's simulation left all bounds")
        return measured, demanded + generator.standard_normal(demanded.shape) * torque_noise
