"""Before a robot is simulated: is its controller stable, and is the step short enough for its springs?

Both are asked of the linear model at the rest position of one configuration. The controller is asked in motion, with
viscous friction only: Coulomb friction may hold at rest what is unstable, until it moves. What grows slower than by a
thousandth a sample is let through: an arm that a speed loop without position control lets sink is no mistake.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh, expm

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError

if TYPE_CHECKING:
    from robid_core.mechanics import LinearModel, SecondOrderModel
    from robid_core.robot.robot import Robot


GROWTH = 1e-3  # a sample
STABLE_STEP = 2.78  # Runge-Kutta of order four on the imaginary and on the negative real axis, rounded down
RESOLVED = 1.0  # rad a step: the midpoint rule bends the frequency of such a mode by 8 %


def refuse_unstable(robot: Robot, angle: FloatArray, step: float, method: str) -> None:
    """Check controller and step at one configuration (joint-side motor angles, shape (n_axis,)).

    Raises
    ------
    ConfigurationError
        The message names the axis and the number.
    """
    model = robot.second_order(angle[None])
    _refuse_step(robot, model, step, method)
    growth, axis = _loop(robot, robot.linearize(angle, ("motor_angle",)))
    if growth > GROWTH:
        entry, d = robot.structure.axes[robot.axis_names[axis]], robot.drives
        advice = (
            f"lower its speed_gain {d.speed_gain[axis]:g}, integral_gain {d.integral_gain[axis]:g} or position_gain "
            f"{d.position_gain[axis]:g}"
            if entry.servo is None
            else f"lower its duty_gain {entry.servo.duty_gain:g} 1/rad, or sample_time_s"
        )
        raise ConfigurationError(
            f"{robot.name}: {robot.axis_names[axis]}: the controller is unstable, a disturbance grows by "
            f"{growth:.3g} of itself a sample; {advice}"
        )


def _refuse_step(robot: Robot, model: SecondOrderModel, step: float, method: str) -> None:
    square, shape = eigh(model.stiffness[0], model.mass[0])
    omega = np.sqrt(np.maximum(square, 0.0))
    fade = np.einsum("ik,ij,jk->k", shape, model.damping[0], shape)
    names = robot.mechanism.coordinate_names
    if method == "runge_kutta":
        rate = np.maximum(omega, fade)
        limit, wanted = STABLE_STEP, rate
    else:
        wanted = np.where(omega < np.pi / robot.sample_time_s, omega, 0.0)
        limit = RESOLVED
    worst = int(np.argmax(wanted))
    if wanted[worst] * step > limit:
        place = names[int(np.argmax(abs(shape[:, worst]) * np.sqrt(np.diag(model.mass[0]))))]
        raise ConfigurationError(
            f"{robot.name}: step_s {step:g} s is too long for the spring at '{place}', which swings at "
            f"{omega[worst] / (2 * np.pi):.4g} Hz; give at most {limit / wanted[worst]:.2g} s ({method})"
        )


def _loop(robot: Robot, model: LinearModel) -> tuple[float, int]:
    """Growth a sample of the sampled closed loop, and the axis whose motor moves most in what grows."""
    d, n_axis, time = robot.drives, robot.n_axis, robot.sample_time_s
    n = len(model.a)
    both = np.zeros((n + n_axis, n + n_axis))
    both[:n, :n], both[:n, n:] = model.a * time, model.b * time
    with np.errstate(over="ignore", invalid="ignore"):
        moved = expm(both)
    if not np.isfinite(moved).all():  # it grows beyond all numbers within a sample
        return np.inf, int(np.argmax(abs(model.c @ model.a).max(axis=1)))
    a, b, c = moved[:n, :n], moved[:n, n:], model.c
    unit = np.eye(n_axis)
    # states: plant, last measured angle, integral; error = - position_gain q - (q - last) / T
    error = np.hstack(
        (-(np.diag(d.position_gain) + unit / time) @ c, unit / time, np.zeros((n_axis, n_axis)))
    )
    integral = np.hstack((np.zeros((n_axis, n + n_axis)), unit)) + (d.integral_gain * time)[:, None] * error
    torque = d.speed_gain[:, None] * error + integral
    closed = np.vstack(
        (
            np.hstack((a, np.zeros((n, 2 * n_axis)))) + b @ torque,
            np.hstack((c, np.zeros((n_axis, 2 * n_axis)))),
            integral,
        )
    )
    value, vector = np.linalg.eig(closed)
    worst = int(np.argmax(abs(value)))
    return float(abs(value[worst]) - 1.0), int(np.argmax(abs(c @ vector[:n, worst])))
