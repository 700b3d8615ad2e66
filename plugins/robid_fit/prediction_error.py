"""Prediction errors of a robot's linear models along a record, as a likelihood with its derivatives.

Unknowns are the free parameters of the robot in natural scales, and logarithms of the noise: per motor its white
torque, what that torque walks, and the angle's noise. All configurations share them. Each is linearised at its own
gravity equilibrium, with the robot's viscous friction; lanes are taken about their means, since the model knows
deviations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid_core import DataRejected, FloatArray, FreeParameters, Record
from robid_core.mechanics import SecondOrderModel
from robid_fit.innovations import (
    Prediction,
    likelihood_equations,
    log_likelihood_cost,
    predict,
)
from robid_fit.sampled_model import N_NOISE, SampledModel

NOISES = ("torque_noise", "torque_walk", "position_noise")
UNITS = ("N m", "N m/sqrt(s)", "rad")
STEP = 1e-4  # of differences of the robot's matrices, in natural scales: what is left is 1e-8 of them
SHARE_OF_TORQUE = 1e-2  # of the torque's rms: where its noise begins
RANGE = 9.0  # of a noise's logarithm, either way
NOISE_PRIOR = 4.0  # standard deviation of that logarithm: an amplitude that no data show stays finite
DIFFERENCES = 6  # of which an angle's noise leaves most, and motion next to nothing


@dataclass(frozen=True, eq=False)
class Lanes:
    """Deviations of torque and angle of the experiments of one configuration, (n_sample, n_lane, n_axis) each."""

    torque: FloatArray
    position: FloatArray
    configuration: int


def lanes_of(record: Record, discard: int) -> list[Lanes]:
    """Experiments of a record by run and configuration, their means taken off.

    Raises
    ------
    DataRejected
        Where a sample is missing, or all periods are dropped.
    """
    found = []
    for run in record.runs:
        if discard >= run.n_period:
            raise DataRejected(
                f"{run.n_period} periods were measured and {discard} are to be dropped: none is left"
            )
        if not run.valid[:, :, :, discard:].all():
            c, b, e, p, n = (int(i) for i in np.argwhere(~run.valid[:, :, :, discard:])[0])
            raise DataRejected(
                f"a sample is missing in {run.sample_place(c, b, e, p + discard, n)}; a predictor needs every sample: "
                "cut the recording there, or read it with gaps: split"
            )
        torque, position = (
            run.values(name)[:, :, :, discard:].reshape(
                len(run.valid), run.valid[0, :, :, 0, 0].size, -1, len(record.axis_names)
            )
            for name in ("motor_torque", "motor_position")
        )
        for c in range(len(torque)):
            u, y = (values[c] - values[c].mean(axis=1, keepdims=True) for values in (torque, position))
            found.append(Lanes(np.moveaxis(u, 0, 1).copy(), np.moveaxis(y, 0, 1).copy(), c))
    return found


class PredictionErrorProblem:
    """Negative log-likelihood of the innovations of all lanes, with what was known before.

    Parameters
    ----------
    free
        Parameters of the robot; the others are taken as known.
    record
        Motor torque and motor angle.
    discard
        Leading periods that are left out.
    """

    def __init__(self, free: FreeParameters, record: Record, discard: int = 0) -> None:
        self.free, self.angle, self.lanes = free, record.angle, lanes_of(record, discard)
        self.sample_time = record.runs[0].sample_time_s
        axes = record.axis_names
        self.noise_names = tuple(f"{noise}.{axis}" for noise in NOISES for axis in axes)
        self.noise_start = _noise_of(self.lanes)
        n, n_noise = len(free.names), self.noise_start.size
        self.start = np.zeros(n + n_noise)
        self.prior = np.concatenate((free.prior, np.full(n_noise, NOISE_PRIOR)))
        self.lower = np.concatenate((free.lower, np.full(n_noise, -RANGE)))
        self.upper = np.concatenate((free.upper, np.full(n_noise, RANGE)))
        # Variances of innovations are above those of the angles: with the least of these the cost is never below zero.
        count = sum(lanes.position.shape[0] * lanes.position.shape[1] for lanes in self.lanes)
        self._floor: float = count * float((np.log(self.noise_start[2]) - RANGE).sum())
        self._last: tuple[bytes, list[SampledModel], list[Prediction]] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Unknowns in their order."""
        return self.free.names + self.noise_names

    def noise(self, point: FloatArray) -> FloatArray:
        """Standard deviations of the noise, shape (3, n_axis), in `UNITS`."""
        own = point[len(self.free.names) :].reshape(N_NOISE, -1)
        result: FloatArray = self.noise_start * np.exp(own)
        return result

    def values(self, point: FloatArray) -> FloatArray:
        """Unknowns in their own units, shape (n,)."""
        own = self.free.values(point[: len(self.free.names)])
        return np.concatenate((list(own.values()), self.noise(point).ravel()))

    def slope(self, point: FloatArray) -> FloatArray:
        """Derivative of `values`, shape (n, n)."""
        n = len(self.free.names)
        result = np.diag(np.concatenate((np.zeros(n), self.noise(point).ravel())))
        result[:n, :n] = self.free.jacobian(point[:n])
        return result

    def predictions(self, point: FloatArray) -> tuple[list[SampledModel], list[Prediction]]:
        """Return the models of the configurations, and what they predict of each entry of `lanes`."""
        key = point.tobytes()
        if self._last is None or self._last[0] != key:
            matrices, noise = self._matrices(point), self.noise(point)
            models = [SampledModel.of(matrices, c, self.sample_time, noise) for c in range(len(self.angle))]
            found = [
                predict(models[one.configuration].predictor, one.torque, one.position) for one in self.lanes
            ]
            self._last = key, models, found
        return self._last[1], self._last[2]

    def cost(self, point: FloatArray) -> float:
        """Negative log-likelihood above its least possible value, and what priors add; infinite where no model is."""
        if not self.free.robot_at(point[: len(self.free.names)]).is_possible:
            return float("inf")
        try:
            models, found = self.predictions(point)
        except DataRejected:  # of a trial step: a shorter one may do
            return float("inf")
        total: float = 0.5 * float(((point / self.prior) ** 2).sum()) - self._floor
        for one, prediction in zip(self.lanes, found, strict=True):
            total += log_likelihood_cost(models[one.configuration].predictor, prediction)
        return total

    def equations(self, point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Cost, gradient (n,) and information (n, n), priors included."""
        cost = self.cost(point)
        models, found = self.predictions(point)
        gradient, information = point / self.prior**2, np.diag(1 / self.prior**2)
        slopes = self._matrix_slopes(point)
        of_models = [model.slopes(*(part[:, c] for part in slopes)) for c, model in enumerate(models)]
        for one, prediction in zip(self.lanes, found, strict=True):
            c = one.configuration
            more, told = likelihood_equations(models[c].predictor, of_models[c], one.torque, prediction)
            gradient, information = gradient + more, information + told
        return cost, gradient, information

    def _matrices(self, point: FloatArray) -> SecondOrderModel:
        return self.free.robot_at(point[: len(self.free.names)]).second_order(self.angle)

    def _matrix_slopes(self, point: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives of mass, damping and stiffness, (n_free, n_config, n_coordinate, n_coordinate) each."""
        ends: list[list[SecondOrderModel]] = []
        for i in range(len(self.free.names)):
            step = np.zeros_like(point)
            step[i] = STEP
            ends.append([self._matrices(point + step), self._matrices(point - step)])
        parts = (
            [(getattr(above, name) - getattr(below, name)) / (2 * STEP) for above, below in ends]
            for name in ("mass", "damping", "stiffness")
        )
        mass, damping, stiffness = (np.array(part) for part in parts)
        return mass, damping, stiffness


def _noise_of(lanes: Sequence[Lanes]) -> FloatArray:
    """Where the noise begins, (3, n_axis): shares of the torque, and what differences leave of the angles.

    Raises DataRejected where a motor's torque or angle does not change.
    """
    power = np.mean([(one.torque**2).mean(axis=(0, 1)) for one in lanes], axis=0)
    white = np.prod(
        [(2 * k - 1) * 2 / k for k in range(1, DIFFERENCES + 1)]
    )  # (2 n)! / n!^2: sum of squared weights
    left = [(np.diff(one.position, DIFFERENCES, axis=0) ** 2).mean(axis=(0, 1)) / white for one in lanes]
    noise = np.mean(left, axis=0)
    if not (power > 0).all() or not (noise > 0).all():
        axis = int(np.argmin((power > 0) & (noise > 0)))
        raise DataRejected(
            f"torque or angle of motor {axis + 1} does not change in the record; take one in which every motor moves"
        )
    return np.stack((SHARE_OF_TORQUE * np.sqrt(power), SHARE_OF_TORQUE * np.sqrt(power), np.sqrt(noise)))
