"""Static equilibrium under gravity with the motors held: the operating point of (2.4).

The measured motor angle defines the configuration; arm and elastic joints sag until springs and gravity
balance. Newton's method with the gravity stiffness converges in a few steps, springs being far stiffer. Rows in which
it does not come to a stable rest, for a gap or a corner in a spring, go down the potential energy (see `descent`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from robid_core.arrays import BoolArray, FloatArray, IntArray
from robid_core.compiled.kernel import kernel
from robid_core.errors import ConfigurationError, NotTrustworthy
from robid_core.mechanics.descent import descend
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.rest import rows_times, terms_at_rest
from robid_core.mechanics.static_laws import static_force
from robid_core.mechanics.terms import ForceTerm

NEWTON_STEPS = 15  # a robot needs 3 to 5; who needs more goes another way
STEP_TOLERANCE = 1e-13  # rad, times (1 + largest coordinate); Newton's error is the square of its last step

ESCAPED = 1e6  # rad or m: a joint that a step sent there does not come back
SHORTEST = 12  # halvings of one step
LESS = 0.9  # share of the work along a step that may be left behind it
SINGULAR = 1e-12  # of the largest stiffness; below it rounding decides the sign


@dataclass(frozen=True)
class Equilibrium:
    """Static equilibrium of the robot; leading axes are those of the motor angle."""

    position: FloatArray
    """Generalised coordinates z, shape (..., n_coordinate)."""
    joint: FloatArray
    """Joint coordinates q = T z, shape (..., n_joint)."""
    torque: FloatArray
    """Motor torque that holds the robot, N m at the motor shaft, shape (..., n_axis)."""
    refused: Mapping[int, str] = field(default_factory=dict)
    """Why a row has no rest, by its number; such a row is NaN."""


def solve_equilibrium(
    mechanism: Mechanism,
    stiffness: FloatArray,
    motor_angle: FloatArray,
    forces: Sequence[ForceTerm] = (),
    partial: bool = False,
) -> Equilibrium:
    """Rest position of arm and elastic joints at given motor angles.

    Solves ``T^T g(T z) + sum_s k_s e_s e_s^T z + sum_l e_l f_l(e_l^T z) = tau`` with tau zero but at the motors.

    Parameters
    ----------
    mechanism
        Chain, gears and springs.
    stiffness
        Spring constants, N m/rad, shape (n_spring,).
    motor_angle
        rad at the motor shaft, shape (..., n_axis).
    forces
        Laws of effects: nonlinear springs count, friction rests. Laws at a motor do not: they are no matter of the
        arm's equilibrium, and a rest state does not hold them.
    partial
        Return what rests; rows without a stable rest are NaN, and `refused` says why.

    Raises
    ------
    NotTrustworthy
        Where some row has no stable equilibrium: the springs cannot hold the arm; the message names row and coordinate.
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
    bending = [term for term in forces if term.coordinate[n_axis:].any()]
    # Start where no spring is bent: arm joints follow the gears, elastic joints are straight.
    undeformed = np.zeros((mechanism.chain.n_coordinate, n_axis))
    undeformed[mechanism.arm] = mechanism.gear
    free = [mechanism.chain.index(name) for name in mechanism.coordinate_names[n_axis:]]
    z = np.concatenate((rows, rows_times(rows, undeformed[free].T)), axis=1)
    refused = _settle(mechanism, spring_matrix, z, bending) if n > n_axis else {}
    if refused and not partial:
        first = min(refused)
        others = f" (and {len(refused) - 1} more of {len(rows)})" if len(refused) > 1 else ""
        raise NotTrustworthy(f"equilibrium: configuration {first + 1}{others}: {refused[first]}")
    torque = terms_at_rest(mechanism, z).bias + rows_times(z, spring_matrix) + static_force(bending, z).force
    for row in refused:
        z[row, n_axis:], torque[row] = np.nan, np.nan
    shape = motor.shape[:-1]
    return Equilibrium(
        z.reshape(*shape, n),
        rows_times(z, joints.T).reshape(*shape, -1),
        torque[:, :n_axis].reshape(*shape, n_axis),
        refused,
    )


def _settle(
    mechanism: Mechanism, spring_matrix: FloatArray, z: FloatArray, forces: Sequence[ForceTerm]
) -> dict[int, str]:
    """Move the coordinates behind the motors, in place, to a stable rest; return why a row has none, by its number."""
    free, start = slice(mechanism.n_axis, None), z.copy()
    left = np.flatnonzero(~_sag(mechanism, spring_matrix, z, forces))
    if not len(left):
        return {}

    def pull(rows: IntArray, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        there = start[left[rows]]
        there[:, free] = position
        return _pull(mechanism, spring_matrix, there, forces)

    found = descend(pull, start[left, free])
    z[left, free] = found.position
    names = mechanism.coordinate_names[mechanism.n_axis :]
    return {
        int(left[row]): _reason(
            names[int(np.argmax(abs(found.softest[row])))], found.stiffness[row], bool(found.fallen[row])
        )
        for row in np.flatnonzero(~found.rests)
    }


def _reason(name: str, stiffness: float, fallen: bool) -> str:
    """Say why a row has no rest."""
    what = "falls, and nothing holds it" if fallen else "comes to no rest"
    return (
        f"coordinate '{name}' {what}: its stiffness with gravity is {stiffness:.4g} N m/rad where it was left; the "
        "springs do not hold the arm; give a stiffer spring or check the masses"
    )


def _sag(
    mechanism: Mechanism, spring_matrix: FloatArray, z: FloatArray, forces: Sequence[ForceTerm]
) -> BoolArray:
    """Move the coordinates by Newton's method, in place, until nothing pulls on them; tell which rows rest stably.

    With nonlinear springs a step that does not reduce what pulls is halved: their corners would send it to and fro.
    """
    free = slice(mechanism.n_axis, None)
    moving = np.ones(len(z), dtype=np.bool_)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # rows that run away are found below
        for _ in range(NEWTON_STEPS):
            residual, tangent = _pull(mechanism, spring_matrix, z, forces)
            step = residual.copy()
            solve_rows(tangent.copy(), step)
            step[~np.isfinite(step).all(axis=1)] = ESCAPED
            before = z[:, free].copy()
            z[moving, free] -= step[moving]
            if forces:
                _shorten(mechanism, spring_matrix, z, forces, before, step, residual, moving)
            largest = abs(z[:, free]).max(axis=1)
            escaped = ~(largest < ESCAPED)
            z[escaped, free] = before[escaped]
            moving &= abs(step).max(axis=1) > STEP_TOLERANCE * (1 + largest)
            moving &= ~escaped
            if not moving.any():
                break
    rests: BoolArray = ~moving & ~escaped & _stable(tangent)
    return rests


def _pull(
    mechanism: Mechanism, spring_matrix: FloatArray, z: FloatArray, forces: Sequence[ForceTerm]
) -> tuple[FloatArray, FloatArray]:
    """What pulls on the coordinates behind the motors, and its slope."""
    free = slice(mechanism.n_axis, None)
    terms, laws = terms_at_rest(mechanism, z), static_force(forces, z)
    residual = terms.bias + rows_times(z, spring_matrix) + laws.force
    tangent = terms.gravity_stiffness + spring_matrix + laws.stiffness
    return residual[:, free], np.ascontiguousarray(tangent[:, free, free])


def _shorten(
    mechanism: Mechanism,
    spring_matrix: FloatArray,
    z: FloatArray,
    forces: Sequence[ForceTerm],
    before: FloatArray,
    step: FloatArray,
    residual: FloatArray,
    moving: BoolArray,
) -> None:
    """Halve the steps, in place, until the work that the pull does along them has shrunk."""
    free = slice(mechanism.n_axis, None)
    start = abs(np.einsum("ri,ri->r", residual, step))
    for _ in range(SHORTEST):
        pull, _ = _pull(mechanism, spring_matrix, z, forces)
        left = abs(np.einsum("ri,ri->r", pull, step))
        worse = moving & (left > LESS * start) & (abs(step).max(axis=1) > STEP_TOLERANCE)
        if not worse.any():
            return
        step[worse] /= 2
        z[worse, free] = before[worse] - step[worse]


def _stable(tangent: FloatArray) -> BoolArray:
    """Tell of each row whether its stiffness is positive in every direction."""
    floor = SINGULAR * abs(tangent).max(axis=(1, 2))
    try:
        np.linalg.cholesky(tangent - floor[:, None, None] * np.eye(tangent.shape[1]))
        return np.ones(len(tangent), dtype=np.bool_)  # ten times as fast as eigenvalues
    except np.linalg.LinAlgError:
        stable: BoolArray = np.linalg.eigvalsh(tangent)[:, 0] > floor
        return stable


@kernel
def solve_rows(matrix, right):  # type: ignore[no-untyped-def]
    """Solve matrix[row] x = right[row] for every row, in place: symmetric, upper triangle, without pivoting.

    A stable equilibrium has a positive definite tangent, which needs none; on the way there a poor step is mended by
    the next one.
    """
    n = matrix.shape[1]
    for row in range(matrix.shape[0]):
        for k in range(n):
            inverse = 1.0 / matrix[row, k, k]
            for i in range(k + 1, n):
                factor = matrix[row, k, i] * inverse
                right[row, i] -= factor * right[row, k]
                for j in range(i, n):
                    matrix[row, i, j] -= factor * matrix[row, k, j]
        for k in range(n - 1, -1, -1):
            total = right[row, k]
            for i in range(k + 1, n):
                total -= matrix[row, k, i] * right[row, i]
            right[row, k] = total / matrix[row, k, k]
