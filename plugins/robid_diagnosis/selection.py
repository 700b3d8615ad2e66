"""Forward search with refits: what the data demand beside the told robot, one cause after another.

The best candidates of a search are refined in their shape, put into the robot and fitted by the engine, all unknowns
with them; the best fit is taken where it is significant after the search and where data that were held out agree. Then
the search begins again about that robot, until nothing is significant. Wrong values compete with effects.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid_core import FloatArray, RobidError
from robid_diagnosis.additions import addition_of, is_fixed, label_of
from robid_diagnosis.ceilings import Ceiling, ceilings
from robid_diagnosis.columns import Motion
from robid_diagnosis.hypothesis import Addition, Case, Fitted, Hypothesis
from robid_diagnosis.pictures import Picture, picture_of
from robid_diagnosis.projection import Projection
from robid_diagnosis.search import Failure, Found, Hit, Search
from robid_diagnosis.values import PRICE, ValueHit, value_hits

LEVEL = 1e-3  # p-value after the search: what is larger is chance
LEAST = 30.0  # of twice the log-likelihood: what gains less is not named
NAMED = 1e-3  # of what was named before: three percent of an effect left over is no effect
RIVALS = 4  # candidates that are fitted in turn
SAME = 2  # places of one effect that are looked at closer
LUCK = 4.0  # a rival is not fitted that would have to keep more than this times what the others kept of their promise
NEAR = 0.3  # of the largest gain: rivals gain at least that
CLOSE = 0.9  # of the largest gain of trials: these are fitted to the end before they are compared
TIE = 6.0  # of twice the log-likelihood: nearer, two hypotheses are one class
PART = 0.5  # of the gain of free functions at its axis: a law that gains less is not taken
WRONG = 2.0  # misfit: above, something lacks, and a fit need not go on to its last digit
DOUBTFUL = 1.1  # misfit: above, something is left to explain

Progress = Callable[[float, float, str], None]


@dataclass(frozen=True, eq=False)
class Step:
    """A cause that was accepted."""

    kind: str
    """effect, or body, rotor, spring for wrong values."""
    use: str
    on: str | None
    side: str | None
    names: tuple[str, ...]
    """Parameters of the robot that belong to it."""
    gain: float
    """Of twice the log-likelihood, by the refit."""
    p_value: float
    """After the search."""
    held_out: FloatArray
    """Gain in each configuration with sizes that the others tell, (n_config,)."""
    by_configuration: FloatArray
    """Gain in each configuration, (n_config,)."""
    ties: tuple[tuple[str, str | None, str | None], ...]
    """Effects and places that explain the data as well."""
    share: float
    """Gain over that of the best free functions at the axis; NaN where there are none."""
    picture: Picture | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """All that a search told."""

    base: Fitted
    final: Fitted
    steps: tuple[Step, ...]
    searches: tuple[Found, ...]
    """One for each step, and the last that found nothing."""
    left: Ceiling | None
    """The free functions that would still gain most, where the misfit is doubtful."""


@dataclass(frozen=True, eq=False)
class _Trial:
    fitted: Fitted
    gain: float
    hit: Hit | ValueHit
    addition: Addition | None

    @property
    def worth(self) -> float:
        """What the fit gains, less what as many numbers gain by chance."""
        return self.gain - PRICE * self.hit.freedom


class Selection:
    """The search about one case."""

    def __init__(
        self,
        case: Case,
        uses: Sequence[str],
        places: Mapping[str, Collection[str]],
        generator: np.random.Generator,
        progress: Progress,
        most: int,
    ) -> None:
        self.case, self.uses, self.places = case, list(uses), places
        self.generator, self.progress, self.most = generator, progress, most
        self.failures: list[Failure] = []

    def run(self) -> Outcome:
        """Search until nothing is significant."""
        current = base = self._refitted()
        steps, searches = list[Step](), list[Found]()
        while True:
            projection, groups = self._projection(current)
            search = Search(
                Motion(current.problem, current.point, current.about.weights), projection, self.generator
            )
            found = search.run(self.uses, self.places, self.progress)
            searches.append(found)
            if len(steps) == self.most:
                break
            taken = self._next(current, search, found, groups, steps)
            if taken is None:
                break
            current, step = taken
            steps.append(step)
            current, steps = self._without_the_needless(current, steps)
        left = None
        if current.misfit > DOUBTFUL:
            axes = tuple(range(self.case.told.n_axis))
            left = ceilings(search.motion, projection, axes)[0]
        return Outcome(base, current, tuple(steps), tuple(searches), left)

    def _refitted(self) -> Fitted:
        """Fit all that the told robot has; not to the end where that cannot be the answer."""
        first = self.case.fit(Hypothesis(), self.progress, roughly=True)
        self.case = self.case.with_fitted_width(first)
        base = self.case.fit(Hypothesis(), self.progress, begin=first, roughly=True)
        if base.solution.converged or base.misfit > WRONG:
            return base
        return self.case.fit(Hypothesis(), self.progress, begin=base)

    def _next(
        self,
        current: Fitted,
        search: Search,
        found: Found,
        groups: Sequence[Sequence[int]],
        before: Sequence[Step],
    ) -> tuple[Fitted, Step] | None:
        """Return the best hypothesis that has one cause more, where there is one."""
        least = LEAST * max(1.0, current.misfit) + NAMED * sum(step.gain for step in before)
        values = value_hits(current.problem, current.point, current.about)
        rivals = self._rivals(search, found, values, before, least)
        trials = self._trials(current, search, rivals, least)
        for trial in trials:
            step = self._judged(trial, trials, search, found, groups, len(values))
            if step is not None and not step.share < PART:
                if trial.addition is not None:
                    step = replace(step, picture=picture_of(trial.fitted, trial.addition))
                return trial.fitted, step
        return None

    def _rivals(
        self, search: Search, found: Found, values: Sequence[ValueHit], before: Sequence[Step], least: float
    ) -> list[Hit | ValueHit]:
        """Return what is worth a fit of its own, shapes refined, the most promising first."""
        known = {(step.use, step.on, step.side) for step in before}
        named = {name for step in before for name in step.names}
        hits = [hit for hit in found.hits if hit.candidate.key not in known]
        significant = [hit for hit in hits if found.p_value(hit) < LEVEL and hit.gain.total > least]
        chance = LEVEL / max(len(values), 1)
        wrong = [
            hit
            for hit in values
            if np.exp(hit.log_p) < chance and hit.gain > least and not named & set(hit.names)
        ]
        rivals: list[Hit | ValueHit] = [
            search.refined(hit, as_it_is=is_fixed(hit, search)) for hit in _varied(significant)
        ]
        rivals += wrong[:RIVALS]
        rivals.sort(key=lambda hit: hit.worth, reverse=True)
        most = max((_total(hit) for hit in rivals), default=0.0)
        near = [hit for hit in rivals if _total(hit) > NEAR * most or hit is rivals[0]][:RIVALS]
        return near + [hit for hit in rivals if hit not in near and _alike(hit, rivals[0])]

    def _trials(
        self, current: Fitted, search: Search, rivals: Sequence[Hit | ValueHit], least: float
    ) -> list[_Trial]:
        """Fit one rival after the other, the best of them to the end; return those that gain, the best first."""
        trials, reach = list[_Trial](), 0.0
        for hit in rivals:
            most = max((trial.gain for trial in trials), default=0.0)
            if _total(hit) * reach * LUCK < most and not _alike(hit, rivals[0]):
                continue
            trial = self._trial(current, hit, search)
            if trial is not None and trial.gain > least:
                trials.append(trial)
                reach = max(reach, trial.gain / _total(hit))
        return self._settled(trials, current)

    def _settled(self, trials: Sequence[_Trial], current: Fitted) -> list[_Trial]:
        """Fit those that gain nearly as much as the best to the end, and return all, the best first."""
        most = max((trial.gain for trial in trials), default=0.0)
        found = []
        for trial in trials:
            if trial.gain <= CLOSE * most:
                found.append(trial)
                continue
            try:
                fitted = self.case.fit(trial.fitted.hypothesis, self.progress, begin=trial.fitted)
            except RobidError as error:
                self.failures.append(Failure(*_key(trial.hit), str(error)))
                continue
            gain = current.cost(current.about) - fitted.cost(current.about)
            found.append(replace(trial, fitted=fitted, gain=gain))
        return sorted(found, key=lambda trial: trial.worth, reverse=True)

    def _without_the_needless(self, current: Fitted, steps: list[Step]) -> tuple[Fitted, list[Step]]:
        """Drop what was accepted before and what the last cause explains as well."""
        for step in steps[:-1]:
            rest = [one for one in steps if one is not step]
            hypothesis = current.hypothesis.without(step.names)
            try:
                fitted = self.case.fit(hypothesis, self.progress, begin=current)
            except RobidError as error:
                self.failures.append(Failure(step.use, step.on, step.side, str(error)))
                continue
            lost = fitted.cost(current.about) - current.cost(current.about)
            if lost < LEAST * max(1.0, current.misfit):
                return self._without_the_needless(fitted, rest)
        return current, steps

    def _trial(self, current: Fitted, hit: Hit | ValueHit, search: Search) -> _Trial | None:
        """Fit the robot with one cause more; none where the engine cannot."""
        addition = None
        if isinstance(hit, ValueHit):
            hypothesis = current.hypothesis.with_widened(hit.names)
        try:
            if isinstance(hit, Hit):
                addition = addition_of(hit, search, label_of(hit, current.hypothesis))
                hypothesis = current.hypothesis.with_addition(addition)
            delay = hit.columns.delay if isinstance(hit, Hit) else None
            fitted = self.case.fit(hypothesis, self.progress, current, delay, roughly=True)
        except RobidError as error:
            self.failures.append(Failure(*_key(hit), str(error)))
            return None
        gain = current.cost(current.about) - fitted.cost(current.about)
        return _Trial(fitted, gain, hit, addition)

    def _judged(
        self,
        trial: _Trial,
        trials: Sequence[_Trial],
        search: Search,
        found: Found,
        groups: Sequence[Sequence[int]],
        n_value: int,
    ) -> Step | None:
        """Return the step that a trial is, none where held-out data do not agree."""
        ties = [_key(other.hit) for other in trials if other is not trial and other.worth > trial.worth - TIE]
        if isinstance(trial.hit, ValueHit):
            hit, nothing = trial.hit, np.full(len(groups), np.nan)
            p_value = float(min(1.0, n_value * np.exp(hit.log_p)))
            return Step(
                hit.kind,
                hit.kind,
                hit.on,
                None,
                hit.names,
                trial.gain,
                p_value,
                nothing,
                nothing,
                tuple(ties),
                float("nan"),
            )
        assert trial.addition is not None
        projection, whole = search.projection, trial.hit
        held = projection.held_out(whole.sums, whole.gain, groups)
        if held.sum() < LEAST / 2:
            single = [[i] for i in range(len(projection.folds))]
            if projection.held_out(whole.sums, whole.gain, single).sum() < LEAST / 2:
                return None
        return Step(
            "effect",
            trial.addition.use,
            trial.addition.on,
            trial.addition.side,
            trial.addition.names,
            trial.gain,
            found.p_value(whole),
            held,
            projection.by_group(whole.sums, whole.gain, groups),
            tuple(ties),
            self._share(trial, search),
        )

    def _share(self, trial: _Trial, search: Search) -> float:
        """Gain over that of the best free functions at the axis; at all axes, where the robot itself is changed."""
        assert isinstance(trial.hit, Hit)
        place = trial.hit.candidate.place
        axes = tuple(range(self.case.told.n_axis)) if place is None else (place.axis,)
        best = ceilings(search.motion, search.projection, axes)[0]
        return trial.gain / best.gain if best.gain > LEAST else float("nan")

    def _projection(self, fitted: Fitted) -> tuple[Projection, list[list[int]]]:
        """Prepare what was fitted; folds are experiments, groups those of one configuration."""
        about = fitted.about
        weighted = fitted.problem.weighted(fitted.point, about.weights)
        folds, groups, first = list[slice](), list[list[int]](), 0
        for own in weighted:
            for experiments in own:
                groups.append([])
                for rows in experiments:
                    groups[-1].append(len(folds))
                    folds.append(slice(first, first + len(rows)))
                    first += len(rows)
        residual = np.concatenate([own.ravel() for own in weighted])
        pull = fitted.point / fitted.problem.prior**2
        projection = Projection(np.concatenate(about.rows), residual, about.whole, pull, folds)
        return projection, groups


def _varied(hits: Sequence[Hit]) -> list[Hit]:
    """Return the best hits, of one effect only its best places: near the truth its own kind crowds others out."""
    found: list[Hit] = []
    for hit in hits:
        if sum(one.candidate.use == hit.candidate.use for one in found) < SAME:
            found.append(hit)
    kept = found[: 2 * RIVALS]
    return kept + [hit for hit in found if hit not in kept and any(_alike(hit, one) for one in kept)]


def _alike(one: Hit | ValueHit, other: Hit | ValueHit) -> bool:
    """Whether two change the robot at one place: springs that were refitted hide which of them it is."""
    changes = all(isinstance(hit, Hit) and hit.candidate.place is None for hit in (one, other))
    return changes and _key(one)[1] == _key(other)[1]


def _total(hit: Hit | ValueHit) -> float:
    return hit.gain if isinstance(hit, ValueHit) else hit.gain.total


def _key(hit: Hit | ValueHit) -> tuple[str, str | None, str | None]:
    return (hit.kind, hit.on, None) if isinstance(hit, ValueHit) else hit.candidate.key
