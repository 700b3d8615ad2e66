"""One record under one variant of the robot: what was measured, and what torque the model gives for its motion.

``T = e^(-i w d) (Z(p) A + g(p) + N + sum_k c_k Phi_k)``: T and A are spectra of measured torque and acceleration, Z the
inverse response of the linear model and g what holds its weight, N what a prescribed motion of the nonlinear model adds
(held while the unknowns move, renewed between passes), Phi_k functions of the measured speed, d the torque's delay.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from robid_core.estimation.torque.spectra import (
    PeriodicMotion,
    SpeedFunction,
    friction_deviation,
    friction_spectra,
    speed_functions,
)
from robid_core.estimation.torque.weights import covariance_of, whitener
from robid_core.mechanics import SimulationState
from robid_core.parameters import FreeParameters
from robid_core.residual.columns import body_derivatives, parameter_columns, passive_motion
from robid_core.residual.remainder import impedance, remainder
from robid_core.robot import Robot

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]

DIFFERENCE = 1e-3  # step of derivatives by two prescribed motions, in natural scales


@dataclass(frozen=True, eq=False)
class SimulatedColumn:
    """Derivatives for a parameter that only a prescribed motion knows, by a difference of two."""

    index: int
    """Number of the parameter among the free ones."""
    about: float
    """Its coordinate where the derivative was taken."""
    remainder: ComplexArray
    """Of the remainder, shape (n_config, n_exp, n_bin, n_axis)."""
    linear: ComplexArray
    """Of the linear model's torque, likewise."""


@dataclass(eq=False)
class TorqueBlock:
    """Measured spectra of one record, and what the robot under which it was measured gives for them."""

    robot: Robot
    """Without Coulomb friction at the motors; the free parameters are set on it."""
    motion: PeriodicMotion
    laws: tuple[SpeedFunction, ...]
    """Functions of speed that stand for friction."""
    friction: ComplexArray
    """Spectra of these functions and of a constant, shape (n_law + 1, n_config, n_exp, n_bin, n_axis)."""
    friction_deviation: ComplexArray
    """Those of each period less their mean, without the constant, (n_law, n_config, n_exp, n_period, n_bin, n_axis)."""
    angle: FloatArray
    """Mean joint-side angles, rad, shape (n_config, n_axis)."""
    remainder: ComplexArray = field(init=False)
    """Shape (n_config, n_exp, n_bin, n_axis)."""
    simulated: tuple[SimulatedColumn, ...] = ()
    state: SimulationState | None = None
    """Where the last prescribed motion ended."""

    @classmethod
    def of_record(cls, robot: Robot, motion: PeriodicMotion, widths: tuple[float, ...]) -> TorqueBlock:
        """Prepare a block; `widths` are those of the friction functions, rad/s."""
        laws, angle = tuple(speed_functions(widths)), robot.joint_angle(motion.angle.mean(axis=(1, 2)))
        friction = friction_spectra(motion, laws, motion.fine_speed())
        return cls(robot, motion, laws, friction, friction_deviation(motion, laws), angle)

    def __post_init__(self) -> None:
        self.remainder = np.zeros_like(self.motion.torque_spectrum)

    def thinned(self, keep: IntArray) -> TorqueBlock:
        """Return the block with some of its bins, before any motion was prescribed."""
        friction, deviation = self.friction[:, :, :, keep], self.friction_deviation[..., keep, :]
        return replace(
            self, motion=self.motion.thinned(keep), friction=friction, friction_deviation=deviation
        )

    def robot_at(self, free: FreeParameters, coordinates: FloatArray) -> Robot:
        """Return this block's robot with the free parameters at some coordinates."""
        return self.robot.with_parameters(free.values(coordinates))

    # Torque

    def predicted(self, robot: Robot, coordinates: FloatArray, coefficient: FloatArray) -> ComplexArray:
        """Torque spectra without the delay, shape (n_config, n_exp, n_bin, n_axis).

        Parameters
        ----------
        robot
            At these coordinates of the free parameters.
        coordinates
            Shape (n_free,).
        coefficient
            Of the functions of speed, N m, shape (n_law, n_axis).
        """
        z = impedance(robot, self.angle, self.motion, "zero_order_hold")
        torque: ComplexArray = np.matmul(z[:, None], self.motion.acceleration_spectrum[..., None])[..., 0]
        torque += self.remainder
        torque[:, :, 0] += robot.gravity_torque(self.angle)[:, None]
        for column in self.simulated:
            torque += (coordinates[column.index] - column.about) * column.remainder
        for law, size in zip(self.friction, coefficient, strict=True):
            torque += law * size
        return torque

    def residual(self, predicted: ComplexArray, delay: float) -> ComplexArray:
        """Measured less predicted torque, N m, shape (n_config, n_exp, n_bin, n_axis)."""
        turn = np.exp(-1j * self.motion.omega * delay)[:, None]
        difference: ComplexArray = self.motion.torque_spectrum - turn * predicted
        return difference

    def renew(self, free: FreeParameters, coordinates: FloatArray) -> None:
        """Prescribe the measured motion to the model, and differentiate what only that knows.

        With nonlinear springs it knows the linear ones, too: what they do depends on how far the others are bent.
        """
        robot, motion, angle = self.robot_at(free, coordinates), self.motion, self.angle
        self.remainder, self.state = remainder(robot, angle, motion, self.state)
        self.remainder[:, :, 0] -= robot.gravity_torque(angle)[:, None]
        here = impedance(robot, angle, motion, "zero_order_hold")
        columns = []
        for i, name in enumerate(free.names):
            kind = free.robot.parameter_kind(name)
            elastic = kind in ("stiffness", "damping")
            if kind in ("inertia", "friction") or (elastic and not robot.bending_forces):
                continue  # the linear columns are enough
            moved = coordinates.copy()
            moved[i] += DIFFERENCE
            other = self.robot_at(free, moved)
            left, _ = remainder(other, angle, motion, self.state)
            left[:, :, 0] -= other.gravity_torque(angle)[:, None]
            change = impedance(other, angle, motion, "zero_order_hold") - here
            linear = np.einsum("cfab,cxfb->cxfa", change, motion.acceleration_spectrum) / DIFFERENCE
            weight = other.gravity_torque(angle) - robot.gravity_torque(angle)
            linear[:, :, 0] += weight[:, None] / DIFFERENCE
            slope = (left - self.remainder) / DIFFERENCE
            columns.append(SimulatedColumn(i, float(coordinates[i]), slope, linear))
        self.simulated = tuple(columns)

    def renew_friction(self, robot: Robot, coefficient: FloatArray) -> None:
        """Evaluate the functions of speed anew, with what friction and held torque do to the speed between samples.

        Arguments as of `predicted`. Above half the sampling rate motors move alone: there their acceleration is torque
        over inertia.
        """
        motion, n = self.motion, robot.n_axis
        speed = motion.fine_speed()
        torque = np.repeat(motion.torque, speed.shape[2] // motion.n_sample, axis=2) - coefficient[-1]
        for law, size in zip(self.laws, coefficient[:-1], strict=True):
            torque -= size * law(speed)
        mobility = np.linalg.inv(robot.second_order(self.angle).mass)[:, :n, :n]
        speed = motion.fine_speed(np.matmul(torque, mobility[:, None]))
        self.friction = friction_spectra(motion, self.laws, speed)

    # Noise

    def noise(self, robot: Robot, coefficient: FloatArray) -> ComplexArray:
        """Covariance of the residual from differences between periods, shape (n_bin, n_axis, n_axis).

        Arguments as of `predicted`. Noise of the angles is in it as it comes through inertia, springs and friction.
        """
        motion = self.motion
        z = impedance(robot, self.angle, motion, "zero_order_hold")
        moved = np.matmul(z[:, None, None], motion.acceleration_deviation[..., None])[..., 0]
        for law, size in zip(self.friction_deviation, coefficient[:-1], strict=True):
            moved += law * size
        n_config, n_exp, n_period = motion.torque_deviation.shape[:3]
        freedom = n_config * n_exp * n_period * (n_period - 1)
        return covariance_of(motion.torque_deviation - moved, freedom)

    def weight(self, robot: Robot, coefficient: FloatArray, model_error: float) -> ComplexArray:
        """Whitener of the noise and of a model error relative to the torque, shape (n_bin, n_axis, n_axis)."""
        torque = self.motion.torque_spectrum
        size = covariance_of(torque)
        size[0] = (np.abs(torque[:, :, 0]) ** 2).mean(
            axis=(0, 1)
        )  # the mean is no neighbour of the lowest bins
        return whitener(self.noise(robot, coefficient) + model_error**2 * size * np.eye(size.shape[-1]))

    # Derivatives

    def columns(
        self, free: FreeParameters, coordinates: FloatArray, predicted: ComplexArray
    ) -> Iterator[ComplexArray]:
        """Derivatives of the torque, one configuration after another, shape (n_bin, n_exp, n_axis, n_unknown).

        Unknowns are the free parameters, the size of each function of speed at each axis, the delay.
        """
        robot, motion, n_free = self.robot_at(free, coordinates), self.motion, len(free.names)
        n_law, n_config, n_exp, n_bin, n_axis = self.friction.shape
        bodies = body_derivatives(free, self.robot, coordinates, self.angle)
        passive = passive_motion(robot, self.angle, motion.omega[1:])
        for c in range(n_config):
            shape = (n_bin, n_exp, n_axis, n_free + n_law * n_axis + 1)
            found = np.zeros(shape, dtype=np.complex128)
            found[..., :n_free] = parameter_columns(free, robot, motion, c, passive[c], bodies)
            for column in self.simulated:
                found[..., column.index] = (column.remainder[c] + column.linear[c]).transpose(1, 0, 2)
            for a in range(n_axis):
                laws = self.friction[:, c, :, :, a].transpose(2, 1, 0)
                found[:, :, a, n_free + a + n_axis * np.arange(n_law)] = laws
            found[..., -1] = (-1j * motion.omega[:, None] * predicted[c]).transpose(1, 0, 2)
            yield found
