"""How strongly data show what is hidden: the torque that it changes, in standard deviations.

The plant's torque without noise, less what a plant that hides nothing leaves of itself (two simulators agree to 1e-4),
is fitted by the true robot without the hidden thing: springs, dampers, friction of any width, inertia within its prior
and delays take what they can, as a diagnosis lets them. The squared norm of the rest is what the hidden thing adds to
twice the log-likelihood. A projection at the truth would not do: a delay that is linear does all that a lag does, and a
spring that is linear all that a soft base does.
"""

from __future__ import annotations

import fnmatch
import functools
import itertools
from dataclasses import dataclass

import numpy as np

from blind.kinds import RIGHT
from robid_core import ComplexArray, FloatArray, Record, Robot, chosen_names
from robid_core.estimation.torque.speed_functions import NEAR_ALONE, SpeedFunctions
from robid_core.residual import (
    TorqueProblem,
    Weighting,
    default_patterns,
    linearise_at,
    prescribe_at,
    torque_problem,
)
from robid_core.residual.steps import minimised
from robid_diagnosis.candidates import catalogue
from robid_diagnosis.columns import Motion
from robid_diagnosis.hypothesis import PRIORS
from robid_diagnosis.projection import Projection
from robid_diagnosis.search import Search

CLASS = 3.0  # of twice the log-likelihood: laws that come nearer to the truth are one class with it
REFINED = 6  # candidates whose shape is looked at closer before they are compared with the truth
NOISE_ALONE = 1e-6  # relative error of a model that counts for nothing
PASSES = 2  # of the fit: more change strengths by less than a tenth (soft bases, lags, hysteresis; by hand)
ANY = 1e-3  # likewise, where no weights are asked for


@dataclass(frozen=True, eq=False)
class Ruler:
    """The true robot without what is hidden, measured without noise: what simulators disagree in is taken off."""

    robot: Robot
    late: float
    """Samples after which torques act."""
    weights: tuple[Weighting, ...]
    off: ComplexArray
    """Residual of the plant that hides nothing, N m, (n_config, n_exp, n_bin, n_axis)."""
    floor: FloatArray
    """What noise alone leaves of the torque, relative to it, all bins but the mean, (n_axis,)."""

    @classmethod
    def of_records(cls, robot: Robot, clean: Record, noisy: Record, late: float) -> Ruler:
        """Prepare with two records of the plant that hides nothing; the noise of one weighs."""
        problem, point = _at_truth(robot, noisy, late)
        weights = linearise_at(problem, point, NOISE_ALONE).weights
        nothing, _ = _at_truth(robot, clean, late)
        prescribe_at(nothing, point, ANY)
        (off,), (measured,) = nothing.residuals(point), problem.residuals(point)
        floor = np.sqrt(_power(measured - off) / _power(problem.blocks[0].motion.torque_spectrum))
        return cls(robot, late, weights, off, floor)

    def strength(self, clean: Record) -> Strength:
        """Fit the true robot, without what is hidden, to the noise-free record of a plant that hides something."""
        problem, point = _at_truth(self.robot, clean, self.late)
        (block,) = problem.blocks
        block.added = -self.off  # of the spectra it would not stay off: under a window delays shift samples
        for _ in range(PASSES):
            prescribe_at(problem, point, ANY)
            point = minimised(problem, point, problem.linearise(point, self.weights))
        return Strength(problem, point, self.weights)


@dataclass(frozen=True, eq=False)
class Strength:
    """A fit without what is hidden, and what it leaves, in standard deviations."""

    problem: TorqueProblem
    point: FloatArray
    """Where the unknowns went."""
    weights: tuple[Weighting, ...]

    def total(self, share: float) -> float:
        """Squared norm of what no unknown of a fit can take, and of what priors ask for these.

        Of a record of which this one is a share: priors count once, however much was measured.
        """
        n = self.problem.n_free
        pulls = (self.point / self.problem.prior)[:n]
        return float(sum((own**2).sum() for own in self._weighted) / share + (pulls**2).sum())

    @functools.cached_property
    def projection(self) -> Projection:
        """What it leaves, and what its unknowns can still do."""
        prescribe_at(self.problem, self.point, ANY)
        about = self.problem.linearise(self.point, self.weights)
        lengths = [own.shape[-1] for own in self._weighted for _ in range(own.shape[0] * own.shape[1])]
        ends = np.cumsum([0, *lengths])
        folds = [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]
        residual = np.concatenate([own.ravel() for own in self._weighted])
        pull = self.point / self.problem.prior**2
        return Projection(np.concatenate(about.rows), residual, about.whole, pull, folds)

    @functools.cached_property
    def _weighted(self) -> list[FloatArray]:
        return self.problem.weighted(self.point, self.weights)

    def alike(
        self, kind: str, on: str, generator: np.random.Generator, *, elsewhere: bool
    ) -> tuple[str, ...]:
        """Laws of the catalogue, `effect@place`, that explain the noise-free data as well as a kind's own laws do.

        `elsewhere`: at other places, too.
        """
        projection = self.projection
        motion = Motion(self.problem, self.point, self.weights)
        search = Search(motion, projection, generator)
        uses = catalogue()
        found = search.run(uses, {} if elsewhere else {use: {on} for use in uses}, lambda *_: None)
        own = [hit for hit in found.hits if hit.candidate.use in RIGHT[kind] and hit.candidate.spot.on == on]
        rest = [hit for hit in found.hits if hit not in own][:REFINED]
        best = max((search.refined(hit).gain.total for hit in own), default=np.inf)
        near = [hit for hit in rest if search.refined(hit).gain.total > best - CLASS]
        return tuple(f"{hit.candidate.use}@{hit.candidate.spot.on}" for hit in near)


def noise_floor(robot: Robot, noisy: Record, clean: Record, late: float) -> FloatArray:
    """What the noise of a record leaves of its torque, relative to it, all bins but the mean, (n_axis,).

    The true robot's residual, less that which it leaves of the same motion shown without noise.
    """
    left = []
    for record in (noisy, clean):
        problem, point = _at_truth(robot, record, late)
        prescribe_at(problem, point, ANY)
        left.append(problem.residuals(point)[0])
    torque = problem.blocks[0].motion.torque_spectrum
    floor: FloatArray = np.sqrt(_power(left[0] - left[1]) / _power(torque))
    return floor


def _power(spectra: ComplexArray) -> FloatArray:
    power: FloatArray = (np.abs(spectra[:, :, 1:]) ** 2).sum(axis=(0, 1, 2))
    return power


def _at_truth(robot: Robot, record: Record, late: float) -> tuple[TorqueProblem, FloatArray]:
    """Return what a diagnosis fits, and its unknowns as they truly are."""
    names = chosen_names(list(robot.layout), default_patterns(robot))
    priors = {pattern: one for pattern, one in PRIORS.items() if fnmatch.filter(names, pattern)}
    width = robot.drives.friction_speed
    problem = torque_problem(
        (record,), robot, names, priors, lambda *_: SpeedFunctions.near(width), each_delay=True
    )
    point = np.zeros(problem.n_unknown)
    problem.friction_size(point)[NEAR_ALONE.index(1.0)] = robot.drives.coulomb
    point[-problem.n_delay :] = -late * robot.sample_time_s
    return problem, point
