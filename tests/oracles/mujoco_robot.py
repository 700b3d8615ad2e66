"""A robot of robid as a MuJoCo model: another engine, built from the same robot file (`mjcf`).

Generalised coordinates z are those of `robid_core.mechanics.Mechanism`: motors, then the joints that are not
rigidly geared; the map to MuJoCo's coordinates is made here, from the file. Friction and control are
Python's.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from oracles.drives import Cascade, Motors, Ripple, gear_of
from oracles.mjcf import driven_joints, mjcf
from oracles.robots import free_joints

from robid_core import Robot

FloatArray = npt.NDArray[np.float64]


class MujocoRobot:
    """A robot with a state in MuJoCo.

    Parameters
    ----------
    robot
        A robot of linear springs and motor friction; other effects are unknown here.
    integrator
        MuJoCo's name: Euler, RK4, implicit, implicitfast.
    step
        s; by default the robot's own.
    ripple
        Of motor torque and measured angle, for closed loops.

    Raises
    ------
    ValueError
        Where the robot holds something that has no exact counterpart: effects, flexible bodies, rigid gears
        that are coupled to elastic ones or across branches.
    """

    def __init__(
        self, robot: Robot, integrator: str = "RK4", step: float | None = None, ripple: Ripple | None = None
    ) -> None:
        self.robot, self.ripple = robot, ripple or Ripple.none(robot.n_axis)
        self.motors = Motors(robot, ripple)
        self.model = mujoco.MjModel.from_xml_string(mjcf(robot, integrator, step or robot.step_s))
        self.data = mujoco.MjData(self.model)
        self.to_joints = self._coordinate_map()
        self.from_joints = np.linalg.inv(self.to_joints)
        self.motor_rows = self.from_joints[: robot.n_axis]
        # True where MuJoCo's first coordinates are the motors themselves, as they are without rigid gears
        self.motors_first = bool((self.motor_rows == np.eye(*self.motor_rows.shape)).all())

    def _coordinate_map(self) -> FloatArray:
        """MuJoCo's coordinates over z."""
        robot, names = self.robot, [f"motor.{name}" for name in self.robot.axis_names]
        names += free_joints(robot)
        n_axis = robot.n_axis
        rows = np.zeros((self.model.nv, len(names)))
        for j in range(self.model.njnt):
            name = mujoco.mj_id2name(self.model, mujoco.mjtObj.mjOBJ_JOINT, j)
            row = rows[self.model.jnt_qposadr[j]]
            if name in names:
                row[names.index(name)] = 1.0
            else:
                row[:n_axis] = gear_of(robot)[driven_joints(robot).index(name)]
        return rows

    # At one state -----------------------------------------------------------------------------------------

    def put(self, position: FloatArray, speed: FloatArray) -> None:
        """Set the generalised coordinates and their rates, shape (n_coordinate,)."""
        self.data.qpos[:] = self.to_joints @ position
        self.data.qvel[:] = self.to_joints @ speed

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Generalised coordinates and their rates."""
        return self.from_joints @ self.data.qpos, self.from_joints @ self.data.qvel

    def acceleration(self, position: FloatArray, speed: FloatArray, torque: FloatArray) -> FloatArray:
        """Acceleration of z under motor torque (n_axis,) and the motors' friction, (n_coordinate,)."""
        self.put(position, speed)
        motor, rate = self.motor_rows @ self.data.qpos, self.motor_rows @ self.data.qvel
        self.data.ctrl[:] = torque
        self.data.qfrc_applied[:] = self.motor_rows.T @ self.motors.torque(motor, rate)
        mujoco.mj_forward(self.model, self.data)
        self.data.qfrc_applied[:] = 0
        return np.asarray(self.from_joints @ self.data.qacc)

    def mass(self, position: FloatArray) -> FloatArray:
        """Mass matrix over the generalised coordinates."""
        self.put(position, np.zeros_like(position))
        mujoco.mj_forward(self.model, self.data)
        columns, product = [], np.zeros(self.model.nv)
        for direction in self.to_joints.T:
            mujoco.mj_mulM(self.model, self.data, product, np.ascontiguousarray(direction))
            columns.append(self.to_joints.T @ product)
        return np.array(columns).T

    def slopes(
        self, position: FloatArray, torque: FloatArray, step: float = 1e-4, change: float = 1e-6
    ) -> tuple[FloatArray, FloatArray]:
        """A and B of (2.5) at rest without friction, from MuJoCo's transition derivatives (mjd_transitionFD).

        One semi-implicit Euler step is ``v+ = v + h a(q, v, u)``, ``q+ = q + h v+``: its derivatives hold
        those of the acceleration exactly, with damping explicit.

        Returns
        -------
        A (2 n, 2 n) and B (2 n, n_axis) over [z; z'].
        """
        model, n = self.model, self.model.nv
        before = model.opt.integrator, model.opt.timestep, model.opt.disableflags
        model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_EULER, step
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
        self.put(position, np.zeros_like(position))
        self.data.ctrl[:] = torque
        transition, push = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, model.nu))
        mujoco.mjd_transitionFD(model, self.data, change, True, transition, push, None, None)
        model.opt.integrator, model.opt.timestep, model.opt.disableflags = before
        back, to = self.from_joints, self.to_joints
        of_speed = (transition[n:] - np.eye(n, 2 * n, n)) / step
        a = np.block(
            [[np.zeros((n, n)), np.eye(n)], [back @ of_speed[:, :n] @ to, back @ of_speed[:, n:] @ to]]
        )
        b = np.concatenate((np.zeros((n, model.nu)), back @ push[n:] / step))
        return a, b

    # In time ----------------------------------------------------------------------------------------------

    @contextmanager
    def friction_in_every_stage(self) -> Iterator[None]:
        """Let MuJoCo ask for friction and ripple whenever it computes forces: a callback, global in MuJoCo."""
        applied, rows, motors = self.data.qfrc_applied, self.motor_rows, self.motors
        position, speed, n_axis = self.data.qpos, self.data.qvel, self.robot.n_axis

        def act(_model: Any, _data: Any) -> None:
            if self.motors_first:
                applied[:n_axis] = motors.torque(position[:n_axis], speed[:n_axis])
            else:
                applied[:] = rows.T @ motors.torque(rows @ position, rows @ speed)

        mujoco.set_mjcb_control(act)
        try:
            yield
        finally:
            mujoco.set_mjcb_control(None)
            applied[:] = 0

    def free_motion(
        self, position: FloatArray, speed: FloatArray, torque: FloatArray, n_sample: int, n_step: int
    ) -> tuple[FloatArray, FloatArray]:
        """Coordinates at every sample under constant motor torque, (n_sample, n_coordinate), and rates.

        The model's own step is n_step-th of the robot's sample time.
        """
        self.model.opt.timestep = self.robot.sample_time_s / n_step
        self.put(position, speed)
        self.data.ctrl[:] = torque
        where, rate = np.zeros((2, n_sample, len(position)))
        with self.friction_in_every_stage():
            for sample in range(n_sample):
                where[sample], rate[sample] = self.state()
                mujoco.mj_step(self.model, self.data, n_step)
        return where, rate

    def closed_loop(
        self,
        position: FloatArray,
        torque: FloatArray,
        reference: FloatArray,
        n_step: int,
        *,
        friction: str = "stage",
    ) -> tuple[FloatArray, FloatArray]:
        """Sampled closed loop from rest at a position that `torque` holds.

        Parameters
        ----------
        position, torque
            Equilibrium, (n_coordinate,) and (n_axis,).
        reference
            Motor speed, rad/s, (n_sample, n_axis).
        n_step
            Steps a sample.
        friction
            "stage": whenever MuJoCo computes forces, through a callback; "step": held over each step, which
            is faster and of first order.

        Returns
        -------
        Measured motor angle and torque, (n_sample, n_axis) each.
        """
        model, data, motors, n_axis = self.model, self.data, self.motors, self.robot.n_axis
        model.opt.timestep = self.robot.sample_time_s / n_step
        self.put(position, np.zeros_like(position))
        rows, first = self.motor_rows, self.motors_first
        where, rate, applied = data.qpos, data.qvel, data.qfrc_applied
        cascade = Cascade(self.robot, rows @ where, torque, self.ripple)
        measured, demanded = np.zeros((2, len(reference), n_axis))
        control, step = data.ctrl, mujoco.mj_step

        def angle() -> FloatArray:
            return np.asarray(where[:n_axis] if first else rows @ where)

        if friction == "stage":
            with self.friction_in_every_stage():
                for sample, wanted in enumerate(reference):
                    demanded[sample], measured[sample] = cascade.command(angle(), wanted)
                    control[:] = demanded[sample]
                    step(model, data, n_step)
            return measured, demanded
        for sample, wanted in enumerate(reference):
            demanded[sample], measured[sample] = cascade.command(angle(), wanted)
            control[:] = demanded[sample]
            for _ in range(n_step):
                if first:
                    applied[:n_axis] = motors.torque(where[:n_axis], rate[:n_axis])
                else:
                    applied[:] = rows.T @ motors.torque(rows @ where, rows @ rate)
                step(model, data)
        return measured, demanded
