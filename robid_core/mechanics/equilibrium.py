"""Static equilibrium under gravity with the motors held: the operating point of (2.4).

The measured motor angle defines the configuration; arm and elastic joints sag until springs and gravity
balance. Newton's method with the gravity stiffness converges in a few steps, springs being far stiffer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.errors import ConfigurationError, NotTrustworthy
from robid_core.mechanics.chain import FloatArray
from robid_core.mechanics.kernel import kernel
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.rest import rows_times, terms_at_rest
from robid_core.mechanics.static_laws import static_force
from robid_core.mechanics.terms import ForceTerm

BoolArray = npt.NDArray[np.bool_]

MAXIMUM_STEPS = 50  # a robot needs 3 to 5; a spring that cannot hold its arm needs more than any number
STEP_TOLERANCE = 1e-13  # rad, times (1 + largest coordinate); Newton's error is the square of its last step

ESCAPED = 1e6  # rad or m: a joint that a step sent there does not come back
SHORTEST = 12  # halvings of one step
LESS = 0.9  # share of the work along a step that may be left behind it
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


def solve_equilibrium(
    mechanism: Mechanism,
    stiffness: FloatArray,
    motor_angle: FloatArray,
    forces: Sequence[ForceTerm] = (),
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
    bending = [term for term in forces if term.coordinate[n_axis:].any()]
    # Start where no spring is bent: arm joints follow the gears, elastic joints are straight.
    undeformed = np.zeros((mechanism.chain.n_coordinate, n_axis))
    undeformed[mechanism.arm] = mechanism.gear
    free = [mechanism.chain.index(name) for name in mechanism.coordinate_names[n_axis:]]
    z = np.concatenate((rows, rows_times(rows, undeformed[free].T)), axis=1)
    if n > n_axis:
        _sag(mechanism, spring_matrix, z, bending)
    torque = terms_at_rest(mechanism, z).bias + rows_times(z, spring_matrix) + static_force(bending, z).force
    shape = motor.shape[:-1]
    return Equilibrium(
        z.reshape(*shape, n),
        rows_times(z, joints.T).reshape(*shape, -1),
        torque[:, :n_axis].reshape(*shape, n_axis),
    )


def _sag(mechanism: Mechanism, spring_matrix: FloatArray, z: FloatArray, forces: Sequence[ForceTerm]) -> None:
    """Move the coordinates behind the motors, in place, until nothing pulls on them; a row at rest stays there.

    With nonlinear springs a step of Newton's method that does not reduce what pulls is halved: their corners would
    send it to and fro.
    """
    free = slice(mechanism.n_axis, None)
    moving = np.ones(len(z), dtype=np.bool_)
    for _ in range(MAXIMUM_STEPS):
        residual, tangent = _pull(mechanism, spring_matrix, z, forces)
        step = residual.copy()
        solve_rows(tangent.copy(), step)
        before = z[:, free].copy()
        z[moving, free] -= step[moving]
        if forces:
            _shorten(mechanism, spring_matrix, z, forces, before, step, residual, moving)
        largest = abs(z[:, free]).max(axis=1)
        if not (largest < ESCAPED).all():
            break
        moving &= abs(step).max(axis=1) > STEP_TOLERANCE * (1 + largest)
        if not moving.any():
            _refuse_unstable(mechanism, tangent)
            return
    _refuse_unstable(mechanism, tangent)
    raise NotTrustworthy(
        f"equilibrium: no rest position of '{', '.join(mechanism.coordinate_names[free])}' after {MAXIMUM_STEPS} "
        "steps of Newton's method; is a stiffness far too low for the load?"
    )


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


def _refuse_unstable(mechanism: Mechanism, tangent: FloatArray) -> None:
    floor = SINGULAR * abs(tangent).max(axis=(1, 2))
    try:
        np.linalg.cholesky(tangent - floor[:, None, None] * np.eye(tangent.shape[1]))
        return  # ten times as fast as eigenvalues
    except np.linalg.LinAlgError:
        lowest = np.linalg.eigvalsh(tangent)[:, 0]
    if (lowest > floor).all():
        return
    row = int(np.argmin(lowest))
    shape = np.linalg.eigh(tangent[row])[1][:, 0]
    name = mechanism.coordinate_names[mechanism.n_axis + int(np.argmax(abs(shape)))]
    raise NotTrustworthy(
        f"equilibrium: configuration {row}, coordinate '{name}': stiffness with gravity is {lowest[row]:.4g} N m/rad; "
        "the springs do not hold the arm; give a stiffer spring or check the masses"
    )


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
