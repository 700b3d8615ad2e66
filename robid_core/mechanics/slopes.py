"""Derivatives of linear models, responses and motor torques along changes of the mechanism.

At a gravity equilibrium with the motors' joint-side angles held. Bodies, rotors and gears take the sag with them, by
the implicit function ``dz = -K_e^-1 dr`` of what pulls on the coordinates behind the motors; springs and dampers are
taken at a fixed equilibrium, as in `response_with_gradient`. With ``dZ = dK - w^2 dM + i w dD``::

    response  G = (i w)^2 H0 B^T Z^-1 B + (images) J     dG = w^2 H0 X^T dZ X - (images) B^T M^-1 dM M^-1 B,  X = Z^-1 B
    torque    T = (B^T Z^-1 B)^-1 Q                      dT = x^T dZ x Q,                               x = X X_m^-1

Springs enter as products of deflections, bodies by central differences of the matrices: these are quadratic in a body's
numbers, or cubic and then the differences are of fourth order, and what is left is rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.mechanics.change import MechanismChange
from robid_core.mechanics.linearize import SecondOrderModel
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.response import hold_factor
from robid_core.mechanics.rest import terms_at_rest

Stencil = tuple[tuple[float, float], ...]  # (steps, weight)

BODY_STEP = 0.1  # along a change, in which matrices are quadratic, or cubic: no error but rounding
GEAR_STEP = 1e-3  # where rigid gears turn the arm in second order
SAG_STEP = 3e-3  # rad at most: fourth order leaves 1e-12 of what turns
CENTRAL: Stencil = ((1.0, 0.5), (-1.0, -0.5))  # exact where what is differentiated is quadratic
FOURTH_ORDER: Stencil = ((1.0, 8 / 12), (-1.0, -8 / 12), (2.0, -1 / 12), (-2.0, 1 / 12))
VALUES_AT_ONCE = 2**22  # complex numbers of one block of lines


@dataclass(frozen=True, eq=False)
class SecondOrderSlopes:
    """Derivatives of a second-order model; leading axes are configurations, the last one is the change."""

    mass: FloatArray
    """(..., n_coordinate, n_coordinate, n_change)."""
    damping: FloatArray
    """Without the dampers' own change, likewise."""
    stiffness: FloatArray
    """Without the springs' own change, likewise."""
    torque: FloatArray
    """Of the motor torque that holds the arm, (..., n_axis, n_change)."""
    change: MechanismChange
    """Along which they were taken; that of springs, dampers and motors' friction is read from here."""


def second_order_slopes(
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    position: FloatArray,
    change: MechanismChange,
) -> SecondOrderSlopes:
    """Differentiate mass, damping and stiffness matrices and the holding torque.

    Parameters
    ----------
    mechanism
        Chain, gears and springs.
    stiffness, damping
        Of the springs, N m/rad and N m s/rad, shape (n_spring,).
    position
        Generalised coordinates of an equilibrium, shape (..., n_coordinate).
    change
        Rows of what changes.
    """
    n_axis, n, count = mechanism.n_axis, mechanism.n_coordinate, len(change)
    z = np.asarray(position, dtype=np.float64)
    rows, springs = z.reshape(-1, n), mechanism.spring_directions
    mass, damper, spring = np.zeros((3, count, len(rows), n, n))
    pull = np.zeros((count, len(rows), n))
    held = (springs.T * stiffness) @ springs
    tangent = terms_at_rest(mechanism, rows).gravity_stiffness + held
    index = change.of_mechanism()
    for k in index:
        turned = np.zeros_like(rows)
        turned[:, :n_axis] = -np.linalg.solve(mechanism.gear, change.gear[k] @ rows[:, :n_axis].T).T
        step, stencil = GEAR_STEP, FOURTH_ORDER
        if not change.gear[k].any():
            cubic = change.mass[k].any() and change.centre_of_mass[k].any()
            step, stencil = BODY_STEP, FOURTH_ORDER if cubic else CENTRAL
        for way, weight in stencil:
            other = change.moved(mechanism, k, way * step)
            terms = terms_at_rest(other, rows + way * step * turned)
            mass[k] += weight / step * terms.mass
            spring[k] += weight / step * terms.gravity_stiffness
            pull[k] += weight / step * terms.bias
        if change.gear[k].any():
            leaning = np.zeros_like(springs)  # springs in gears come first
            leaning[: mechanism.elastic_gear.sum(), :n_axis] = change.gear[k][mechanism.elastic_gear]
            half_held, half_damper = ((leaning.T * size) @ springs for size in (stiffness, damping))
            spring[k] += half_held + half_held.T
            damper[k] += half_damper + half_damper.T
            pull[k] += rows @ (half_held + half_held.T) + turned @ held
    if n > n_axis and len(index):
        sag = np.zeros((len(index), len(rows), n))
        behind = pull[index][..., n_axis:, None]
        sag[..., n_axis:] = -np.linalg.solve(tangent[:, n_axis:, n_axis:], behind)[..., 0]
        step = SAG_STEP / max(np.abs(sag).max(), np.finfo(float).tiny)
        for way, weight in FOURTH_ORDER:
            terms = terms_at_rest(mechanism, (rows + way * step * sag).reshape(-1, n))
            mass[index] += weight / step * terms.mass.reshape(len(index), -1, n, n)
            spring[index] += weight / step * terms.gravity_stiffness.reshape(len(index), -1, n, n)
        pull[index] += (tangent @ sag[..., None])[..., 0]
    shapes = (n, n), (n, n), (n, n), (n_axis,)
    mass, damper, spring, torque = (
        np.moveaxis(part, 0, -1).reshape(*z.shape[:-1], *shape, count)
        for part, shape in zip((mass, damper, spring, pull[..., :n_axis]), shapes, strict=True)
    )
    return SecondOrderSlopes(mass, damper, spring, torque, change)


def response_slopes(
    model: SecondOrderModel,
    slopes: SecondOrderSlopes,
    omega: FloatArray,
    hold_sample_time: float | None = None,
    motor_impedance: ComplexArray | None = None,
) -> ComplexArray:
    """Differentiate the response from motor torque to motor acceleration.

    Parameters
    ----------
    model, slopes
        At n_config configurations, one leading axis each.
    omega, hold_sample_time
        As for `robid_core.mechanics.response`.
    motor_impedance
        As for `robid_core.mechanics.with_motor_impedance`, shape (n_config, n_freq, n_axis).

    Returns
    -------
    Shape (n_config, n_freq, n_axis, n_axis, n_change).
    """
    n_axis, n_config, count = model.n_axis, len(model.mass), len(slopes.change)
    hold, image = hold_factor(omega, hold_sample_time)
    found = np.empty((n_config, len(omega), n_axis, n_axis, count), dtype=np.complex128)
    at_once = max(1, VALUES_AT_ONCE // max(1, n_axis * (n_axis + model.mass.shape[-1]) * count))
    for c in range(n_config):
        inertial = np.linalg.solve(model.mass[c], model.input_map)
        images = np.einsum("ni,nmp,mj->ijp", inertial, slopes.mass[c], inertial)
        for first in range(0, len(omega), at_once):
            part = slice(first, first + at_once)
            w, extra = omega[part], None if motor_impedance is None else motor_impedance[c, part]
            moved = _moved(model, c, w, extra)
            change = _along(model, slopes, c, w, moved, moved)
            scale = (w**2 * hold[part])[:, None, None, None]
            found[c, part] = scale * change - image[part, None, None, None] * images
    return found


def torque_slopes(
    model: SecondOrderModel, slopes: SecondOrderSlopes, omega: FloatArray, swing: ComplexArray
) -> ComplexArray:
    """Differentiate the motor torque that a motion of the motors takes, ``(B^T Z^-1 B)^-1 Q``.

    Parameters
    ----------
    model, slopes
        At n_config configurations, one leading axis each.
    omega
        rad/s, > 0, shape (n_freq,).
    swing
        Spectra of the motor angles, rad, shape (n_config, n_freq, n_exp, n_axis).

    Returns
    -------
    N m, shape (n_config, n_freq, n_exp, n_axis, n_change).
    """
    n_config, n_freq, n_exp, n_axis = swing.shape
    found = np.empty((n_config, n_freq, n_exp, n_axis, len(slopes.change)), dtype=np.complex128)
    for c in range(n_config):
        moved = _moved(model, c, omega, None)
        per_motor = moved @ np.linalg.inv(moved[:, :n_axis])
        moving = per_motor @ np.swapaxes(swing[c], 1, 2)
        found[c] = _along(model, slopes, c, omega, moving, per_motor)
    return found


def output_slopes(
    model: SecondOrderModel,
    slopes: SecondOrderSlopes,
    omega: FloatArray,
    swing: ComplexArray,
    outputs: ComplexArray,
) -> tuple[ComplexArray, ComplexArray]:
    """Differentiate what is seen of the coordinates while the motors move as prescribed, ``C x``, and return x, too.

    What is behind the motors follows by ``x_p = -Z_pp^-1 Z_pm Q``, and changes by ``-Z_pp^-1 (dZ x)_p``.

    Parameters
    ----------
    model, slopes
        At one configuration, with a leading axis of one.
    omega
        rad/s, > 0, shape (n_freq,).
    swing
        Spectra of the motor angles, rad, shape (n_freq, n_exp, n_axis).
    outputs
        C, which does not change, shape (n_freq, n_output, n_coordinate).

    Returns
    -------
    Shape (n_freq, n_exp, n_output, n_change), and (n_freq, n_coordinate, n_exp).
    """
    n_axis, w = model.n_axis, omega[:, None, None]
    impedance = model.stiffness[0] - w**2 * model.mass[0] + 1j * w * model.damping[0]
    behind = impedance[:, n_axis:, n_axis:]
    motors = np.swapaxes(swing, 1, 2)
    moving = np.concatenate(
        (motors, -np.linalg.solve(behind, impedance[:, n_axis:, :n_axis] @ motors)), axis=1
    )
    seen = np.zeros((len(omega), model.mass.shape[-1], outputs.shape[1]), dtype=np.complex128)
    seen[:, n_axis:] = np.linalg.solve(np.swapaxes(behind, 1, 2), np.swapaxes(outputs[:, :, n_axis:], 1, 2))
    return -_along(model, slopes, 0, omega, moving, seen), moving


def _moved(
    model: SecondOrderModel, config: int, omega: FloatArray, motor_impedance: ComplexArray | None
) -> ComplexArray:
    """All coordinates per motor torque at one configuration, (n_freq, n_coordinate, n_axis)."""
    w, motors = omega[:, None, None], np.arange(model.n_axis)
    impedance = model.stiffness[config] - w**2 * model.mass[config] + 1j * w * model.damping[config]
    if motor_impedance is not None:
        impedance[:, motors, motors] += motor_impedance
    push = np.broadcast_to(model.input_map.astype(complex), (len(omega), *model.input_map.shape))
    result: ComplexArray = np.linalg.solve(impedance, push)
    return result


def _along(
    model: SecondOrderModel,
    slopes: SecondOrderSlopes,
    config: int,
    omega: FloatArray,
    left: ComplexArray,
    right: ComplexArray,
) -> ComplexArray:
    """``left^T dZ right`` for motions (n_freq, n_coordinate, n_left), (...), (n_freq, n_left, n_right, n_change)."""
    change = slopes.change
    found = np.zeros((len(omega), left.shape[2], right.shape[2], len(change)), dtype=np.complex128)
    for members, coordinates in _groups(slopes, config):
        found[..., members] = _of_matrices(slopes, config, members, coordinates, omega, left, right)
    directions = np.concatenate((model.spring_directions, model.input_map.T)).astype(np.complex128)
    constant = np.concatenate((change.stiffness, np.zeros_like(change.motor_damping)), axis=1)
    rate = np.concatenate((change.damping, change.motor_damping), axis=1)
    one, other = directions @ left, directions @ right
    for s in np.flatnonzero(((constant != 0) | (rate != 0)).any(axis=0)):
        members = np.flatnonzero((constant[:, s] != 0) | (rate[:, s] != 0))
        size = constant[members, s] + 1j * omega[:, None] * rate[members, s]
        product = one[:, s, :, None] * other[:, s, None, :]
        found[..., members] += product[..., None] * size[:, None, None]
    return found


def _groups(slopes: SecondOrderSlopes, config: int) -> list[tuple[IntArray, IntArray]]:
    """Return (changes, coordinates): which changes move which coordinates, those of rotors alone apart from bodies."""
    parts = (slopes.mass[config], slopes.damping[config], slopes.stiffness[config])
    touched = np.any([(part != 0).any(axis=0) for part in parts], axis=0)
    some = touched.any(axis=0)
    wide = touched.sum(axis=0) > 1
    kinds = [np.flatnonzero(some & wide), np.flatnonzero(some & ~wide)]
    return [(members, np.flatnonzero(touched[:, members].any(axis=1))) for members in kinds if len(members)]


def _of_matrices(
    slopes: SecondOrderSlopes,
    config: int,
    members: IntArray,
    coordinates: IntArray,
    omega: FloatArray,
    left: ComplexArray,
    right: ComplexArray,
) -> ComplexArray:
    """``left^T dZ right`` of some changes whose matrices have entries between some coordinates only."""
    n, count, w = len(coordinates), len(members), omega[:, None, None]
    inside = np.ix_(coordinates, coordinates, members)
    rows = np.swapaxes(left[:, coordinates], 1, 2)
    parts = [(rows, slopes.stiffness[config][inside]), (-(w**2) * rows, slopes.mass[config][inside])]
    damping = slopes.damping[config][inside]
    if damping.any():
        parts.append((1j * w * rows, damping))
    stacked = np.concatenate([part for part, _ in parts], axis=2).reshape(-1, n * len(parts))
    matrix = np.concatenate([part for _, part in parts]).reshape(n * len(parts), n * count)
    change = np.empty((len(stacked), n * count), dtype=np.complex128)
    change.real, change.imag = stacked.real @ matrix, stacked.imag @ matrix
    turned = np.ascontiguousarray(np.swapaxes(right[:, coordinates], 1, 2))
    result: ComplexArray = turned[:, None] @ change.reshape(*rows.shape[:2], n, count)
    return result
