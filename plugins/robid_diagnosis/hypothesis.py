"""Hypotheses: a robot with effects more and priors wider, fitted to the records by the engine of all torque fits."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from robid_core import FloatArray, NotIdentifiable, Record, Robot, chosen_names
from robid_core.estimation.torque.speed_functions import NEAR_ALONE, SpeedFunctions
from robid_core.residual import (
    Linearisation,
    RememberedSpectra,
    Solution,
    TorqueProblem,
    default_patterns,
    linearise_at,
    misfit,
    parts_by_variant,
    resolved_width,
    solve,
    torque_problem,
    with_equivalent_springs,
)
from robid_diagnosis.variants import Variants
from robid_diagnosis.wording import place_text

PRIORS = {"*_stiffness.*": 0.5, "*_damping.*": 1.0}
"""What is believed of springs and dampers before the data, in natural scales."""
THINNED = 5  # every so many samples of the speeds tell a width
FEW = 5  # passes of a fit that is only compared
SIGMAS = 3.0  # of the misfit of noise
ZERO_SPEEDS = ("speed", "zero_speed")  # parameters of laws: the width of a sign at zero
BLIND = 2  # times that parameters which data do not tell are held
NEAR = 2.0  # times a zero-speed width, or less: functions about it are narrow and wide enough
DROPPED = 1.0  # standard deviation, in natural scales, of a prior that is given up


@dataclass(frozen=True, eq=False)
class Addition:
    """An effect that a hypothesis puts into the robot."""

    label: str
    use: str
    on: str | None
    side: str | None
    values: Mapping[str, float]
    free: tuple[str, ...]
    """Parameters that are estimated."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the free parameters, as the robot has them."""
        return tuple(f"effect.{self.label}.{name}" for name in self.free)

    @property
    def held_widths(self) -> tuple[str, ...]:
        """Zero-speed widths of the law that are not estimated, but those of the motor's friction."""
        return tuple(name for name in self.values if name in ZERO_SPEEDS and name not in self.free)

    def with_own_width(self) -> Addition:
        """Return it with zero-speed widths that are estimated."""
        return replace(self, free=(*self.free, *self.held_widths))

    def holding(self, names: Sequence[str]) -> Addition:
        """Return it with some of these parameters held, given as the robot has them."""
        kept = (free for free, name in zip(self.free, self.names, strict=True) if name not in names)
        return replace(self, free=tuple(kept))


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A change of the robot that is to be fitted: added effects, values freed of their priors, values held."""

    additions: tuple[Addition, ...] = ()
    widened: tuple[str, ...] = ()
    """Parameters whose prior is given up."""
    held: tuple[str, ...] = ()
    """Parameters of the told robot that stay as they are: data do not tell them."""

    def with_addition(self, addition: Addition) -> Hypothesis:
        """Return it with an effect more."""
        return replace(self, additions=(*self.additions, addition))

    def with_widened(self, names: tuple[str, ...]) -> Hypothesis:
        """Return it with priors given up."""
        return replace(self, widened=(*self.widened, *names))

    def without(self, names: Sequence[str]) -> Hypothesis:
        """Return it without the effect, or the wider priors, of some parameters; what is held is decided anew."""
        kept = tuple(one for one in self.additions if not set(one.names) & set(names))
        return Hypothesis(kept, tuple(name for name in self.widened if name not in names))

    @property
    def what(self) -> str:
        """What is fitted, for people: the cause that was added last, with the others counted."""
        if not self.additions:
            return "all values"
        *others, last = self.additions
        beside = f", beside {len(others)} more" if others else ""
        return place_text(last.use, last.on, last.side) + beside

    @property
    def has_signs(self) -> bool:
        """Whether a law has a zero-speed width of its own, which is held."""
        return any(one.held_widths for one in self.additions)

    def with_wider_signs(self, shares: Mapping[str, float]) -> Hypothesis:
        """Return it with the zero-speed widths of its laws so many times as large, by axis."""

        def of_law(one: Addition) -> Addition:
            share = shares.get(one.on or "", 1.0)
            held = one.held_widths
            values = {name: value * share if name in held else value for name, value in one.values.items()}
            return replace(one, values=values)

        return replace(self, additions=tuple(of_law(one) for one in self.additions))

    def with_own_widths(self) -> Hypothesis:
        """Return it with zero-speed widths of its laws that are estimated."""
        return replace(self, additions=tuple(one.with_own_width() for one in self.additions))

    def holding(self, names: Sequence[str]) -> Hypothesis:
        """Return it with some parameters held."""
        additions = tuple(one.holding(names) for one in self.additions)
        own = {name for one in self.additions for name in one.names}
        return replace(self, additions=additions, held=(*self.held, *(n for n in names if n not in own)))

    def robot(self, told: Robot) -> Robot:
        """Return the robot with all effects."""
        for one in self.additions:
            told = told.with_effect(one.label, one.use, one.on, one.side, one.values)
        return told


@dataclass(frozen=True, eq=False)
class Fitted:
    """A hypothesis fitted to the record."""

    hypothesis: Hypothesis
    problem: TorqueProblem
    solution: Solution
    case: Case
    """Under which it was fitted."""

    @property
    def model_error(self) -> float:
        """Relative error of the model, beside the noise."""
        return self.case.model_error

    @property
    def point(self) -> FloatArray:
        """All unknowns, (n_unknown,)."""
        return self.solution.point

    @cached_property
    def about(self) -> Linearisation:
        """Derivatives and weights at the point; the problem's motions are those of this point from then on."""
        solved = self.solution.converged
        return linearise_at(self.problem, self.point, self.model_error, solved=solved)

    @cached_property
    def misfit(self) -> float:
        """Per degree of freedom, against the noise."""
        return misfit(self.problem, self.point)

    @cached_property
    def excess(self) -> float:
        """Mean square of what is left in noise and model error, as gains are counted in, one at least."""
        weighted = self.problem.weighted(self.point, self.about.weights)
        count = sum(weight.count(own) for own, weight in zip(weighted, self.about.weights, strict=True))
        return max(1.0, float(sum((own**2).sum() for own in weighted)) / count)

    @property
    def leaves_noise(self) -> bool:
        """Whether the misfit is one within what noise does to it."""
        count = sum(block.measured.size * block.share.mean() for block in self.problem.blocks)
        return self.misfit < 1 + SIGMAS / float(np.sqrt(count))

    @cached_property
    def robot(self) -> Robot:
        """As it was fitted; the friction of its motors is in functions of speed."""
        return self.problem.free.robot_at(self.point[: self.problem.n_free])

    def estimate(self, name: str) -> tuple[float, float]:
        """Value of a free parameter and its standard error, in its own unit."""
        values, errors = self._estimates
        return values[name], errors[name]

    @cached_property
    def _estimates(self) -> tuple[dict[str, float], dict[str, float]]:
        """Values of all free parameters, and their standard errors."""
        free, n = self.problem.free, self.problem.n_free
        slope = free.jacobian(self.point[:n])
        errors = np.sqrt(np.diag(slope @ self.solution.covariance[:n, :n] @ slope.T))
        return free.values(self.point[:n]), dict(zip(free.names, errors.tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class Case:
    """Records and the robot of the robot file, with how hypotheses about them are fitted."""

    records: tuple[Record, ...]
    told: Robot
    priors: Mapping[str, float]
    highest_hz: float
    discard: int
    passes: int
    model_error: float
    friction_speed: FloatArray | None = None
    """Zero-speed width of the motors' friction, rad/s, (n_axis,); null: as it is told."""
    widths: tuple[float, ...] = NEAR_ALONE
    """Of the functions of speed that stand for it, over the zero-speed width; one alone: as a robot file has it."""
    doubt: float = 1.0
    """Misfit of the first fit, one at least."""
    robots: Mapping[str, Robot] = field(default_factory=dict)
    """Those that were told for variants that are not the nominal one."""
    leave_out_rests: bool = True
    """Whether samples at which friction holds an axis do not count in its torque."""
    sticking: tuple[str, ...] | None = None
    """Axes whose turns do not count; None: those whose angles show that friction holds them, in a problem's records."""
    held_out: tuple[Record, ...] = ()
    """Records that judge: the same samples count in them."""
    torque_held_s: float | None = None
    """For how long a controller holds a torque that is stated as continuous; None: as it is stated."""

    @cached_property
    def variants(self) -> Variants:
        """All robots that were told, and the unknowns of what only some of them carry."""
        return Variants(self.told, self.robots)

    @cached_property
    def spectra(self) -> RememberedSpectra:
        """Of the records: each fit asks for them."""
        return RememberedSpectra(self.records, self.torque_held_s)

    @property
    def nominal_records(self) -> tuple[Record, ...]:
        """What was measured under the nominal robot."""
        parts = (part for one in self.records for part in parts_by_variant(one))
        return tuple(part for variant, part in parts if variant not in self.robots)

    def with_fitted_width(self, fitted: Fitted) -> Case:
        """Return the case with the width of the friction as a fit found it: then Coulomb friction is fitted exactly."""
        problem = fitted.problem
        laws = problem.blocks[0].laws
        size = problem.friction_size(fitted.point)[: len(laws.odd)]
        return replace(
            self, friction_speed=laws.width_of(size, problem.speeds(THINNED)), doubt=max(1.0, fitted.misfit)
        )

    @cached_property
    def width(self) -> FloatArray:
        """Zero-speed width of the motors' friction, rad/s, (n_axis,), as it is told or was fitted.

        Not below what samples resolve.
        """
        known = self.told.drives.friction_speed if self.friction_speed is None else self.friction_speed
        return resolved_width(self.told, self.records[0].angle[0], known)

    def width_is_near(self, other: Case, times: float = NEAR) -> bool:
        """Whether no width is more than so many times as large as another case's, or as small."""
        return bool((np.abs(np.log(self.width / other.width)) < np.log(times)).all())

    def problem(self, hypothesis: Hypothesis, records: tuple[Record, ...]) -> TorqueProblem:
        """What a hypothesis has to explain in some records, its unknowns as they are for any others."""
        variants = self.variants
        robot = hypothesis.robot(variants.whole)
        known = list(robot.layout)
        added = (name for one in hypothesis.additions for name in one.names)
        patterns = (*default_patterns(robot), *added, *variants.priors)
        names = tuple(name for name in chosen_names(known, patterns) if name not in hypothesis.held)
        priors = {
            **{pattern: deviation for pattern, deviation in PRIORS.items() if fnmatch.filter(names, pattern)},
            **{name: deviation for name, deviation in variants.priors.items() if name in names},
            **self.priors,
            **{name: DROPPED for name in hypothesis.widened if name in names},
        }
        under = {
            variant: hypothesis.robot(variants.robot_of(variant))
            for one in records
            for variant, _ in parts_by_variant(one)
        }
        problem = torque_problem(
            records,
            robot,
            names,
            priors,
            lambda *_: SpeedFunctions.near(self.width, self.widths),
            robots=under if self.robots else None,
            own=variants.priors,
            discard=self.discard,
            highest_hz=self.highest_hz,
            each_delay=True,
            leave_out_rests=self.leave_out_rests,
            sticking=self.sticking,
            spectra=self.spectra,
        )
        return replace(problem, doubt=self.doubt)

    def fit(
        self,
        hypothesis: Hypothesis,
        progress: Callable[[float, float, str], None],
        begin: Fitted | None = None,
        delay: FloatArray | None = None,
        *,
        roughly: bool = False,
        thorough: bool = True,
        others: Fitted | None = None,
        as_told: bool = False,
    ) -> Fitted:
        """Fit a hypothesis, from the start or from where another one ended, its delays moved by some, (n_axis,).

        `roughly`: in few passes, enough to compare it with others. `thorough`: with better derivatives where passes do
        not keep what they gain, which cost many motions; never where it is fitted roughly. `others`: a fit that has
        begun with the same values and tells those that `begin` has not. `as_told`: without `begin`, from the numbers of
        the robot's file, which another fit has found, and not from the best fit of its linear model.
        """
        problem = self.problem(hypothesis, self.records)

        def told(done: float, total: float, note: str) -> None:
            progress(done, total, f"fitting {hypothesis.what}" if note else "")

        point = self.told_point(problem) if as_told else None
        if begin is not None:
            point = _carried(begin, problem, others)
            problem.go_on_from(begin.problem)
            known = {one.label for one in begin.hypothesis.additions}
            new = [one.label for one in hypothesis.additions if one.label not in known]
            point = with_equivalent_springs(problem, point, new) if new else point
        if point is not None and delay is not None:
            point[-problem.n_delay :] -= delay
        solution = solve(
            problem,
            min(self.passes, FEW) if roughly else self.passes,
            self.model_error,
            told,
            begin=point,
            reweigh=False,
            thorough=thorough and not roughly,
        )
        return Fitted(hypothesis, problem, solution, self)

    def fit_what_is_seen(
        self,
        hypothesis: Hypothesis,
        progress: Callable[[float, float, str], None],
        begin: Fitted | None = None,
        delay: FloatArray | None = None,
        *,
        roughly: bool = False,
        thorough: bool = True,
        as_told: bool = False,
    ) -> Fitted:
        """Fit a hypothesis as `fit` does, and hold what the data do not tell beside its effects where it is.

        Raises NotIdentifiable where that is no way out.
        """

        def fitted(one: Hypothesis) -> Fitted:
            return self.fit(one, progress, begin, delay, roughly=roughly, thorough=thorough, as_told=as_told)

        for _ in range(BLIND):
            try:
                return fitted(hypothesis)
            except NotIdentifiable as error:
                hypothesis = hypothesis.holding(error.names)
                if not error.names or (hypothesis.additions and not hypothesis.additions[-1].free):
                    raise
        return fitted(hypothesis)

    def told_point(self, problem: TorqueProblem) -> FloatArray:
        """All unknowns as the robot's file tells them: friction is one function of speed and a constant, no delays."""
        point = np.zeros(problem.n_unknown)
        size = problem.friction_size(point)
        size[self.widths.index(1.0)] = self.told.drives.coulomb
        size[-1] = self.told.drives.friction_offset
        return point


def _carried(begin: Fitted, problem: TorqueProblem, others: Fitted | None = None) -> FloatArray:
    """Unknowns of another fit, in the order of this problem; what neither it nor `others` had begins at zero."""
    known: dict[str, float] = {}
    for fitted in (others, begin):
        if fitted is not None:
            known |= dict(zip(fitted.problem.free.names, fitted.point.tolist(), strict=False))
    own = [known.get(name, 0.0) for name in problem.free.names]
    friction, delay = begin.problem.friction_size(begin.point), begin.problem.delay(begin.point)
    n_law = len(problem.friction_names) - 1  # the last is a constant
    if n_law != len(friction) - 1:
        level = friction[:-1].sum(axis=0)  # of fast motion
        friction = np.vstack((np.tile(level / n_law, (n_law, 1)), friction[-1:]))
    return np.concatenate((own, friction.ravel(), delay))
