"""The grey-box fit as a least-squares problem: residuals (3.1), their weights, and the Gauss-Newton equations.

Unknowns are logarithms: of every spring, of the damper beside it, and of one factor per motor on its
equivalent friction damping (the nominal friction linearised under the speeds that were measured; the factor
is a nuisance). The model is linearised anew at every point, at the gravity equilibrium that belongs to it; its
derivatives are taken at a fixed equilibrium, where the derivative of the response for a spring is the
rank-one product of a transfer vector with itself (science of the sag: its own derivative is a factor of the
gravity stiffness over the spring's, below a percent for a machine that stands).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core import Frf, Robot

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Unknowns:
    """Names, start values and meaning of what is estimated, in the order springs, dampers, friction factors."""

    names: tuple[str, ...]
    groups: tuple[str, ...]
    units: tuple[str, ...]
    start: FloatArray

    @property
    def n_spring(self) -> int:
        """Number of springs (and of dampers)."""
        return self.groups.count("stiffness")

    @classmethod
    def of_robot(cls, robot: Robot) -> Unknowns:
        """All springs and dampers of a robot, and one friction factor per axis."""
        springs, dampers = robot.stiffness_names, robot.damping_names  # the modes of links are not fitted
        stiffness, damping = (values[: len(springs)] for values in robot.spring_arrays())
        factors = tuple(f"friction_factor.{axis}" for axis in robot.axis_names)
        return cls(
            names=springs + dampers + factors,
            groups=("stiffness",) * len(springs) + ("damping",) * len(dampers) + ("nuisance",) * len(factors),
            units=tuple(robot.parameter_unit(n) for n in springs + dampers) + ("1",) * len(factors),
            start=np.concatenate([stiffness, np.maximum(damping, 1e-9 * stiffness), np.ones(len(factors))]),
        )


class LogResponseProblem:
    """Weighted residuals of one measured response matrix against one robot.

    Parameters
    ----------
    robot
        Nominal robot; its masses, gears and motors are taken as known.
    frf
        Measured response.
    covariance
        Covariance of the complex logarithm of vec(G), model error included, shape (n_config, n_freq, n_entry,
        n_entry); only lines that are used matter.
    used
        Lines to use, shape (n_config, n_freq).
    """

    def __init__(self, robot: Robot, frf: Frf, covariance: ComplexArray, used: npt.NDArray[np.bool_]) -> None:
        self.robot, self.frf, self.unknowns = robot, frf, Unknowns.of_robot(robot)
        self.used = used
        self._omega = 2 * np.pi * frf.frequency_hz
        self._motion = nominal_motor_damping(robot, frf)
        self._log_measured = np.where(used[..., None], np.log(_vec(frf.response) + 0j), 0.0)
        identity = np.eye(covariance.shape[-1])
        safe = np.where(used[..., None, None], covariance, identity)
        whitener = np.linalg.inv(np.linalg.cholesky(safe))
        self._whitener = np.where(used[..., None, None], whitener, 0.0)

    def at(self, point: FloatArray) -> tuple[Robot, FloatArray]:
        """Robot and equivalent motor damping (n_config, n_axis) at logarithmic unknowns."""
        n = self.unknowns.n_spring
        values = np.exp(point)
        named = dict(zip(self.unknowns.names[: 2 * n], values[: 2 * n].tolist(), strict=True))
        return self.robot.with_parameters(named), self._motion * values[2 * n :]

    def model(self, point: FloatArray) -> ComplexArray:
        """Response of the model, shape (n_config, n_freq, n_axis, n_axis)."""
        robot, motor_damping = self.at(point)
        return robot.response(self.frf.angle, self.frf.frequency_hz, motor_damping, self.frf.torque_hold)

    def whitened(self, response: ComplexArray) -> ComplexArray:
        """Residuals (3.1), phase wrapped to half a turn, in standard deviations; zero on unused lines."""
        error = self._log_measured - np.log(_vec(response) + 0j)
        error = error.real + 1j * (np.remainder(error.imag + np.pi, 2 * np.pi) - np.pi)
        whitened: ComplexArray = np.einsum("cfde,cfe->cfd", self._whitener, error)
        return whitened

    def cost(self, point: FloatArray) -> float:
        """Sum of squared standardised residuals: (3.2) with W the inverse covariance."""
        return float((np.abs(self.whitened(self.model(point))) ** 2).sum())

    def equations(self, point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Cost, gradient and Gauss-Newton matrix over all configurations."""
        cost, gradients, matrices = self.by_configuration(point)
        return cost, gradients.sum(axis=0), matrices.sum(axis=0)

    def by_configuration(self, point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Cost, and gradient (n_config, n) and Gauss-Newton matrix (n_config, n, n) of each configuration."""
        robot, motor_damping = self.at(point)
        g = robot.response_with_gradient(
            self.frf.angle, self.frf.frequency_hz, motor_damping, self.frf.torque_hold
        )
        residual = self.whitened(g.response)
        n_spring = len(robot.stiffness_names)
        stiffness, damping = (values[:n_spring] for values in robot.spring_arrays())
        springs = _vec_of_squares(g.spring_vectors[:, :, :n_spring])
        motors = _vec_of_squares(g.motor_vectors)
        s = 1j * self._omega[:, None, None]
        # e = log(measured) - log(model), so de/dlog p = -(p dG/dp) / G, and dG/dk = -x x^T.
        jacobian = (
            np.concatenate(
                [
                    springs * stiffness[:, None],
                    springs * damping[:, None] * s,
                    motors * motor_damping[:, None, :, None] * s,
                ],
                axis=2,
            )
            / _vec(g.response)[:, :, None, :]
        )
        weighted = np.einsum("cfde,cfpe->cfdp", self._whitener, jacobian, optimize=True)
        n_config, _, _, n = weighted.shape
        rows = weighted.reshape(n_config, -1, n)
        flat = residual.reshape(n_config, -1)
        gradients = 2 * np.einsum("crp,cr->cp", rows.conj(), flat).real
        matrices = 2 * (rows.conj().transpose(0, 2, 1) @ rows).real
        return float((np.abs(residual) ** 2).sum()), gradients, matrices


def nominal_motor_damping(robot: Robot, frf: Frf) -> FloatArray:
    """Friction of the nominal robot as an equivalent damping in each configuration, (n_config, n_axis)."""
    shape = frf.angle.shape
    if frf.speed_rms is None:
        return np.broadcast_to(robot.drives.viscous, shape).copy()
    sine = frf.slow_sine_speed if frf.slow_sine_speed is not None else np.zeros(shape)
    equivalent = robot.equivalent_motor_damping(frf.speed_rms, sine)
    # A frictionless nominal robot still gets a factor to move: a thousandth of what the rotor's inertia
    # takes at the lowest line.
    floor = 1e-3 * robot.drives.rotor_inertia * 2 * np.pi * frf.frequency_hz[0]
    floored: FloatArray = np.maximum(equivalent, floor)
    return floored


def log_covariance(
    response: ComplexArray, covariance: ComplexArray, model_error: float, coupling_share: float
) -> ComplexArray:
    """Covariance of log vec(G): measurement, divided by the response, plus the model's own error.

    The model error of entry (i, j) has the standard deviation ``model_error * sqrt(|g_ij|^2 + share^2 |g_ii g_jj|)``:
    relative to the entry, but at an antiresonance relative to its neighbours on the diagonal, since what the
    linear model leaves out does not vanish where the entry does.

    Parameters
    ----------
    response
        Response that the logarithm is taken of, shape (n_freq, n_axis, n_axis).
    covariance
        Covariance of vec(G), shape (n_freq, n_entry, n_entry).
    model_error, coupling_share
        See above, dimensionless.
    """
    g = _vec(response)
    diagonal = np.sqrt(np.abs(np.einsum("fii->fi", response)))
    floor = _vec(diagonal[:, :, None] * diagonal[:, None, :])
    relative = covariance / (g[:, :, None] * g[:, None, :].conj())
    variance = model_error**2 * (1 + (coupling_share * floor / np.abs(g)) ** 2)
    index = np.arange(g.shape[1])
    relative[:, index, index] += variance
    return relative


def _vec(matrix: npt.NDArray[np.generic]) -> ComplexArray:
    """Stack columns: entry (i, j) of the last two axes stands at j * n + i."""
    swapped = np.swapaxes(matrix, -1, -2)
    result: ComplexArray = swapped.reshape(*matrix.shape[:-2], -1)
    return result


def _vec_of_squares(vectors: ComplexArray) -> ComplexArray:
    """vec(x x^T) of each transfer vector, shape (..., n_vector, n_axis^2)."""
    outer = vectors[..., :, None] * vectors[..., None, :]
    result: ComplexArray = outer.reshape(*vectors.shape[:-1], -1)
    return result
