"""Derivatives of the torque that a measured motion takes: springs by transfer vectors, bodies by differences.

With all coordinates per motor angle ``x = X X_m^-1``, ``X = (K - w^2 M + i w D)^-1 B`` (X_m its motor rows), torque is
``T = (i w)^2 Z Q / H0``, and a change of the matrices moves it by ``x^T (dK - w^2 dM + i w dD) x Q / H0``: for spring
s a product of its deflection per motor angle, ``y = e_s^T x``, with its deflection in this motion. H0 is the hold's
factor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.parameters import FreeParameters
from robid_core.robot import Robot

BODY_STEP = 1e-4  # in natural scales; matrices are nearly linear in them
ALIKE = 3e-3  # in natural scales: bodies and springs that moved by less have the derivatives that they had


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
    about: Mapping[str, float]
    """Where in natural scales bodies, springs and the structure were."""

    def serves(self, about: Mapping[str, float], shape: tuple[int, ...]) -> bool:
        """Whether they are those of a robot near by; `shape` is that of its mass matrices."""
        same = about.keys() == self.about.keys() and self.mass.shape[:-1] == shape
        return same and all(abs(about[name] - self.about[name]) < ALIKE for name in about)

    def groups(self) -> list[tuple[IntArray, IntArray]]:
        """Return (parameters, coordinates): which parameters move which coordinates, rotors apart from bodies."""
        touched = (self.mass != 0).any(axis=(0, 2)) | (self.stiffness != 0).any(axis=(0, 2))
        kinds: dict[bytes, list[int]] = {}
        n_axis = self.weight.shape[1]
        for k in range(len(self.index)):
            kinds.setdefault(touched[:n_axis, k].any().tobytes(), []).append(k)
        return [
            (np.array(members), np.flatnonzero(touched[:, members].any(axis=1))) for members in kinds.values()
        ]


def body_derivatives(
    free: FreeParameters,
    robot: Robot,
    point: FloatArray,
    angle: FloatArray,
    known: BodyDerivatives | None = None,
) -> BodyDerivatives:
    """Differentiate by steps of BODY_STEP.

    Parameters
    ----------
    free
        The parameters.
    robot
        On which they are set.
    point
        Their coordinates, shape (n_free,).
    angle
        Joint-side poses, shape (n_config, n_axis).
    known
        Of another point, which are returned where that is near.
    """
    here = free.set_on(robot, point)
    kinds = [free.robot.parameter_kind(name) for name in free.names]
    index = tuple(i for i, kind in enumerate(kinds) if kind == "inertia")
    laws = {bound.label for bound in here.effects}
    about = {
        name: float(at)
        for name, kind, at in zip(free.names, kinds, point, strict=True)
        if kind in ("inertia", "stiffness") or (kind == "effect" and name.split(".")[1] not in laws)
    }
    n, n_config = here.mechanism.n_coordinate, len(angle)
    if known is not None and known.serves(about, (n_config, n, n)):
        return replace(known, index=index)
    base, weight = here.second_order(angle), here.gravity_torque(angle)
    mass, stiffness = np.empty((2, n_config, n, n, len(index)))
    hold = np.empty((n_config, here.n_axis, len(index)))
    for k, i in enumerate(index):
        moved = point.copy()
        moved[i] += BODY_STEP
        other = free.set_on(robot, moved)
        model = other.second_order(angle)
        mass[..., k] = (model.mass - base.mass) / BODY_STEP
        stiffness[..., k] = (model.stiffness - base.stiffness) / BODY_STEP
        hold[..., k] = (other.gravity_torque(angle) - weight) / BODY_STEP
    return BodyDerivatives(index, mass, stiffness, hold, about)


def parameter_columns(
    free: FreeParameters,
    robot: Robot,
    motion: MotionSpectra,
    config: int,
    bins: slice,
    swing: ComplexArray,
    passive: ComplexArray,
    bodies: BodyDerivatives,
    columns: ComplexArray,
) -> None:
    """Write derivatives of the torque spectra of one configuration into (n_bin, n_exp, n_axis, n_free) of zeros.

    Parameters
    ----------
    free, robot
        The parameters, and the robot at their values.
    motion
        The record's.
    config, bins
        Configuration, and which bins of the record.
    swing
        Spectra of the motor angles at these bins, shape (n_bin, n_exp, n_axis).
    passive
        `passive_motion` of this configuration at these bins, zero at the mean.
    bodies
        Derivatives by inertial parameters.
    columns
        Those of parameters that are neither springs, dampers, viscous friction nor inertia stay as they are.
    """
    place = {name: i for i, name in enumerate(free.names)}
    omega, hold = motion.omega[bins, None, None], motion.hold[bins, None, None]
    per_motor = np.matmul(robot.mechanism.spring_directions.astype(np.complex128), passive)
    deflection = np.matmul(swing, per_motor.transpose(0, 2, 1))
    per_motor = per_motor / hold
    for s, (stiffness, damping) in enumerate(zip(*robot.spring_arrays(), strict=True)):
        name = robot.spring_names[s]
        damper = name.replace("stiffness", "damping", 1)
        if name not in place and damper not in place:
            continue
        torque = deflection[:, :, s, None] * per_motor[:, None, s]
        if name in place:
            columns[..., place[name]] = stiffness * torque
        if damper in place:
            columns[..., place[damper]] = damping * 1j * omega * torque
    for a, axis in enumerate(robot.axis_names):
        name = f"friction.{axis}.viscous"
        if name in place:
            columns[:, :, a, place[name]] = (robot.drives.viscous[a] * 1j * omega * swing / hold)[..., a]
    if bodies.index:
        moving = np.matmul(swing, passive.transpose(0, 2, 1)) / hold
        for members, coordinates in bodies.groups():
            change = _of_bodies(bodies, config, members, coordinates, passive, moving, omega)
            columns[..., np.array(bodies.index)[members]] = change
        constant = motion.constant[bins]
        for k in np.flatnonzero(constant):
            columns[k][..., list(bodies.index)] += constant[k] * bodies.weight[config]


def _of_bodies(
    bodies: BodyDerivatives,
    config: int,
    members: IntArray,
    coordinates: IntArray,
    passive: ComplexArray,
    moving: ComplexArray,
    omega: FloatArray,
) -> ComplexArray:
    """``x^T (dK - w^2 dM) x Q / H0`` for some inertial parameters, shape (n_bin, n_exp, n_axis, n_member).

    `omega` has shape (n_bin, 1, 1).
    """
    n, count = len(coordinates), len(members)
    n_bin, n_exp, _ = moving.shape
    inside = np.ix_(coordinates, coordinates, members)
    matrix = np.concatenate((bodies.stiffness[config][inside], bodies.mass[config][inside])).reshape(
        2 * n, n * count
    )
    rows = moving[:, :, coordinates]
    rows = np.concatenate((rows, -(omega**2) * rows), axis=2).reshape(n_bin * n_exp, 2 * n)
    change = np.empty((len(rows), matrix.shape[1]), dtype=np.complex128)
    change.real, change.imag = rows.real @ matrix, rows.imag @ matrix
    turned = np.ascontiguousarray(passive[:, coordinates].transpose(0, 2, 1))
    result: ComplexArray = np.matmul(turned[:, None], change.reshape(n_bin, n_exp, n, count))
    return result
