"""Free vibration along a motion, by prescribed motions: how torques differ that begin with other initial states.

The closed form of `free_vibration` holds about one pose. On a long way the arm rings on in poses where it resonates
elsewhere, and after a few periods the phase is another one; in the middle of a gap the linear model has no spring.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.torque.windowed import WindowedMotion
from robid_core.mechanics import MotorMotion
from robid_core.residual.free_vibration import slowest_decay, state_at_first
from robid_core.robot import Robot
from robid_core.robot.side_by_side import prescribe_many

DIFFERENCE = 0.01  # of the rms vibration: the step of a derivative
SMALLEST = 1e-12  # of a step, rad and rad/s
REMAINS = 1e-3  # of a vibration: what is left of it when it has rung out
FAR = 0.2  # rad at a joint from the middle of a motion: beyond, the model about one pose tells nothing
SLOWER = 2.0  # times the time that the linear model takes at the first poses, for those that come


def vibration_along(
    robot: Robot,
    motion: WindowedMotion,
    moved: MotorMotion,
    deviation: FloatArray | None,
    rms: FloatArray,
    spectrum: Callable[[FloatArray], ComplexArray],
) -> ComplexArray:
    """Spectra of the torque for unit deviations of initial angles, then rates, from a state.

    Shape (n_config, n_exp, n_bin, n_axis, 2 n_behind).

    Parameters
    ----------
    robot, motion
        Whose, and during which.
    moved
        The motion in steps of the integrator.
    deviation
        The state from which these deviate, as of `state_at_first`.
    rms
        Of deflections and their rates in this motion, (n_config, 2 n_behind).
    spectrum
        Of a simulated torque at the samples, of the shape of the motion.
    """
    shape, n_state = motion.angle.shape, rms.shape[1]
    n_sample = _rings_for(robot, motion)
    n_step = n_sample * round(motion.sample_time_s / robot.step_s)
    short = replace(moved, acceleration=moved.acceleration[:, :n_step])
    begin = np.zeros((*shape[:2], n_state)) if deviation is None else deviation
    steps = np.maximum(DIFFERENCE * rms, SMALLEST)
    states = [state_at_first(robot, moved.angle, moved.speed, begin)]
    for i in range(n_state):
        other = begin.copy()
        other[:, :, i] += steps[:, None, i]
        states.append(state_at_first(robot, moved.angle, moved.speed, other))
    first, *runs = prescribe_many([robot] * len(states), short, states)
    found = []
    for step, run in zip(steps.T, runs, strict=True):
        torque = np.zeros(shape)
        torque[:, :, :n_sample] = (run.torque - first.torque).reshape(*shape[:2], n_sample, -1)
        found.append(spectrum(torque) / step[:, None, None, None])
    return np.stack(found, axis=-1)


def moves_far(robot: Robot, motion: WindowedMotion) -> bool:
    """Whether the arm leaves what a linear model can tell."""
    joints = robot.joint_angle(motion.angle)
    middle = 0.5 * (joints.max(axis=(1, 2), keepdims=True) + joints.min(axis=(1, 2), keepdims=True))
    return bool((np.abs(joints - middle) > FAR).any())


def _rings_for(robot: Robot, motion: WindowedMotion) -> int:
    """Samples until a vibration has rung out, all of them where it does not."""
    decay = slowest_decay(robot, robot.joint_angle(motion.angle[:, :, 0]).reshape(-1, robot.n_axis))
    if decay <= 0 or robot.bending_forces:
        return motion.n_sample
    rings = SLOWER * np.log(1 / REMAINS) / (decay * motion.sample_time_s)
    return int(min(np.ceil(rings), motion.n_sample))
