"""Static equilibrium under gravity with the motors held: the operating point of (2.4).

The measured motor angle defines the configuration; arm and elastic joints sag until springs and gravity
balance. Newton's method with the gravity stiffness converges in a few steps, springs being far stiffer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.errors import ConfigurationError, NotTrustworthy
from robid_core.mechanics.chain import FloatArray
from robid_core.mechanics.dynamics import dynamics
from robid_core.mechanics.mechanism import Mechanism

MAXIMUM_STEPS = 50  # a robot needs 3 to 5; a spring that cannot hold its arm needs more than any number
STEP_TOLERANCE = 1e-13  # rad, times (1 + largest coordinate); Newton's error is the square of its last step

ESCAPED = 1e6  # rad or m: a joint that a step sent there does not come back
SINGULAR = 1e-12  # of the largest stiffness; below it rounding decides the sign


@dataclass(frozen=True)
class Equilibrium:
    """Where the robot rests; leading axes are those of the motor angle."""

    position: FloatArray
    """Generalised coordinates z, shape (..., n_coordinate)."""
    joint: FloatArray
    """Joint coordinates q = T z, shape (..., n_joint)."""
    torque: FloatArray
    """Motor torque that holds the robot, N m at the motor shaft, shape (..., n_axis)."""


def solve_equilibrium(mechanism: Mechanism, stiffness: FloatArray, motor_angle: FloatArray) -> Equilibrium:
    """Rest position of arm and elastic joints at given motor angles.

    Solves ``T^T g(T z) + sum_s k_s e_s e_s^T z = tau`` with tau zero but at the motors.

    Parameters
    ----------
    mechanism
        Chain, gears and springs.
    stiffness
        Spring constants, N m/rad, shape (n_spring,).
    motor_angle
        rad at the motor shaft, shape (..., n_axis).

    Raises
    ------
    NotTrustworthy
        Where no stable equilibrium is found: the springs cannot hold the arm; the message names the coordinate.
    """
    mechanism.check_springs(stiffness=stiffness)
    n_axis, n = mechanism.n_axis, mechanism.n_coordinate
    motor = np.asarray(motor_angle, dtype=np.float64)
    if motor.shape[-1:] != (n_axis,) or not np.isfinite(motor).all():
        raise ConfigurationError(
            f"equilibrium: motor angle of shape {motor.shape}; give {n_axis} finite angles a row"
        )
    rows = motor.reshape(-1, n_axis)
    joints, springs = mechanism.constraint_map, mechanism.spring_directions
    spring_matrix = (springs.T * stiffness) @ springs
    # Start where no spring is bent: arm joints follow the gears, elastic joints are straight.
    undeformed = np.zeros((mechanism.chain.n_coordinate, n_axis))
    undeformed[mechanism.arm] = mechanism.gear
    free = [mechanism.chain.index(name) for name in mechanism.coordinate_names[n_axis:]]
    z = np.concatenate((rows, rows @ undeformed[free].T), axis=1)
    if n > n_axis:
        _sag(mechanism, spring_matrix, z)
    q = z @ joints.T
    torque = dynamics(mechanism.chain, q).bias @ joints + z @ spring_matrix
    shape = motor.shape[:-1]
    return Equilibrium(
        z.reshape(*shape, n), q.reshape(*shape, -1), torque[:, :n_axis].reshape(*shape, n_axis)
    )


def _sag(mechanism: Mechanism, spring_matrix: FloatArray, z: FloatArray) -> None:
    """Move the coordinates behind the motors, in place, until nothing pulls on them."""
    n_axis, joints = mechanism.n_axis, mechanism.constraint_map
    for _ in range(MAXIMUM_STEPS):
        terms = dynamics(mechanism.chain, z @ joints.T)
        residual = (terms.bias @ joints + z @ spring_matrix)[:, n_axis:]
        tangent = (joints.T @ terms.gravity_stiffness @ joints + spring_matrix)[:, n_axis:, n_axis:]
        try:
            step = np.linalg.solve(tangent, residual[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:
            break  # a singular tangent: told below
        z[:, n_axis:] -= step
        largest = abs(z[:, n_axis:]).max(axis=1)
        if not (largest < ESCAPED).all():
            break
        if (abs(step).max(axis=1) <= STEP_TOLERANCE * (1 + largest)).all():
            _refuse_unstable(mechanism, tangent)
            return
    _refuse_unstable(mechanism, tangent)
    raise NotTrustworthy(
        f"equilibrium: no rest position of '{', '.join(mechanism.coordinate_names[n_axis:])}' after {MAXIMUM_STEPS} "
        "steps of Newton's method; is a stiffness far too low for the load?"
    )


def _refuse_unstable(mechanism: Mechanism, tangent: FloatArray) -> None:
    lowest = np.linalg.eigvalsh(tangent)[:, 0]
    if (lowest > SINGULAR * abs(tangent).max(axis=(1, 2))).all():
        return
    row = int(np.argmin(lowest))
    shape = np.linalg.eigh(tangent[row])[1][:, 0]
    name = mechanism.coordinate_names[mechanism.n_axis + int(np.argmax(abs(shape)))]
    raise NotTrustworthy(
        f"equilibrium: configuration {row}, coordinate '{name}': stiffness with gravity is {lowest[row]:.4g} N m/rad; "
        "the springs do not hold the arm; give a stiffer spring or check the masses"
    )
