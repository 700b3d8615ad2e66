"""Derivatives of the torque that a measured motion takes, for parameters that the linear model knows.

With all coordinates per motor angle ``x = X X_m^-1``, ``X = (K - w^2 M + i w D)^-1 B`` (X_m its motor rows), torque is
``T = (i w)^2 Z Q / H0``, and a change of the matrices moves it by ``x^T (dK - w^2 dM + i w dD) x Q / H0``: see
`robid_core.mechanics.slopes`. H0 is the hold's factor. What bodies change is kept where they hardly moved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.mechanics import MechanismChange, SecondOrderModel, SecondOrderSlopes
from robid_core.parameters import FreeParameters
from robid_core.parameters.tangents import mechanism_change
from robid_core.robot import Robot

BODY_STEP = 1e-4  # in natural scales, where nonlinear springs are bent by the weight
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
    """Derivatives of mass matrix, stiffness and weight for each inertial parameter, at fixed poses."""

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


def body_derivatives(
    free: FreeParameters,
    robot: Robot,
    point: FloatArray,
    angle: FloatArray,
    known: BodyDerivatives | None = None,
) -> BodyDerivatives:
    """Differentiate, taking the sag along; with nonlinear springs by steps of BODY_STEP.

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
    if not here.bending_forces:
        change = mechanism_change(free, robot, point, index)
        parts = here.mechanism, *here.spring_arrays(), here.equilibrium(angle).position
        slopes = here.batches.second_order_slopes(*parts, change)
        return BodyDerivatives(index, slopes.mass, slopes.stiffness, slopes.torque, about)
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


@dataclass(frozen=True, eq=False)
class LinearSlopes:
    """Derivatives of a robot's linear model for springs, dampers, viscous friction and bodies, at some poses."""

    model: SecondOrderModel
    slopes: SecondOrderSlopes
    index: IntArray
    """Numbers of the parameters among the free ones, in the order of the changes."""

    @classmethod
    def of_robot(
        cls, free: FreeParameters, robot: Robot, angle: FloatArray, bodies: BodyDerivatives
    ) -> LinearSlopes:
        """Put together derivatives by bodies and those that are told at once.

        Parameters
        ----------
        free, robot
            The parameters, and the robot at their values.
        angle
            Joint-side poses, shape (n_config, n_axis).
        bodies
            At these poses.
        """
        place = {name: i for i, name in enumerate(free.names)}
        stiffness, damping = robot.spring_arrays()
        sizes = [
            *(
                ("stiffness", s, name, k)
                for s, (name, k) in enumerate(zip(robot.spring_names, stiffness, strict=True))
            ),
            *(
                ("damping", s, name.replace("stiffness", "damping", 1), d)
                for s, (name, d) in enumerate(zip(robot.spring_names, damping, strict=True))
            ),
            *(
                ("motor_damping", a, f"friction.{axis}.viscous", robot.drives.viscous[a])
                for a, axis in enumerate(robot.axis_names)
            ),
        ]
        asked = [(what, number, place[name], size) for what, number, name, size in sizes if name in place]
        n_body, count = len(bodies.index), len(bodies.index) + len(asked)
        change = MechanismChange.none(robot.mechanism, count)
        for row, (what, number, _, size) in enumerate(asked, n_body):
            getattr(change, what)[row, number] = size
        added = ((0, 0), (0, 0), (0, 0), (0, len(asked)))
        mass, stiff = np.pad(bodies.mass, added), np.pad(bodies.stiffness, added)
        weight = np.pad(bodies.weight, added[1:])
        slopes = SecondOrderSlopes(mass, np.zeros_like(mass), stiff, weight, change)
        index = np.array([*bodies.index, *(i for _, _, i, _ in asked)], dtype=np.int64)
        return cls(robot.second_order(angle), slopes, index)

    def at(self, config: int) -> LinearSlopes:
        """Return those of one configuration; the axis of configurations stays."""
        here, model, slopes = slice(config, config + 1), self.model, self.slopes
        return replace(
            self,
            model=replace(
                model, mass=model.mass[here], damping=model.damping[here], stiffness=model.stiffness[here]
            ),
            slopes=replace(
                slopes,
                mass=slopes.mass[here],
                damping=slopes.damping[here],
                stiffness=slopes.stiffness[here],
                torque=slopes.torque[here],
            ),
        )


def parameter_columns(
    robot: Robot,
    motion: MotionSpectra,
    bins: slice,
    swing: ComplexArray,
    linear: LinearSlopes,
    columns: ComplexArray,
) -> None:
    """Write derivatives of the torque spectra of one configuration into (n_bin, n_exp, n_axis, n_free) of zeros.

    Parameters
    ----------
    robot
        At the values of the parameters.
    motion
        The record's.
    bins
        Which bins of the record.
    swing
        Spectra of the motor angles at these bins, shape (n_bin, n_exp, n_axis).
    linear
        Derivatives of the linear model, of this configuration.
    columns
        Those of parameters that are neither springs, dampers, viscous friction nor inertia stay as they are.
    """
    if not len(linear.index):
        return
    omega, constant = motion.omega[bins], motion.constant[bins]
    at, hold = slice(np.count_nonzero(omega <= 0), None), motion.hold[bins, None, None, None]
    slopes = robot.batches.torque_slopes(linear.model, linear.slopes, omega[at], swing[None, at])[0]
    columns[at, ..., linear.index] = slopes / hold[at]
    for k in np.flatnonzero(constant):
        columns[k][..., linear.index] += constant[k] * linear.slopes.torque[0]
