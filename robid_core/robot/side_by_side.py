"""One motion prescribed to many robots at once: the derivative for any parameter is a difference between two of them.

Robots that differ in numbers only run side by side in the lanes of a register, eight experiments of any of them at a
time; each comes out as it would alone, bit by bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from robid_core.mechanics import MechanicalModel, prescribe

if TYPE_CHECKING:
    from robid_core.mechanics import MotorMotion, Simulation, SimulationState
    from robid_core.robot.robot import Robot


def prescribe_many(
    robots: Sequence[Robot],
    motion: MotorMotion,
    states: Sequence[SimulationState] | None = None,
    **options: Any,
) -> list[Simulation]:
    """Motor torques that a motion of the motors takes of each of several robots.

    Parameters
    ----------
    robots
        Of one sampling time and step; those with the same joints, gears and laws run side by side.
    motion
        Of the motors, in steps of `step_s`, shape (n_exp, ...).
    states
        Where everything behind the motors of each robot begins; by default at rest about the first angles, moving
        along.
    options
        Of `mechanics.prescribe`, which says more: periods, keep_coordinates, n_thread.

    Returns
    -------
    A simulation of each robot, of n_exp lanes.

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> from robid_core.mechanics import MotorMotion
    >>> robot = robid.Robot.load("one_axis")
    >>> softer = robot.with_parameters({"gear_stiffness.axis_1": 4e4})
    >>> motion = MotorMotion(np.zeros((1, 1)), np.zeros((1, 1)), np.ones((1, 400, 1)))
    >>> [run.torque.shape for run in robid.prescribe_many([robot, softer], motion)]
    [(1, 100, 1), (1, 100, 1)]
    """
    models = [MechanicalModel(robot.mechanism, *robot.spring_arrays(), robot.forces) for robot in robots]
    if states is None:
        states = [
            robot.standing(robot.joint_angle(motion.angle)).moving(robot.mechanism, motion.speed)
            for robot in robots
        ]
    alike: dict[Any, list[int]] = {}
    for number, (robot, model) in enumerate(zip(robots, models, strict=True)):
        alike.setdefault((robot.sample_time_s, robot.step_s, model.structure), []).append(number)
    runs: dict[int, Simulation] = {}
    for (sample_time, step, _), numbers in alike.items():
        found = prescribe(
            [models[i] for i in numbers],
            [states[i] for i in numbers],
            motion,
            sample_time=sample_time,
            step=step,
            **options,
        )
        runs.update(zip(numbers, found, strict=True))
    return [runs[number] for number in range(len(robots))]
