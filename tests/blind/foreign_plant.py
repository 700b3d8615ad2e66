"""A plant on MuJoCo with hidden laws: bodies, springs and integration are MuJoCo's, all else stands here.

Controller, encoder, friction and hidden laws are a callback in machine code that MuJoCo calls in each of the four
stages of Runge and Kutta's method.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from oracles.callback import STAGES, compiled, counts, installed, table
from oracles.drives import of_axes
from oracles.mjcf import mjcf
from oracles.mujoco_robot import MujocoRobot

from blind import laws
from blind.standing import Base, on_base
from robid_core import Robot

FloatArray = npt.NDArray[np.float64]

MOST, NUMBERS = 2, 8  # hidden laws; numbers of a law
STEPS = 4  # of MuJoCo, a sample: what is left of a plant that hides nothing is the same with 2 and with 16
LOST = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
(POSITION, SPEED, APPLIED, CONTROL, REFERENCE, NOISE, MEASURED, DEMANDED, MOTORS, LOOP, COUNTS, LAWS, SEEN, GEARS,
 MEMORY, EXACT) = range(16)  # fmt: skip
(N_AXIS, N_STEP, N_DOF, CALL) = range(4)
(COULOMB, VISCOUS, ZERO_SPEED, SPEED_GAIN, INTEGRAL_GAIN, POSITION_GAIN, FEEDFORWARD, LIMIT, COUNTS_PER_RAD, STIFFNESS,
 DAMPING, LATE) = range(12)  # fmt: skip
(WANTED, LAST, INTEGRAL, TORQUE, PREVIOUS, TIME, FILTERED, MEAN) = range(8)
(LAW, AXIS) = range(2)  # of LAWS, before the numbers
ON_SIGNALS = (laws.NOTHING, laws.RESOLVER, laws.RIPPLE, laws.SATURATION, laws.LAG, laws.GAIN)


class Unbounded(RuntimeError):
    """A simulation that left all bounds: its plant is unstable, or its steps are too long for what is stiff in it."""


@dataclass(frozen=True, eq=False)
class HiddenLaw:
    """A law and where it acts."""

    law: int
    axis: int
    numbers: tuple[float, ...]
    """First, second, ..., as `laws` names them; the place's spring and damper are put in."""
    row: FloatArray
    """Coordinate over the robot's generalised ones, (n_coordinate,)."""


def _act(_model, _data):  # type: ignore[no-untyped-def]
    counted = counts(COUNTS)
    n_axis, n_step, n_dof, call = counted[N_AXIS], counted[N_STEP], counted[N_DOF], counted[CALL]
    counted[CALL] = call + 1
    step, stage = call // STAGES, call % STAGES
    sample, part = step // n_step, step % n_step
    position, speed = table(POSITION, 1, n_dof)[0], table(SPEED, 1, n_dof)[0]
    applied, control = table(APPLIED, 1, n_dof)[0], table(CONTROL, 1, n_axis)[0]
    motors, loop = table(MOTORS, 12, n_axis), table(LOOP, 8, n_axis)
    hidden, rows, gears = table(LAWS, 2, 10), table(SEEN, 2, n_dof), table(GEARS, n_axis, n_dof)
    memory, time = table(MEMORY, 2, 2), loop[TIME, 0]
    if stage == 0 and part == 0:
        reference, noise = (
            table(REFERENCE, sample + 1, n_axis)[sample],
            table(NOISE, sample + 1, n_axis)[sample],
        )
        measured, demanded = table(MEASURED, sample + 1, n_axis), table(DEMANDED, sample + 1, n_axis)
        exact = table(EXACT, sample + 1, n_axis)
        for a in range(n_axis):
            angle = position[a] + noise[a]
            for h in range(2):
                if hidden[h, LAW] == laws.RESOLVER and hidden[h, AXIS] == a:
                    angle += hidden[h, 2] * np.sin(hidden[h, 3] * position[a] + hidden[h, 4])
            exact[sample, a] = angle - noise[a]
            if motors[COUNTS_PER_RAD, a] > 0:
                angle = np.rint(angle * motors[COUNTS_PER_RAD, a]) / motors[COUNTS_PER_RAD, a]
            rate = (angle - loop[LAST, a]) / time if sample > 0 else 0.0
            loop[LAST, a] = angle
            error = motors[FEEDFORWARD, a] * reference[a] - rate
            error += motors[POSITION_GAIN, a] * (loop[WANTED, a] - angle)
            loop[WANTED, a] += time * reference[a]
            loop[INTEGRAL, a] += time * motors[INTEGRAL_GAIN, a] * error
            loop[PREVIOUS, a] = loop[TORQUE, a]
            torque = motors[SPEED_GAIN, a] * error + loop[INTEGRAL, a]
            loop[TORQUE, a] = min(max(torque, -motors[LIMIT, a]), motors[LIMIT, a])
            measured[sample, a] = angle
            demanded[sample, a] = loop[TORQUE, a]
    for d in range(n_dof):
        applied[d] = 0.0
    for a in range(n_axis):
        row = PREVIOUS if part < motors[LATE, a] * n_step else TORQUE
        torque, v = loop[row, a], speed[a]
        for h in range(2):
            if hidden[h, AXIS] != a:
                continue
            if hidden[h, LAW] == laws.RIPPLE:
                torque += hidden[h, 2] * np.sin(hidden[h, 3] * position[a] + hidden[h, 4])
            elif hidden[h, LAW] == laws.GAIN:
                torque *= 1 + hidden[h, 2]
            elif hidden[h, LAW] == laws.SATURATION:
                torque = min(max(torque, -hidden[h, 2]), hidden[h, 2])
            elif hidden[h, LAW] == laws.LAG:
                if stage == 0:  # over a step the torque is the mean of what comes nearer to the command
                    steps = time / n_step / hidden[h, 2]
                    before, share = loop[FILTERED, a], np.exp(-steps)
                    loop[FILTERED, a] = torque + (before - torque) * share
                    loop[MEAN, a] = torque + (before - torque) * (1 - share) / steps
                torque = loop[MEAN, a]
        control[a] = torque
        applied[a] -= motors[COULOMB, a] * np.tanh(v / motors[ZERO_SPEED, a]) + motors[VISCOUS, a] * v
    for h in range(2):
        law, a = int(hidden[h, LAW]), int(hidden[h, AXIS])
        if law in ON_SIGNALS:
            continue
        x = v = bent = rate = 0.0
        for d in range(n_dof):
            x += rows[h, d] * position[d]
            v += rows[h, d] * speed[d]
            bent += gears[a, d] * position[d]
            rate += gears[a, d] * speed[d]
        number = hidden[h, 2:]
        if law == laws.GEAR_WAVE:
            phase = number[1] * position[a] + number[2]
            wave, slope = number[0] * np.sin(phase), number[0] * number[1] * np.cos(phase)
            more = motors[STIFFNESS, a] * wave + motors[DAMPING, a] * slope * speed[a]
            whole = motors[STIFFNESS, a] * (bent + wave) + motors[DAMPING, a] * (rate + slope * speed[a])
            for d in range(n_dof):
                applied[d] -= gears[a, d] * more
            applied[a] -= slope * whole
            continue
        load = gears[a, a] * (motors[STIFFNESS, a] * bent + motors[DAMPING, a] * rate)
        pull = laws.force(law, number, x, v, load, memory[h])
        if stage == 0:
            laws.move_on(law, number, v, memory[h], time / n_step)
        for d in range(n_dof):
            applied[d] -= rows[h, d] * pull


@functools.cache
def _compiled() -> Any:
    return compiled(_act)


class ForeignPlant:
    """MuJoCo's model of a robot, in closed loop, with hidden laws.

    Parameters
    ----------
    robot
        With its true numbers; effects have no counterpart.
    hidden
        At most two laws.
    late
        Samples after which a torque acts.
    base
        On which it stands; None: on a floor that does not give way.
    steps
        Of MuJoCo, a sample.
    """

    def __init__(
        self,
        robot: Robot,
        hidden: Sequence[HiddenLaw] = (),
        late: float = 0.0,
        base: Base | None = None,
        steps: int = STEPS,
    ) -> None:
        self.robot, self.steps = robot, steps
        to_motors = MujocoRobot(robot).from_joints
        xml = mjcf(robot, "RK4", robot.sample_time_s / steps)
        self.model = mujoco.MjModel.from_xml_string(on_base(xml, base) if base else xml)
        self.data = mujoco.MjData(self.model)
        own = np.ones(self.model.nv, dtype=bool)  # coordinates that the robot has, too
        if base:
            own[robot.n_axis : robot.n_axis + 2] = False
        self.own = np.flatnonzero(own)
        self.from_joints = np.zeros((len(to_motors), self.model.nv))
        self.from_joints[:, self.own] = to_motors
        self.to_joints = np.zeros((self.model.nv, len(to_motors)))
        self.to_joints[self.own] = np.linalg.inv(to_motors)
        axes = robot.description.axes.values()
        springs = [[axis.gear.stiffness, axis.gear.damping] if axis.gear else [0.0, 0.0] for axis in axes]
        friction = [of_axes(robot, "friction", key) for key in ("coulomb", "viscous", "speed")]
        keys = ("speed_gain", "integral_gain", "position_gain", "speed_feedforward")
        loop = [of_axes(robot, "controller", key) for key in keys]
        counted = of_axes(robot, "sensors", "encoder_counts") / (2 * np.pi)
        delay = np.full(robot.n_axis, round(late * steps) / steps)
        self.motors = np.array(
            [*friction, *loop, of_axes(robot, "torque_limit"), counted, *np.array(springs).T, delay]
        )
        self.laws, self.rows = np.zeros((MOST, 2 + NUMBERS)), np.zeros((MOST, self.model.nv))
        for h, one in enumerate(hidden):
            numbers = np.zeros(NUMBERS)
            numbers[: len(one.numbers)] = one.numbers
            numbers[laws.WIDTH] = self.motors[ZERO_SPEED, one.axis]
            numbers[laws.SPRING : laws.DAMPER + 1] = springs[one.axis]
            self.laws[h] = [one.law, one.axis, *numbers]
            self.rows[h] = one.row @ self.from_joints
        rows = robot.mechanism.spring_directions[: robot.n_axis]
        self.gears = np.ascontiguousarray(rows @ self.from_joints)

    def measure(
        self, reference: FloatArray, angle: FloatArray, noise: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Measured motor angle, commanded torque, and the angle without noise and steps of the encoder.

        Of one experiment, (n_sample, n_axis) each.

        Parameters
        ----------
        reference
            Motor speed, rad/s, (n_sample, n_axis).
        angle
            Joint-side angles at the start, rad, (n_axis,).
        noise
            Of the measured angle, which the controller sees, rad, (n_sample, n_axis); None: of an exact encoder,
            which has no steps either.

        Raises
        ------
        Unbounded
            Where speeds or angles grow beyond all that MuJoCo computes with.
        """
        robot, data, n_axis = self.robot, self.data, self.robot.n_axis
        reference = np.ascontiguousarray(reference, dtype=np.float64)
        measured, demanded, exact = (np.zeros_like(reference) for _ in range(3))
        motors, noise = self.motors.copy(), np.zeros_like(reference) if noise is None else noise
        motors[COUNTS_PER_RAD] *= noise.any()
        rest, hold = robot.equilibrium(angle[None]).position[0], robot.gravity_torque(angle[None])[0]
        mujoco.mj_resetData(self.model, data)
        data.qpos[:] = self.to_joints @ rest
        mujoco.mj_forward(self.model, data)
        among = np.setdiff1d(np.arange(self.model.nv), self.own)  # the base sinks under what stands on it
        data.qpos[among] = -data.qfrc_bias[among] / self.model.jnt_stiffness[among]
        loop = np.zeros((8, n_axis))
        loop[WANTED] = loop[LAST] = rest[:n_axis]
        loop[INTEGRAL] = loop[TORQUE] = loop[PREVIOUS] = loop[FILTERED] = hold
        loop[TIME] = robot.sample_time_s
        numbers = np.array([n_axis, self.steps, self.model.nv, 0], dtype=np.int64)
        arrays = (data.qpos, data.qvel, data.qfrc_applied, data.ctrl, reference, noise, measured, demanded)
        more = (motors, loop, numbers, self.laws, self.rows, self.gears, np.zeros((MOST, 2)), exact)
        with installed(_compiled(), (*arrays, *more)):
            mujoco.mj_step(self.model, data, len(reference) * self.steps)
        lost = [data.warning[kind].number for kind in LOST]  # after such a warning MuJoCo begins anew
        if any(lost) or not np.isfinite(measured).all():
            raise Unbounded(f"the simulation left all bounds with {self.steps} steps a sample")
        return measured, demanded, exact
