"""Output error of a simulated closed loop as a least-squares problem: residuals, their derivatives, and what counts.

The robot is simulated under the recorded references; what is left of the recorded outputs, in units of their weights,
are the residuals. Derivatives are central differences of simulations. Residuals of a simulation are correlated in
time, so that their number overstates what they tell: beside priors they count by their mean square and by the number
of samples over which scores are correlated (`information_share`), a quasi-likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid_core import ConfigurationError, FloatArray, FreeParameters, Record, Robot, simulate_records
from robid_core.estimation.disagreement import ExperimentShare
from robid_core.estimation.serial_correlation import long_run_matrix
from robid_core.mechanics import SimulationDiverged

ROUNDING = 1e-30  # of a squared residual in units of what was measured


@dataclass(frozen=True)
class Prediction:
    """How outputs are simulated: from where, and how far."""

    start: str
    horizon_s: float | None
    half_window: int
    skip_s: float
    step: float
    """Of differences, in natural scales."""


@dataclass(frozen=True, eq=False)
class Part:
    """A record under its robot, with the outputs that are compared."""

    record: Record
    robot: Robot


def compared(record: Record, outputs: Sequence[str], skip_s: float) -> list[FloatArray]:
    """Outputs of each run side by side from `skip_s` on, (n_lane, n_sample, n_output n_axis) each."""
    return [
        np.concatenate([run.lanes(name)[:, round(skip_s / run.sample_time_s) :] for name in outputs], axis=2)
        for run in record.runs
    ]


class OutputErrorProblem:
    """Standardised output errors of records under variants of one robot, and what was known before.

    Parameters
    ----------
    free
        Parameters of the nominal robot that all variants share.
    parts
        Records with their robots; those of one robot are simulated side by side.
    outputs
        Channels that are compared.
    scale
        What a residual is divided by, shape (n_output n_axis,); infinite for what does not count.
    prediction
        How outputs are simulated.
    """

    def __init__(
        self,
        free: FreeParameters,
        parts: Sequence[Part],
        outputs: Sequence[str],
        scale: FloatArray,
        prediction: Prediction,
    ) -> None:
        self.free, self.parts, self.outputs, self.scale = free, tuple(parts), tuple(outputs), scale
        self.prediction = prediction
        self.share = 1.0
        """What a squared residual counts beside priors."""
        robots = list({id(part.robot): part.robot for part in parts}.values())
        self._alike = [(one, [i for i, part in enumerate(parts) if part.robot is one]) for one in robots]
        self._measured = [compared(part.record, outputs, prediction.skip_s) for part in parts]
        self._last: tuple[bytes, list[FloatArray]] | None = None
        self._slopes: tuple[bytes, list[FloatArray]] | None = None

    @property
    def n_residual(self) -> int:
        """Residuals that count."""
        counted = int(np.isfinite(self.scale).sum())
        return counted * sum(len(one) * len(one[0]) for runs in self._measured for one in runs)

    def simulated(self, point: FloatArray) -> list[Record]:
        """Return the records that the robots of a point give.

        Raises
        ------
        SimulationDiverged
            Where one leaves all bounds.
        ConfigurationError
            Where its controller is unstable.
        """
        how = self.prediction
        found: dict[int, Record] = {}
        for robot, numbers in self._alike:
            records = simulate_records(
                self.free.set_on(robot, point),
                [self.parts[number].record for number in numbers],
                "rest" if how.start == "rest" else "motion",
                horizon_s=how.horizon_s,
                half_window=how.half_window,
            )
            found.update(zip(numbers, records, strict=True))
        return [found[number] for number in range(len(self.parts))]

    def residuals(self, point: FloatArray) -> list[FloatArray]:
        """Simulated less measured outputs in units of their scale, (n_lane, n_sample, n_output n_axis) of each run."""
        key = point.tobytes()
        if self._last is None or self._last[0] != key:
            found = []
            for record, measured in zip(self.simulated(point), self._measured, strict=True):
                outputs = compared(record, self.outputs, self.prediction.skip_s)
                found += [(own - theirs) / self.scale for own, theirs in zip(outputs, measured, strict=True)]
            self._last = (key, found)
        return self._last[1]

    def derivatives(self, point: FloatArray) -> list[FloatArray]:
        """Derivatives of `residuals`, (n_lane, n_sample, n_output n_axis, n_free) of each run."""
        if self._slopes is not None and self._slopes[0] == point.tobytes():
            return self._slopes[1]
        here = self.residuals(point)
        found = [np.empty((*one.shape, len(point))) for one in here]
        for i in range(len(point)):
            ends, where = [], []
            for sign in (1.0, -1.0):
                moved = point.copy()
                moved[i] = np.clip(
                    point[i] + sign * self.prediction.step, self.free.lower[i], self.free.upper[i]
                )
                there = self._residuals_if_any(moved)
                ends.append(here if there is None else there)
                where.append(point[i] if there is None else moved[i])
            width = where[0] - where[1]
            for one, above, below in zip(found, *ends, strict=True):
                one[..., i] = (above - below) / width if width else 0.0
        self._last, self._slopes = (point.tobytes(), here), (point.tobytes(), found)
        return found

    def cost(self, point: FloatArray) -> float:
        """Half the sum of squared residuals, as far as they count, and of what priors add; infinite where none is."""
        residuals = self._residuals_if_any(point)
        if residuals is None:  # of a trial step: a shorter one may do
            return float("inf")
        return 0.5 * self.share * _power(residuals) + 0.5 * float(((point / self.free.prior) ** 2).sum())

    def equations(self, point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Cost, gradient (n,) and Gauss-Newton matrix (n, n)."""
        gradient, matrix = point / self.free.prior**2, np.diag(1 / self.free.prior**2)
        residuals = self.residuals(point)
        for slope, residual in zip(self.derivatives(point), residuals, strict=True):
            flat = slope.reshape(-1, len(point))
            gradient = gradient + self.share * flat.T @ residual.ravel()
            matrix = matrix + self.share * flat.T @ flat
        return self.cost(point), gradient, matrix

    def information(self, point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Mean square of the residuals, J^T J and the scores' long-run covariance, (n, n) each, without priors."""
        residuals, slopes = self.residuals(point), self.derivatives(point)
        n = len(point)
        flat = [slope.reshape(-1, n) for slope in slopes]
        scores = [np.einsum("lto,lton->ltn", r, slope) for r, slope in zip(residuals, slopes, strict=True)]
        mean_square = _power(residuals) / max(self.n_residual - n, 1)
        return mean_square, np.sum([one.T @ one for one in flat], axis=0), long_run_matrix(scores)

    def by_experiment(self, point: FloatArray) -> list[ExperimentShare]:
        """What each experiment adds to half the cost, as far as it counts."""
        found, n = list[ExperimentShare](), len(point)
        for residual, slope in zip(self.residuals(point), self.derivatives(point), strict=True):
            for own, rows in zip(residual, slope, strict=True):
                flat, scores = rows.reshape(-1, n), np.einsum("to,ton->tn", own, rows)
                found.append(
                    ExperimentShare(
                        self.share * flat.T @ flat,
                        self.share * scores.sum(axis=0),
                        self.share**2 * long_run_matrix([scores[None]]),
                    )
                )
        return found

    def _residuals_if_any(self, point: FloatArray) -> list[FloatArray] | None:
        """Residuals, or None where a robot cannot be, or its simulation leaves all bounds."""
        if not self._is_possible(point):
            return None
        try:
            return self.residuals(point)
        except (SimulationDiverged, ConfigurationError):
            return None

    def _is_possible(self, point: FloatArray) -> bool:
        return all(self.free.set_on(robot, point).is_possible for robot, _ in self._alike)


def information_share(mean_square: float, gauss_newton: FloatArray, long_run: FloatArray) -> float:
    """What one squared residual counts in a likelihood: the inverse of its mean, and of the samples it is alike over.

    Those are the long-run variance of the scores over that of white residuals, geometric mean over the parameters; at
    least one.
    """
    white = mean_square * np.diag(gauss_newton)
    told = white > 0
    ratio = np.log(np.diag(long_run)[told] / white[told]) if told.any() else np.zeros(1)
    return 1 / (max(mean_square, ROUNDING) * max(float(np.exp(ratio.mean())), 1.0))


def _power(residuals: Sequence[FloatArray]) -> float:
    return float(sum(np.vdot(one, one) for one in residuals))
