"""Solution of a rigid fit: rounds of {laws run along the motion, weights, Gauss-Newton steps} until nothing moves.

Each axis is weighted by what it leaves, and by how coloured that is. The tolerances of bodies and rotors are widened
by one common factor where the data ask for it: that which makes them most likely (D. J. C. MacKay, Bayesian
interpolation, 1992).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robid_core import ConfigurationError, FloatArray, NotIdentifiable
from robid_core.estimation.disagreement import ExperimentShare
from robid_core.estimation.least_squares import levenberg_marquardt
from robid_core.estimation.rigid.coloured import (
    bandwidth,
    inflation,
    sandwich,
    score_covariance,
)
from robid_core.estimation.scaled_inverse import scaled_inverse
from robid_fit.rigid_equations import RigidEquations
from robid_fit.rigid_reversal import GRID, best_of_grid
from robid_fit.rigid_rows import beside, size, spanned, triangles
from robid_fit.rigid_unknowns import RigidUnknowns
from robid_fit.tolerances import tolerance_factor

ROUNDS = 40
STAYS = 0.02  # standard errors, and share of a weight or a tolerance: less is no change
HUBER = 1.345  # deviations beyond which a sample counts less: 95 % efficient where noise is normal
NORMAL = 1.4826  # standard deviations in a median of absolute values
WIDEST = 100.0  # times a tolerance
ROUNDING = 1e-12  # of the torque: a residual of that is none
SHORTER = 0.5
SAME = 1e-9  # of a cost
SMALL = 1e-6  # of coordinates
ALIKE = 1e-12  # of the largest eigenvalue, unknowns scaled alike: a millionth of a column is rounding
TRUSTED = 1.0  # natural units that a law's number moves at once


@dataclass(frozen=True, eq=False)
class Linearised:
    """Equations, weights and residual, linearised about one point."""

    point: FloatArray
    residual: FloatArray
    """Torque that is left, (n_equation, n_axis)."""
    torque: FloatArray
    """Measured, its delay taken off, (n_equation, n_axis)."""
    regressor: FloatArray
    """Torque per unit of every column, (n_equation, n_axis, n_column)."""
    differentiate: Callable[[], FloatArray]
    """Makes `rows`: most points of a search are left again for what remains there alone."""

    @cached_property
    def rows(self) -> FloatArray:
        """Derivative of the predicted torque, (n_equation, n_axis, n_unknown)."""
        return self.differentiate()


@dataclass(frozen=True, eq=False)
class RigidSolution:
    """Estimates of a rigid fit, with covariance and what the rounds reached."""

    at: Linearised
    covariance: FloatArray
    """Of the coordinates, (n_unknown, n_unknown)."""
    white: FloatArray
    """The same if residuals had no memory."""
    prior: FloatArray
    """Standard deviations as they were used, (n_unknown,)."""
    widened: float
    """By which the tolerances of bodies and rotors are wider than stated."""
    asked: float
    """By which they would be the likeliest, with unknowns as they are."""
    deviation: FloatArray
    """Of what is left, (n_axis,)."""
    inflation: FloatArray
    """Long-run variance over variance of what is left, (n_axis,)."""
    hessian: FloatArray
    """Of half the cost, priors included, (n_unknown, n_unknown)."""
    experiments: tuple[ExperimentShare, ...]
    """What each adds to it."""
    n_rounds: int
    converged: bool


class RigidProblem:
    """Equations, unknowns, and instruments where there are any."""

    def __init__(
        self,
        equations: RigidEquations,
        unknowns: RigidUnknowns,
        instruments: RigidEquations | None,
        *,
        robust: bool,
        widen: bool,
        counts: FloatArray | None = None,
    ) -> None:
        """Prepare; `counts` is zero for equations that are left out, (n_equation,), beside those at rest."""
        self.equations, self.unknowns, self.instruments = equations, unknowns, instruments
        self.robust, self.widen = robust, widen
        self._counts = equations.counted if counts is None else equations.counted * counts[:, None]
        self.laws, self._place = unknowns.laws, unknowns.bends
        self._n_free = len(unknowns.free.names)

    def linearised(self, point: FloatArray) -> Linearised:
        """Run all laws about a point."""
        return self._of(self.equations, point)

    def unweighted(self, point: FloatArray) -> Linearised:
        """Likewise, with samples at rest, which a fit may leave out."""
        return self._of(self.equations.unweighted, point)

    def _of(self, equations: RigidEquations, point: FloatArray) -> Linearised:
        """What is left, and how it changes, with the laws as linear as they are here."""
        unknowns = self.unknowns
        equations = equations.at_friction_speed(unknowns.friction_speed(point, equations.friction_speed))
        linear = unknowns.linear(point)
        robot = unknowns.free.robot_at(point[: self._n_free]) if self.laws else unknowns.free.robot
        torque, columns = equations.of_effects(robot, self.laws, linear)
        measured = equations.torque_earlier(unknowns.delay(point)) if unknowns.delays else equations.torque
        predicted = equations.regressor @ linear + torque

        def rows() -> FloatArray:
            found: FloatArray = equations.regressor @ unknowns.linear_slopes(point)
            if self.laws:
                found = found + columns @ unknowns.slopes(point)[self._place[: len(self.laws)]]
            if unknowns.turning:
                turned = equations.friction_slope() * linear[equations.coulomb] * equations.friction_speed
                for axis, place in unknowns.turning.items():
                    found[:, axis, place] += turned[:, axis]
            if unknowns.delays:
                # Of the predicted torque: the derivative of the measured one would count its noise as information.
                later = -unknowns.sample_time_s * equations.rate(predicted)
                found[..., unknowns.n_own :] = later[..., None] * unknowns.delayed
            return found

        return Linearised(point, measured - predicted, measured, equations.regressor, rows)

    def left_out(
        self, at: RigidSolution, n_block: int, progress: Callable[[float, float, str], None]
    ) -> tuple[FloatArray, int]:
        """Torque that is left, (n_equation, n_axis), of each of so many blocks by a fit to all others.

        And how many of these fits did not settle.
        """
        found, n_unsettled = np.empty_like(at.at.residual), 0
        for number, block in enumerate(np.array_split(np.arange(len(found)), n_block)):
            progress(1 + number, 1 + n_block, "predicting a block left out")
            counts = np.ones(len(found))
            counts[block] = 0.0
            given = self.equations, self.unknowns, self.instruments
            rest = RigidProblem(*given, robust=self.robust, widen=self.widen, counts=counts).solve(at.at)
            found[block] = rest.at.residual[block]
            n_unsettled += not rest.converged
        return found, n_unsettled

    def solve(self, begin: Linearised | None = None) -> RigidSolution:
        """Go on until weights, tolerances and unknowns stay."""
        here = begin or self._first()
        scale, widened = np.sqrt((self.equations.torque**2).mean(axis=0)), 1.0
        scale = np.where(scale > 0, scale, 1.0)
        kappa, weights, n_rounds = np.ones_like(scale), self._counts, 0
        settled, asked, last = False, 1.0, np.zeros_like(here.point)
        while not settled and n_rounds < ROUNDS:
            n_rounds += 1
            prior = self._prior(widened)
            there = self._moved(here, weights / (scale * np.sqrt(kappa)), prior, last)
            last = there.point - here.point
            deviation, ratio, weights = self._weights(there)
            error = np.sqrt(np.diag(self._posterior(there, weights / (deviation * np.sqrt(ratio)), prior)))
            asked = self._asked(there.point, error, prior, widened)
            wider = asked if self.widen else 1.0
            moved = np.abs(there.point - here.point) / np.where(error > 0, error, 1.0)
            changes = np.abs(np.log(np.concatenate((deviation / scale, ratio / kappa, [wider / widened]))))
            here, scale, kappa, widened = there, deviation, ratio, wider
            rounding = ROUNDING * float(np.abs(self.equations.torque).max())
            settled = max(moved.max(initial=0.0), changes.max()) < STAYS or bool(
                (deviation <= rounding).any()
            )
        return self._solution(here, scale, kappa, weights, (widened, asked), n_rounds, settled)

    def _first(self) -> Linearised:
        """Begin at the told robot, but with the best of some speeds within which friction turns, axis by axis."""
        unknowns, point = self.unknowns, self.unknowns.start
        here = self.linearised(point)
        for axis, place in unknowns.turning.items():
            grid = np.clip(GRID, unknowns.lower[place], unknowns.upper[place])
            directions = self.equations.directions(axis, (unknowns.free.start[place] * np.exp(grid)).tolist())
            level = unknowns.columns.value[self.equations.coulomb[axis]]
            torque = here.residual[:, axis] + level * here.regressor[:, axis, self.equations.coulomb[axis]]
            counts = self._counts[:, axis]
            best = best_of_grid(counts * torque, self._triangles[axis][0], counts[:, None] * directions)
            point[place] = grid[best]
        return self.linearised(point)

    # One round

    def _prior(self, widened: float) -> FloatArray:
        return np.where(self.unknowns.promised, widened, 1.0) * self.unknowns.prior

    def _moved(self, here: Linearised, weight: FloatArray, prior: FloatArray, last: FloatArray) -> Linearised:
        """Minimise with laws as linear as they are here; less far where the laws themselves say that it was too far.

        A step of the laws that turns back on the `last` one is halved: that one went too far, and so would this.
        """
        unknowns, start = self.unknowns, self.unknowns.start
        precision = 1 / prior**2
        linear = unknowns.linear(here.point)
        basis = None if self.instruments is None else self._basis(here, weight)
        told, laws, left = self._reduced(basis, here, weight)

        def priors(point: FloatArray) -> float:
            return float((precision * (point - start) ** 2).sum())

        def off(point: FloatArray) -> FloatArray:
            law = laws @ (point - here.point)[self._place]
            return left - told @ (unknowns.linear(point) - linear) - law

        def cost(point: FloatArray) -> float:
            return 0.5 * (float((off(point) ** 2).sum()) + priors(point))

        def equations(point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
            slope = told @ unknowns.linear_slopes(point)
            slope[:, self._place] += laws
            gradient = precision * (point - start) - slope.T @ off(point)
            return cost(point), gradient, slope.T @ slope + np.diag(precision)

        found = levenberg_marquardt(equations, cost, here.point, unknowns.lower, unknowns.upper, damping=1e-9)
        step = found.point - here.point
        step[self._place] = np.clip(step[self._place], -TRUSTED, TRUSTED)
        if step[self._place] @ last[self._place] < 0:
            step = SHORTER * step
        before = float((left**2).sum()) + priors(here.point)
        while True:
            there = self._reached(here.point + step)
            if there is not None:
                after = size(basis, there.residual * weight) + priors(there.point)
                if not self._place or after <= before * (1 + SAME):
                    return there
            if np.abs(step).max() < SMALL:
                return here
            step = SHORTER * step

    def _reached(self, point: FloatArray) -> Linearised | None:
        """Run all laws about a point; none where some cannot have such numbers together."""
        try:
            return self.linearised(point)
        except ConfigurationError:
            if not self.laws:
                raise
            return None

    def _reduced(
        self, basis: list[FloatArray] | None, here: Linearised, weight: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Columns of the torque, of laws, and what is left, by few rows that have the same products.

        With instruments, as far as these show them: two-stage least squares.
        """
        turned = [self.equations.coulomb[axis] for axis in self.unknowns.turning]
        bent = np.concatenate((here.rows[..., self._place], here.residual[..., None]), axis=2)
        bent, n = bent * weight[..., None], here.regressor.shape[2]
        if basis is None and not self.robust:
            bent = np.concatenate((here.regressor[..., turned] * weight[..., None], bent), axis=2)
            parts = [
                beside(q, weight[:, axis].max() * r, bent[:, axis])
                for axis, (q, r) in enumerate(self._triangles)
            ]
            rows = np.concatenate(parts)
            rows[:, turned] = rows[:, n : n + len(turned)]
            rows = np.delete(rows, range(n, n + len(turned)), axis=1)
        else:
            columns = np.concatenate((here.regressor * weight[..., None], bent), axis=2)
            each = columns.swapaxes(0, 1)
            if basis is None:
                parts = [np.asarray(np.linalg.qr(own, mode="r"), dtype=np.float64) for own in each]
            else:
                parts = [q.T @ own for q, own in zip(basis, each, strict=True)]
            rows = np.concatenate(parts)
        return rows[:, :n], rows[:, n:-1], rows[:, -1]

    @cached_property
    def _triangles(self) -> list[tuple[FloatArray, FloatArray]]:
        """Factors of the columns of each axis; those of friction that turns, and equations left out, are zero."""
        counted = self.equations.regressor * self._counts[:, :, None]
        counted[..., [self.equations.coulomb[axis] for axis in self.unknowns.turning]] = 0.0
        return triangles(counted)

    def _basis(self, here: Linearised, weight: FloatArray) -> list[FloatArray]:
        """Orthonormal functions that the instruments of each axis span, (n_equation, n)."""
        assert self.instruments is not None
        shown = self._of(self.instruments, here.point)
        return spanned(np.concatenate((shown.regressor, shown.rows[..., self._place]), axis=2), weight)

    # Weights and tolerances

    def _weights(self, at: Linearised) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Deviation and long-run ratio of each axis, and what each sample counts, (n_equation, n_axis)."""
        each, n = self._counts.copy(), self._counts.sum(axis=0)
        residual = each * at.residual
        if self.robust:
            seen = np.where(self._counts > 0, np.abs(residual), np.nan)
            middle = NORMAL * np.nanmedian(seen, axis=0)
            size = np.abs(residual) / np.where(middle > 0, middle, 1.0)
            each = each * np.sqrt(np.minimum(1.0, HUBER / np.maximum(size, 1e-300)))
        freedom = np.maximum(n - len(at.point) / residual.shape[1], 1.0)
        power = ((each * residual) ** 2).sum(axis=0)
        floor = ROUNDING * float(np.abs(self.equations.torque).max())
        deviation = np.maximum(np.sqrt(power / freedom), max(floor, 1e-300))
        parts = [(each * residual)[part] for part in self.equations.parts]
        ratios = [inflation(part, bandwidth(part)) for part in parts]
        lengths = np.array([len(part) for part in parts], dtype=np.float64)
        ratio = np.average(ratios, axis=0, weights=lengths)
        return deviation, ratio, each

    def _posterior(self, at: Linearised, weight: FloatArray, prior: FloatArray) -> FloatArray:
        """Covariance as if residuals were white in their long-run variance, (n_unknown, n_unknown)."""
        rows = self._seen(at, weight).reshape(-1, len(at.point))
        return scaled_inverse(rows.T @ rows + np.diag(1 / prior**2))

    def _seen(self, at: Linearised, weight: FloatArray) -> FloatArray:
        """Weighted derivatives as far as instruments show them, (n_equation, n_axis, n_unknown)."""
        if self.instruments is None:
            return at.rows * weight[..., None]
        rows = (at.rows * weight[..., None]).swapaxes(0, 1)
        return np.stack(
            [own @ (own.T @ row) for own, row in zip(self._basis(at, weight), rows, strict=True)], axis=1
        )

    def _asked(self, point: FloatArray, error: FloatArray, prior: FloatArray, before: float) -> float:
        """Factor on the tolerances with which the data are most likely; as stated at least."""
        among = self.unknowns.promised
        if not among.any():
            return 1.0
        asked = tolerance_factor((point - self.unknowns.start)[among], error[among], prior[among])
        return float(np.clip(before * asked, 1.0, WIDEST))

    # The end

    def _refuse_alike(self, hessian: FloatArray) -> None:
        """Raise NotIdentifiable where neither data nor tolerances separate some unknowns."""
        scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
        values, vectors = np.linalg.eigh(hessian / np.outer(scale, scale))
        if values[0] < ALIKE:
            share = np.abs(vectors[:, 0])
            members = np.flatnonzero(share > 0.1 * share.max()).tolist()
            raise NotIdentifiable(
                f"the data cannot separate {', '.join(self.unknowns.names[i] for i in members)}; hold some of them "
                "(fixed), or record a richer motion: both directions, several speeds"
            )

    def _solution(
        self,
        at: Linearised,
        scale: FloatArray,
        kappa: FloatArray,
        each: FloatArray,
        tolerances: tuple[float, float],
        n_rounds: int,
        converged: bool,
    ) -> RigidSolution:
        prior, weight = self._prior(tolerances[0]), each / (scale * np.sqrt(kappa))
        precision = 1 / prior**2
        rows = self._seen(at, weight)
        by_sample = np.einsum("sap,sa->sp", rows, weight * at.residual)
        alone, shares = np.zeros((len(precision),) * 2), list[ExperimentShare]()
        for part in self.equations.parts:
            length = bandwidth((each * at.residual)[part])
            alone += score_covariance(by_sample[part], 1)
            own = rows[part].reshape(-1, len(precision))
            memory = score_covariance(by_sample[part], length)
            shares.append(ExperimentShare(own.T @ own, -by_sample[part].sum(axis=0), memory))
        hessian = np.diag(precision) + np.sum([one.information for one in shares], axis=0)
        scores = np.sum([one.scores for one in shares], axis=0)
        self._refuse_alike(hessian)
        freedom = float((self._counts.sum(axis=0) / kappa).sum())
        covariance = sandwich(hessian, scores, precision, freedom)
        white = sandwich(hessian, alone, precision, float(self._counts.sum(axis=0).mean()))
        return RigidSolution(
            at,
            covariance,
            white,
            prior,
            *tolerances,
            scale,
            kappa,
            hessian,
            tuple(shares),
            n_rounds,
            converged,
        )
