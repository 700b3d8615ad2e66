"""How a robot moves, three ways: in closed loop, under given torques, and as told to move."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray

if TYPE_CHECKING:
    from robid_core.mechanics import MotorMotion, Simulation, SimulationState
    from robid_core.robot.plant import RobotPlant
    from robid_core.robot.robot import Robot


class Motions:
    """What a `Robot` does when it moves; a part of that class, in a file of its own."""

    @property
    def _robot(self) -> Robot:
        return cast("Robot", self)

    def simulate(
        self,
        speed_reference: FloatArray,
        angle: npt.ArrayLike,
        seed: int | None = None,
        position_reference: FloatArray | None = None,
        **options: Any,
    ) -> Simulation:
        """Closed loop from rest at the gravity equilibrium.

        Parameters
        ----------
        speed_reference
            rad/s at the motors, shape (n_lane, n_sample, n_axis).
        angle
            Joint-side motor angles at the start, shape (n_lane, n_axis).
        seed
            Draws the sensors' noise; None: none.
        position_reference
            Motor angles asked for, shape of `speed_reference`; by default its integral.
        options
            Of `mechanics.simulate`: torque_feedforward, step, method, keep_coordinates, n_thread.

        Raises
        ------
        SimulationDiverged
            Where a lane leaves all bounds.

        Examples
        --------
        Half a second of one motor that follows 2 rad/s at 4 Hz:

        >>> import numpy as np, robid_core as robid
        >>> robot = robid.Robot.load("one_axis")
        >>> time = np.arange(500) * robot.sample_time_s
        >>> reference = 2.0 * np.sin(2 * np.pi * 4 * time)
        >>> moved = robot.simulate(reference[None, :, None], [[0.3]])
        >>> moved.position.shape, moved.torque.shape
        ((1, 500, 1), (1, 500, 1))
        """
        from robid_core.robot.plant import simulate_robot

        start = np.asarray(angle, dtype=float)
        return simulate_robot(self._robot, speed_reference, start, seed, position_reference, **options)

    def drive(
        self, torque: FloatArray, angle: npt.ArrayLike, motor_speed: FloatArray | None = None, **options: Any
    ) -> Simulation:
        """Open loop: the motion under given (recorded) motor torques.

        Parameters
        ----------
        torque
            N m at the motors, held between samples, shape (n_lane, n_sample, n_axis).
        angle
            Joint-side motor angles at the start, shape (n_lane, n_axis); springs bent by gravity.
        motor_speed
            At the start, rad/s at the motors, shape (n_lane, n_axis), the arm moving along; rest if left out.
        options
            Of `mechanics.simulate`.

        Examples
        --------
        A pendulum that is let go, for 0.2 s:

        >>> import numpy as np, robid_core as robid
        >>> robot = robid.Robot.load("one_axis")
        >>> let_go = robot.drive(np.zeros((1, 200, 1)), [[0.3]])
        >>> let_go.position.shape, bool(np.ptp(let_go.position) > 0)
        ((1, 200, 1), True)
        """
        from robid_core.robot.plant import drive_open_loop, standing

        state = standing(self._robot, self._robot.motor_angle(angle))
        if motor_speed is not None:
            state = state.moving(self._robot.mechanism, np.asarray(motor_speed, dtype=float))
        return drive_open_loop(self._robot, torque, state, **options)

    def standing(self, angle: npt.ArrayLike) -> SimulationState:
        """State of robots that stand still at joint-side motor angles (n_lane, n_axis), gravity held by springs.

        >>> import robid_core as robid
        >>> robot = robid.Robot.load("one_axis")
        >>> state = robot.standing([[0.3]])
        >>> robot.joint_angle(state.position[:, :1]).round(3).tolist(), state.speed.tolist()
        ([[0.3]], [[0.0, 0.0]])
        """
        from robid_core.robot.plant import standing

        return standing(self._robot, self._robot.motor_angle(angle))

    def prescribe(
        self, motion: MotorMotion, state: SimulationState | None = None, **options: Any
    ) -> Simulation:
        """Motor torques that a motion of the motors takes, springs, bodies and forces of this robot behind them.

        Parameters
        ----------
        motion
            Of the motors, in steps of `step_s`.
        state
            Where everything else begins; by default at rest about the first angles, moving along.
        options
            Of `mechanics.prescribe`, which says more: periods, keep_coordinates, n_thread.
        """
        from robid_core.robot.side_by_side import prescribe_many

        (run,) = prescribe_many([self._robot], motion, None if state is None else [state], **options)
        return run

    def plant(self) -> RobotPlant:
        """Return this robot as the plant behind simulated drives.

        >>> import robid_core as robid
        >>> robid.Robot.load("one_axis").plant().n_axis
        1
        """
        from robid_core.robot.plant import RobotPlant

        return RobotPlant(self._robot)
