"""Derivatives of the torque that a measured motion takes: springs by transfer vectors, bodies by differences.

With all coordinates per motor angle ``x = X X_m^-1``, ``X = (K - w^2 M + i w D)^-1 B`` (X_m its motor rows), torque is
``T = (i w)^2 Z Q / H0``, and a change of the matrices moves it by ``x^T (dK - w^2 dM + i w dD) x Q / H0``: for spring
s a product of its deflection per motor angle, ``y = e_s^T x``, with its deflection in this motion. H0 is the hold's
factor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core import FreeParameters, Robot
from robid_core.estimation.torque.spectra import PeriodicMotion

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

BODY_STEP = 1e-4  # in natural scales; matrices are nearly linear in them


def passive_motion(robot: Robot, angle: FloatArray, omega: FloatArray) -> ComplexArray:
    """All coordinates per motor angle of the linear model, shape (n_config, n_bin, n_coordinate, n_axis)."""
    model = robot.second_order(angle)
    w = omega[:, None, None]
    impedance = model.stiffness[:, None] - w**2 * model.mass[:, None] + 1j * w * model.damping[:, None]
    push = np.broadcast_to(model.input_map.astype(complex), (*impedance.shape[:2], *model.input_map.shape))
    moved = np.linalg.solve(impedance, push)
    result: ComplexArray = np.matmul(moved, np.linalg.inv(moved[:, :, : robot.n_axis]))
    return result


@dataclass(frozen=True, eq=False)
class BodyDerivatives:
    """What mass matrix, stiffness and weight change by for each inertial parameter, at fixed poses."""

    index: tuple[int, ...]
    """Numbers of these parameters among the free ones."""
    mass: FloatArray
    """Shape (n_config, n_coordinate, n_coordinate, n)."""
    stiffness: FloatArray
    """Of gravity, likewise."""
    weight: FloatArray
    """Of the motor torque that holds the arm, shape (n_config, n_axis, n)."""


def body_derivatives(free: FreeParameters, point: FloatArray, angle: FloatArray) -> BodyDerivatives:
    """Differentiate by steps of BODY_STEP; `point` are coordinates of the free parameters."""
    robot = free.robot_at(point)
    base, weight = robot.second_order(angle), robot.gravity_torque(angle)
    index = tuple(i for i, name in enumerate(free.names) if free.robot.parameter_kind(name) == "inertia")
    columns = []
    for i in index:
        moved = point.copy()
        moved[i] += BODY_STEP
        other = free.robot_at(moved)
        model = other.second_order(angle)
        columns.append(
            (model.mass - base.mass, model.stiffness - base.stiffness, other.gravity_torque(angle) - weight)
        )
    shapes = (base.mass.shape, base.mass.shape, weight.shape)
    mass, stiffness, hold = (
        np.stack([c[k] for c in columns], axis=-1) / BODY_STEP if columns else np.zeros((*shape, 0))
        for k, shape in enumerate(shapes)
    )
    return BodyDerivatives(index, mass, stiffness, hold)


def parameter_columns(
    free: FreeParameters,
    robot: Robot,
    motion: PeriodicMotion,
    config: int,
    passive: ComplexArray,
    bodies: BodyDerivatives,
) -> ComplexArray:
    """Derivatives of the torque spectra of one configuration, shape (n_exp, n_bin, n_axis, n_free).

    `passive` is `passive_motion` of this configuration at all bins but the first. Parameters that are neither springs,
    dampers, viscous friction nor inertia have columns of zeros.
    """
    n_exp, n_bin, n_axis = motion.angle_spectrum.shape[1:]
    columns = np.zeros((n_exp, n_bin, n_axis, len(free.names)), dtype=np.complex128)
    place = {name: i for i, name in enumerate(free.names)}
    omega, angle, hold = motion.omega[1:], motion.angle_spectrum[config][:, 1:], motion.hold[1:]
    per_motor = np.einsum("sn,fna->fsa", robot.mechanism.spring_directions, passive)
    deflection = np.einsum("fsa,xfa->xfs", per_motor, angle)
    for s, (stiffness, damping) in enumerate(zip(*robot.spring_arrays(), strict=True)):
        torque = (per_motor[:, s] / hold[:, None])[None] * deflection[:, :, s, None]
        name = robot.spring_names[s]
        if name in place:
            columns[:, 1:, :, place[name]] = stiffness * torque
        damper = name.replace("stiffness", "damping", 1)
        if damper in place:
            columns[:, 1:, :, place[damper]] = damping * 1j * omega[:, None] * torque
    for a, axis in enumerate(robot.axis_names):
        name = f"friction.{axis}.viscous"
        if name in place:
            columns[:, 1:, a, place[name]] = robot.drives.viscous[a] * 1j * omega * angle[:, :, a] / hold
    if bodies.index:
        columns[:, 1:, :, list(bodies.index)] = _of_bodies(bodies, config, passive, angle, omega, hold)
        columns[:, 0, :, list(bodies.index)] = np.broadcast_to(
            bodies.weight[config].T[:, None], (len(bodies.index), n_exp, n_axis)
        )
    return columns


def _of_bodies(
    bodies: BodyDerivatives,
    config: int,
    passive: ComplexArray,
    angle: ComplexArray,
    omega: FloatArray,
    hold: ComplexArray,
) -> ComplexArray:
    """``x^T (dK - w^2 dM) x Q / H0`` for all inertial parameters, shape (n_exp, n_bin, n_axis, n)."""
    n_bin, n, n_axis = passive.shape
    count, n_exp = len(bodies.index), len(angle)
    rows = np.ascontiguousarray(passive.transpose(0, 2, 1)).reshape(n_bin * n_axis, n)
    change = rows @ bodies.stiffness[config].reshape(n, -1)
    change = change.reshape(n_bin, -1) - (omega**2)[:, None] * (
        rows @ bodies.mass[config].reshape(n, -1)
    ).reshape(n_bin, -1)
    change = change.reshape(n_bin, n_axis, n, count).transpose(0, 2, 1, 3).reshape(n_bin, n, -1)
    moving = np.einsum("fna,xfa->fxn", passive, angle) / hold[:, None, None]
    torque = (moving @ change).reshape(n_bin, n_exp, n_axis, count)
    result: ComplexArray = torque.transpose(1, 0, 2, 3)
    return result
