"""The torque residual of periodic records as a least-squares problem with priors.

``e = T - e^(-i w d) (Z(p) A + N + sum_k c_k Phi_k)``: T and A are spectra of measured torque and acceleration in all
bins, Z the inverse response of the linear model, N what a prescribed motion of the nonlinear model adds (held while
the unknowns move, renewed between passes), Phi_k functions of the measured speed, d a common delay of the torques.
Unknowns: coordinates of the free parameters p, the c_k of each axis, d.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from robid_core import FreeParameters, Robot
from robid_core.estimation.torque.spectra import PeriodicMotion, speed_functions
from robid_core.estimation.torque.weights import covariance_of
from robid_fit.torque_columns import BodyDerivatives, body_derivatives, parameter_columns, passive_motion
from robid_fit.torque_remainder import impedance

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]

HELD = 1e-3  # of its prior, what a body moves that is held
FRICTION_PRIOR = 0.3  # of the torque limit: no told level, which would freeze what is told as zero


@dataclass(frozen=True, eq=False)
class EffectColumn:
    """Derivatives for a parameter of an effect, a gear or a mode, by a difference of two prescribed motions."""

    index: int
    """Number of the parameter among the free ones."""
    about: float
    """Its coordinate where the derivative was taken."""
    remainder: ComplexArray
    """Of the remainder, shape (n_config, n_exp, n_bin, n_axis)."""
    linear: ComplexArray
    """Of the linear model's torque, likewise."""


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Weighted derivatives of the residual at one point."""

    keep: npt.NDArray[np.int64]
    """Bins that count."""
    factor: ComplexArray
    """Weights of these bins, (n_bin, n_axis, n_axis)."""
    rows: tuple[tuple[FloatArray, FloatArray], ...]
    """Real and imaginary part of the weighted derivatives of each configuration, (n_row, n_unknown) each."""
    matrices: FloatArray
    """``J^T J`` of each configuration, (n_config, n_unknown, n_unknown)."""


@dataclass(eq=False)
class TorqueProblem:
    """Residuals and normal equations; `remainder` and `effects` are renewed from outside."""

    free: FreeParameters
    motion: PeriodicMotion
    widths: tuple[float, ...]
    used: BoolArray
    """Bins that count, shape (n_bin,)."""
    bodies_held: bool = False
    angle: FloatArray = field(init=False)
    remainder: ComplexArray = field(init=False)
    effects: tuple[EffectColumn, ...] = ()
    """What parameters change that only a prescribed motion knows."""

    def __post_init__(self) -> None:
        robot, motion = self.free.robot, self.motion
        self.angle = robot.joint_angle(motion.angle.mean(axis=(1, 2)))
        speed = motion.fine_speed()
        columns = [motion.held_spectrum(law(speed)) for law in speed_functions(self.widths)]
        constant = np.zeros_like(columns[0])
        constant[:, :, 0] = 1.0
        self.friction = np.stack([*columns, constant])
        self.remainder = np.zeros_like(constant)
        self.remainder[:, :, 0] = robot.gravity_torque(self.angle)[:, None]

    # Unknowns

    @property
    def n_free(self) -> int:
        """Number of free parameters of the robot."""
        return len(self.free.names)

    @property
    def n_unknown(self) -> int:
        """Number of all unknowns."""
        return self.n_free + len(self.friction) * self.free.robot.n_axis + 1

    @property
    def prior(self) -> FloatArray:
        """Standard deviation of each unknown about zero, shape (n_unknown,)."""
        limit = FRICTION_PRIOR * self.free.robot.drives.torque_limit
        inertia = np.array([self.free.robot.parameter_kind(name) == "inertia" for name in self.free.names])
        own = np.where(inertia & self.bodies_held, HELD * self.free.prior, self.free.prior)
        return np.concatenate((own, np.tile(limit, len(self.friction)), [self.motion.sample_time_s]))

    def nuisance_names(self) -> tuple[str, ...]:
        """Names of the unknowns that are no parameters of the robot, in their order."""
        laws = [f"odd_{width:g}" for width in self.widths] + ["even", "constant"]
        axes = self.free.robot.axis_names
        return (*(f"friction_function.{axis}.{law}" for law in laws for axis in axes), "torque_delay")

    # Residuals

    def predicted(self, point: FloatArray, robot: Robot) -> ComplexArray:
        """Torque spectra without the delay."""
        z = impedance(robot, self.angle, self.motion, "zero_order_hold")
        coefficient = point[self.n_free : -1].reshape(len(self.friction), -1)
        torque = np.einsum("cfab,cxfb->cxfa", z, self.motion.acceleration_spectrum) + self.remainder
        for effect in self.effects:
            torque = torque + (point[effect.index] - effect.about) * effect.remainder
        result: ComplexArray = torque + np.einsum("kcxfa,ka->cxfa", self.friction, coefficient)
        return result

    def residual(self, point: FloatArray) -> ComplexArray:
        """Measured less predicted torque, N m, shape (n_config, n_exp, n_bin, n_axis)."""
        return self._against_measured(point, self.predicted(point, self.free.robot_at(point[: self.n_free])))

    def _against_measured(self, point: FloatArray, predicted: ComplexArray) -> ComplexArray:
        turn = np.exp(-1j * self.motion.omega * point[-1])[:, None]
        difference: ComplexArray = self.motion.torque_spectrum - turn * predicted
        return difference

    def noise(self, point: FloatArray) -> ComplexArray:
        """Covariance of the residual from differences between periods, shape (n_bin, n_axis, n_axis)."""
        robot = self.free.robot_at(point[: self.n_free])
        z = impedance(robot, self.angle, self.motion, "zero_order_hold")
        acceleration = -(self.motion.omega[:, None] ** 2) * self.motion.angle_deviation
        scatter = self.motion.torque_deviation - np.einsum("cfab,cxpfb->cxpfa", z, acceleration)
        n_config, n_exp, n_period = scatter.shape[:3]
        return covariance_of(scatter, n_config * n_exp * n_period * (n_period - 1))

    def cost(self, point: FloatArray, weight: ComplexArray) -> float:
        """Sum of squared residuals in standard deviations, and of the priors."""
        white = np.einsum("fab,cxfb->cxfa", weight, self.residual(point)) * self._root_of_count()[:, None]
        return float((np.abs(white) ** 2).sum() + ((point / self.prior) ** 2).sum())

    def _root_of_count(self) -> FloatArray:
        """Root of how often a bin counts: twice, for its mirror image; the mean once; a bin that is left out never."""
        count = np.where(self.used, np.sqrt(2.0), 0.0)
        count[0] /= np.sqrt(2.0)
        return count

    # Normal equations

    def linearise(self, point: FloatArray, weight: ComplexArray) -> Linearisation:
        """Weighted derivatives at a point; they hold for many steps about it, the residual is cheap to renew."""
        free = point[: self.n_free]
        robot = self.free.robot_at(free)
        bodies = body_derivatives(self.free, free, self.angle)
        predicted = self.predicted(point, robot)
        passive = passive_motion(robot, self.angle, self.motion.omega[1:])
        keep = np.flatnonzero(self.used)
        factor = weight[keep] * self._root_of_count()[keep, None, None]
        rows, matrices = [], []
        for c in range(len(predicted)):
            columns = self._columns(c, robot, passive[c], bodies, predicted[c])[:, keep]
            white = np.matmul(factor, columns).reshape(-1, self.n_unknown)
            parts = np.ascontiguousarray(white.real), np.ascontiguousarray(white.imag)
            rows.append(parts)
            matrices.append(parts[0].T @ parts[0] + parts[1].T @ parts[1])
        return Linearisation(keep, factor, tuple(rows), np.stack(matrices))

    def gradients(self, point: FloatArray, about: Linearisation) -> FloatArray:
        """``J^T r`` of each configuration at a point, with derivatives from another, shape (n_config, n_unknown)."""
        residual = self.residual(point)
        found = []
        for (real, imaginary), own in zip(about.rows, residual, strict=True):
            error = np.einsum("fab,xfb->xfa", about.factor, own[:, about.keep]).ravel()
            found.append(real.T @ error.real + imaginary.T @ error.imag)
        return np.stack(found)

    def _columns(
        self,
        config: int,
        robot: Robot,
        passive: ComplexArray,
        bodies: BodyDerivatives,
        predicted: ComplexArray,
    ) -> ComplexArray:
        """Derivatives of the predicted torque of one configuration, shape (n_exp, n_bin, n_axis, n_unknown)."""
        n_exp, n_bin, n_axis = predicted.shape
        found = np.zeros((n_exp, n_bin, n_axis, self.n_unknown), dtype=np.complex128)
        found[..., : self.n_free] = parameter_columns(self.free, robot, self.motion, config, passive, bodies)
        for effect in self.effects:
            found[..., effect.index] = effect.remainder[config] + effect.linear[config]
        for k, column in enumerate(self.friction[:, config]):
            for a in range(n_axis):
                found[:, :, a, self.n_free + k * n_axis + a] = column[:, :, a]
        found[..., -1] = -1j * self.motion.omega[:, None] * predicted
        return found
