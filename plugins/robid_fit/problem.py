"""The grey-box fit as a least-squares problem: residuals (3.1), their weights, priors, and the Gauss-Newton equations.

Unknowns are the free parameters of the robot in natural scales, and per motor three numbers of its friction's gain
(nuisances, see `friction_gain`). The model is linearised anew at every point, at the gravity equilibrium that belongs
to it. The derivative for a spring, a damper or friction is the rank-one product of a transfer vector with itself, at
a fixed equilibrium (the sag's own derivative is a factor of the gravity stiffness over the spring's, below a percent
for a machine that stands); that for bodies, rotors and gear ratios is what they change of the matrices, the sag
included (`robid_core.mechanics.response_slopes`). For effects, and beside nonlinear springs, it is a difference of two
models.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robid_core import ComplexArray, FloatArray, FreeParameters, Frf, Robot, mechanism_change
from robid_core.mechanics import ResponseGradient, with_motor_impedance
from robid_fit.friction_gain import FrictionGain
from robid_fit.response_weights import is_uncoupled, stacked, with_floor

Equations = tuple[float, FloatArray, FloatArray]

STEP = 1e-4
"""Of a difference, in natural scales."""


class LogResponseProblem:
    """Weighted residuals of one measured response matrix against one robot, and what was known before.

    Parameters
    ----------
    free
        Parameters of the nominal robot; the others are taken as known.
    frf
        Measured response.
    covariance
        Covariance of the complex logarithm of vec(G), model error included, shape (n_config, n_freq, n_entry,
        n_entry); only lines that are used matter.
    used
        Lines to use, shape (n_config, n_freq).
    factor
        What the entries of the linear model's response are multiplied by, of the response's shape: see `slow_motion`.
    """

    def __init__(
        self,
        free: FreeParameters,
        frf: Frf,
        covariance: ComplexArray,
        used: npt.NDArray[np.bool_],
        factor: ComplexArray | float = 1.0,
    ) -> None:
        self.free, self.frf, self.used = free, frf, used
        self.friction = FrictionGain.of_response(free.robot, frf)
        self.names = free.names + self.friction.names
        self.start = np.concatenate((np.zeros(len(free.names)), self.friction.expected))
        self.prior = np.concatenate((free.prior, self.friction.prior))
        self.lower = np.concatenate((free.lower, self.friction.expected - self.friction.reach))
        self.upper = np.concatenate((free.upper, self.friction.expected + self.friction.reach))
        self._factor = factor
        self._omega = 2 * np.pi * frf.frequency_hz
        self._hold = free.robot.sample_time_s if frf.torque_hold == "zero_order_hold" else None
        self._log_measured = np.where(used[..., None], np.log(stacked(with_floor(frf.response)) + 0j), 0.0)
        safe = np.where(used[..., None, None], covariance, np.eye(covariance.shape[-1]))
        self._whitener = np.where(used[..., None, None], np.linalg.inv(np.linalg.cholesky(safe)), 0.0)

    def parts(self, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Unknowns of the robot, and those of friction's gain."""
        n = len(self.free.names)
        return point[:n], point[n:]

    def robot_at(self, point: FloatArray) -> Robot:
        """Robot at a vector of unknowns."""
        return self.free.robot_at(self.parts(point)[0])

    def motor_damping(self, point: FloatArray) -> FloatArray:
        """Equivalent damping of friction, N m s/rad, shape (n_config, n_axis)."""
        return self.friction.damping(self.parts(point)[1])

    def values(self, point: FloatArray) -> FloatArray:
        """Unknowns in their own units, shape (n,)."""
        coordinates, own = self.parts(point)
        return np.concatenate((list(self.free.values(coordinates).values()), self.friction.values(own)))

    def slope(self, point: FloatArray) -> FloatArray:
        """Derivative of `values`, shape (n, n)."""
        coordinates, own = self.parts(point)
        n, result = len(coordinates), np.zeros((len(point), len(point)))
        result[:n, :n] = self.free.jacobian(coordinates)
        result[n:, n:] = np.diag(self.friction.slopes(own))
        return result

    def model(self, point: FloatArray) -> ComplexArray:
        """Response of the model, shape (n_config, n_freq, n_axis, n_axis)."""
        robot = self.robot_at(point)
        return self._as_measured(robot, point, self._plant(robot, point))

    def between_lines(self, point: FloatArray, frequency_hz: FloatArray) -> ComplexArray:
        """Response of the model at other frequencies of the band, shape (n_config, n_freq, n_axis, n_axis).

        The robot is computed there. What is known at the lines only, friction's gain beyond a damping and the factor,
        is interpolated: both are smooth over frequency.
        """

        def along(values: ComplexArray) -> ComplexArray:
            lines, flat = self.frf.frequency_hz, np.moveaxis(values, 1, -1)
            rows = flat.reshape(-1, len(lines))
            found = np.stack([np.interp(frequency_hz, lines, row) for row in rows])
            return np.moveaxis(found.reshape(*flat.shape[:-1], -1), -1, 1)

        robot, omega = self.robot_at(point), 2 * np.pi * frequency_hz
        angle, _, damping, hold = self._told(point)
        plain = robot.response_with_gradient(angle, frequency_hz, damping, hold)
        excess = along(self.friction.at(self.parts(point)[1])[0]) * (1j * omega[:, None])
        result = with_motor_impedance(plain, excess, omega, self._hold).response
        if robot.signals:
            result = result * (
                robot.response(angle, frequency_hz, damping, hold) / with_floor(plain.response)
            )
        scaled: ComplexArray = result * (along(self._factor) if isinstance(self._factor, np.ndarray) else 1.0)
        return scaled

    def n_told(self, point: FloatArray) -> int:
        """Real numbers that the data tell: two for each entry of a used line by which an axis acts on another."""
        return 2 * int((~is_uncoupled(self.model(point)))[self.used].sum())

    def cost(self, point: FloatArray) -> float:
        """Sum of squared standardised residuals, (3.2) with W the inverse covariance, and what priors add."""
        return float((np.abs(self._residual(self.model(point))) ** 2).sum()) + self._prior_cost(point)

    def equations(self, point: FloatArray) -> Equations:
        """Cost, gradient and Gauss-Newton matrix over all configurations and priors."""
        cost, gradients, matrices = self.by_configuration(point)
        slope = (point - self.start) / self.prior**2
        matrix = matrices.sum(axis=0) + np.diag(1 / self.prior**2)
        return cost + self._prior_cost(point), gradients.sum(axis=0) + slope, matrix

    def by_configuration(self, point: FloatArray) -> Equations:
        """Cost, and gradient (n_config, n) and Gauss-Newton matrix (n_config, n, n) of each configuration's data."""
        robot = self.robot_at(point)
        plant = self._plant(robot, point)
        model = self._as_measured(robot, point, plant)
        residual = self._residual(model)
        # e = log(measured) - log(model), so de/dp = -(dG/dp) / G.
        jacobian = np.concatenate(
            (self._of_robot(robot, point, plant, model), self._of_friction(point, plant)), axis=2
        )
        weighted = np.einsum("cfde,cfpe->cfdp", self._whitener, jacobian, optimize=True)
        n_config, _, _, n = weighted.shape
        rows = weighted.reshape(n_config, -1, n)
        gradients = 2 * np.einsum("crp,cr->cp", rows.conj(), residual.reshape(n_config, -1)).real
        matrices = 2 * (rows.conj().transpose(0, 2, 1) @ rows).real
        return float((np.abs(residual) ** 2).sum()), gradients, matrices

    def _residual(self, response: ComplexArray) -> ComplexArray:
        """Residuals (3.1), phase wrapped to half a turn, in standard deviations; zero on unused lines."""
        error = self._log_measured - np.log(stacked(with_floor(response)) + 0j)
        error = error.real + 1j * (np.remainder(error.imag + np.pi, 2 * np.pi) - np.pi)
        whitened: ComplexArray = np.einsum("cfde,cfe->cfd", self._whitener, error)
        return whitened

    def _prior_cost(self, point: FloatArray) -> float:
        return float(0.5 * (((point - self.start) / self.prior) ** 2).sum())

    def _told(self, point: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, str]:
        """What `Robot.response` is asked."""
        return self.frf.angle, self.frf.frequency_hz, self.motor_damping(point), self.frf.torque_hold

    def _plant(self, robot: Robot, point: FloatArray) -> ResponseGradient:
        """Response and transfer vectors of the plant behind the channels, friction's complex gain in them."""
        excess = self.friction.at(self.parts(point)[1])[0] * (1j * self._omega[:, None])
        plain = robot.response_with_gradient(*self._told(point))
        return with_motor_impedance(plain, excess, self._omega, self._hold)

    def _as_measured(self, robot: Robot, point: FloatArray, plant: ResponseGradient) -> ComplexArray:
        """Response of the plant times the factors of the entries: signal effects, and what was given."""
        result: ComplexArray = plant.response * self._factor
        if robot.signals:
            told = self._told(point)
            linear = with_floor(robot.response_with_gradient(*told).response)
            result = result * (robot.response(*told) / linear)
        return result

    def _of_robot(
        self, robot: Robot, point: FloatArray, plant: ResponseGradient, model: ComplexArray
    ) -> ComplexArray:
        """Derivatives of the residual for the free parameters, shape (n_config, n_freq, n_free, n_entry)."""
        shape = (*plant.response.shape[:2], len(self.free.names), plant.response.shape[2] ** 2)
        columns = np.empty(shape, dtype=np.complex128)
        springs, dampers = robot.stiffness_names, robot.damping_names
        stiffness, damping = robot.spring_arrays()
        by_matrices = self._by_matrices(robot)
        if by_matrices:
            columns[:, :, by_matrices] = self._of_matrices(robot, point, plant, by_matrices)
        for i, name in enumerate(self.free.names):
            if name in springs:
                k = springs.index(name)
                columns[:, :, i] = _square(plant.spring_vectors[:, :, k], plant) * stiffness[k]
            elif name in dampers:
                k = dampers.index(name)
                scale = 1j * self._omega[:, None] * damping[k]
                columns[:, :, i] = _square(plant.spring_vectors[:, :, k], plant) * scale
            elif i not in by_matrices:
                moved = point.copy()
                moved[i] += STEP
                columns[:, :, i] = (
                    1 - stacked(with_floor(self.model(moved))) / stacked(with_floor(model))
                ) / STEP
        return columns

    def _by_matrices(self, robot: Robot) -> list[int]:
        """Return the numbers of the parameters of which the linear model's matrices tell all."""
        if robot.bending_forces:
            return []
        kinds = [self.free.robot.parameter_kind(name) for name in self.free.names]
        return [i for i, kind in enumerate(kinds) if kind in ("inertia", "gear")]

    def _of_matrices(
        self, robot: Robot, point: FloatArray, plant: ResponseGradient, index: list[int]
    ) -> ComplexArray:
        """Derivatives of the residual for bodies, rotors and gears, shape (n_config, n_freq, n_index, n_entry)."""
        coordinates, own = self.parts(point)
        angle, _, motor_damping, _ = self._told(point)
        change = mechanism_change(self.free, self.free.robot, coordinates, index)
        parts = robot.mechanism, *robot.spring_arrays(), robot.equilibrium(angle).position
        slopes = robot.batches.second_order_slopes(*parts, change)
        excess = self.friction.at(own)[0] * (1j * self._omega[:, None])
        model = robot.second_order(angle, motor_damping)
        moved = robot.batches.response_slopes(model, slopes, self._omega, self._hold, excess)
        result: ComplexArray = (
            -stacked(np.moveaxis(moved, -1, 2)) / stacked(with_floor(plant.response))[:, :, None]
        )
        return result

    def _of_friction(self, point: FloatArray, plant: ResponseGradient) -> ComplexArray:
        """Derivatives of the residual for friction's gain, shape (n_config, n_freq, 3 n_axis, n_entry)."""
        slope = self.friction.at(self.parts(point)[1])[1] * (1j * self._omega[:, None, None])
        n_axis = slope.shape[-1]
        squares = np.stack([_square(plant.motor_vectors[:, :, a], plant) for a in range(n_axis)], axis=2)
        scaled = slope[..., None] * squares[:, :, None]
        result: ComplexArray = scaled.reshape(*scaled.shape[:2], -1, scaled.shape[-1])
        return result


def _square(vector: ComplexArray, plant: ResponseGradient) -> ComplexArray:
    """``vec(x x^T) / vec(G)`` of transfer vectors (n_config, n_freq, n_axis)."""
    square = vector[..., :, None] * vector[..., None, :]
    result: ComplexArray = stacked(square) / stacked(with_floor(plant.response))
    return result
