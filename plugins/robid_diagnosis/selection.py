"""Forward search with refits: what the data demand beside the told robot, one cause after another.

The best candidates of a search are refined in their shape, put into the robot and fitted by the engine, all unknowns
with them; the best fit is taken where it is significant after the search and where data that were held out agree. Then
the search begins again about that robot, until nothing is significant. Wrong values compete with effects.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from robid_diagnosis.additions import is_fixed, scaled_parameters
from robid_diagnosis.agreement import differs_at_fit, differs_between, holds_elsewhere
from robid_diagnosis.ceilings import ANGLE, Ceiling, ceilings, drifts, memories
from robid_diagnosis.columns import Motion
from robid_diagnosis.fitted_projection import projection_of
from robid_diagnosis.hypothesis import Addition, Case, Fitted
from robid_diagnosis.least_gains import LEAST, LeastGains
from robid_diagnosis.near_widths import with_near_widths
from robid_diagnosis.other_shapes import from_other_shapes
from robid_diagnosis.pictures import picture_of
from robid_diagnosis.refit import refitted
from robid_diagnosis.revision import Revision
from robid_diagnosis.search import Failure, Found, Hit, Search
from robid_diagnosis.search_log import SearchLog
from robid_diagnosis.steps import Outcome, Searched, Step
from robid_diagnosis.ties import with_final_ties
from robid_diagnosis.trials import TIE, Rival, Trial, Trials, alike, total
from robid_diagnosis.values import ValueHit, value_hits
from robid_diagnosis.visible import visible_sizes
from robid_diagnosis.wording import MUCH_LACKS
from robid_diagnosis.written import as_written
from robid_diagnosis.zero_speed import with_own_width

LEVEL = 1e-3  # p-value after the search: what is larger is chance
UNSURE = (
    0.1  # likewise: where nothing is beyond chance in the search, what is below may be so once it is fitted
)
PROMISES = 0.5  # of what a cause has to gain: what the search shows of a law that is fitted all the same
APART = 0.5  # of an order: waves that are nearer are the same
RIVALS = 4  # candidates that are fitted in turn
EQUAL = 1e-6  # of a gain: two laws at one place that differ by less do the same there
SAME = 2  # places of one effect that are looked at closer
NEAR = 0.3  # of the largest gain: rivals gain at least that
TOLERANCES = 0.5  # of a gain: where numbers come so much nearer to what was told, no data can hold that out
WORSE = 0.02  # of the squares: what fits data worse is no cause, however near numbers come to what was told
DOUBTS_MORE = 1.05  # of the misfit: nor is what is further from the noise that its own robot leaves
LITTLE = 0.05  # of what is left where much lacks: what explains less follows the shape of what lacks
CHANGE = (
    1.2  # of the gain of free functions of one axis: a change of the robot that gains less may be a law there
)
PART = 0.5  # of the gain of free functions at its axis: a law that gains less is not taken

Progress = Callable[[float, float, str], None]
Key = tuple[str, str | None, str | None]  # effect, place, side


class Selection:
    """The search for causes in one case, step by step."""

    def __init__(
        self,
        case: Case,
        uses: Sequence[str],
        places: Mapping[str, Collection[str]],
        generator: np.random.Generator,
        progress: Progress,
        most: int,
        log: logging.Logger | None = None,
    ) -> None:
        self.log = SearchLog(log)
        self.case, self.uses, self.places = case, list(uses), places
        self.generator, self.progress, self.most = generator, progress, most
        self.failures: list[Failure] = []
        self.refused: dict[Key, str] = {}
        """Why effects that gain more than chance were not named when the last cause was asked for."""

    def run(self) -> Outcome:
        """Search until nothing is significant."""
        current = base = refitted(self.case, self.progress)
        self.case = base.case
        self.log.refitted(base)
        steps, searches = list[Step](), list[Found]()
        motion: Motion | None = None
        while True:
            seen = self.searched(current, motion)
            motion = seen.motion
            searches.append(seen.found)
            self.log.searched(seen.found, current)
            taken = self.next_cause(current, seen, steps) if len(steps) < self.most else None
            if taken is None:
                break
            current, step = taken
            current = with_own_width(current, self.failures, self.progress)
            self.case = current.case
            revision = Revision(self.case, self.searched, self.next_cause, base, self.failures, self.progress)
            before = [*steps, step]
            current, steps = revision.run(current, before, motion)
            self.log.named(step, before, steps, current)
        self.log.ended(self.refused, len(steps) >= self.most)
        axes = tuple(range(self.case.told.n_axis))
        free = [
            one
            for asked in (ceilings, drifts, memories)
            for one in asked(motion, seen.search.projection, axes)
        ]
        left = sorted(free, key=lambda one: -one.gain)
        visible = visible_sizes(
            seen.found.powers,
            lambda one: scaled_parameters(one, {}, seen.motion),
            LeastGains.beside(current, [step.gain for step in steps]).of_candidate,
            LEVEL / seen.found.trials,
        )
        motion.forget_torques()
        self.log.named_all(steps)
        told = with_final_ties(self.case, current, steps, self.failures, self._of("ties"))
        written = as_written(current, self.failures, self._of("zero-speed width for the robot file"))
        written = with_near_widths(
            written, current.about, self.failures, self._of("zero-speed widths of laws")
        )
        return Outcome(base, current, written, told, tuple(searches), tuple(left), visible, motion)

    def _of(self, work: str) -> Progress:
        """Progress that says what the fits are for."""
        return lambda done, total, note: self.progress(done, total, f"{work}: {note}" if note else "")

    def searched(self, current: Fitted, before: Motion | None) -> Searched:
        """Hold every effect against what a fit leaves; `before`: of the search before."""
        projection, groups = projection_of(current)
        motion = Motion(current.problem, current.point, current.about.weights, before)
        search = Search(motion, projection, self.generator)
        return Searched(search, search.run(self.uses, self.places, self.progress), groups)

    def next_cause(
        self,
        current: Fitted,
        seen: Searched,
        before: Sequence[Step],
    ) -> tuple[Fitted, Step] | None:
        """Return the best hypothesis that has one cause more, where there is one.

        Where all that were fitted fit worse than what there is, rivals that were passed over because of them have their
        turn. What is refused otherwise is something that no effect is, and lesser ones would be a part of it.
        """
        least = LeastGains.beside(current, [step.gain for step in before])
        values = value_hits(current.problem, current.point, current.about)
        rivals, others = self._rivals(current, seen, values, before, least)
        fits = Trials(self.case, current, seen.search, least, self.progress)
        waiting = [*rivals, *others]
        taken: tuple[Fitted, Step] | None = None
        while rivals and taken is None:
            trials = from_other_shapes(fits, fits.run(rivals, others))
            good = [trial for trial in trials if not self._refused_as_worse(trial, current)]
            judged = ((trial, self._taken(trial, trials, current, seen, len(values))) for trial in good)
            taken = next(((trial.fitted, step) for trial, step in judged if step is not None), None)
            rivals, others = [hit for hit in waiting if not good and not fits.has_tried(hit)], []
        self.failures += fits.failures
        return taken

    def _refused_as_worse(self, trial: Trial, current: Fitted) -> bool:
        worse = fits_worse(trial.loss, trial.fitted.misfit, current.misfit)
        if worse:
            self._refuse(trial.hit, "with it the data fit worse")
        return worse

    def _taken(
        self, trial: Trial, trials: Sequence[Trial], current: Fitted, seen: Searched, n_value: int
    ) -> Step | None:
        """Return the step that a trial is, none where something speaks against it."""
        if trial.addition is not None and p_value_of(trial, seen.found) >= LEVEL:
            self._refuse(trial.hit, "fitted with all values it gains no more than chance does")
            return None
        step = self._judged(trial, trials, seen, n_value)
        if step is None:
            self._refuse(trial.hit, "configurations do not agree about it")
            return None
        if explains_little(trial.loss, current.misfit):
            self._refuse(
                trial.hit, f"it explains {-100 * trial.loss:.2g} % of what is left, and something else most"
            )
            return None
        if step.share < PART:
            times = 1 / max(step.share, 1e-3)
            self._refuse(trial.hit, f"free functions at its axis gain {times:.2g} times as much")
            return None
        if trial.addition is None:
            return step
        return replace(step, picture=picture_of(trial.fitted, trial.addition))

    def _refuse(self, rival: Rival, reason: str) -> None:
        """Keep why an effect is not named."""
        if isinstance(rival, Hit):
            self.refused[rival.candidate.key] = reason

    def _rivals(
        self,
        current: Fitted,
        seen: Searched,
        values: Sequence[ValueHit],
        before: Sequence[Step],
        least: LeastGains,
    ) -> tuple[list[Rival], list[Rival]]:
        """Return what is worth a fit of its own, shapes refined, the most promising first; and what promises less."""
        search, found = seen.search, seen.found
        known = {step.key for step in before}
        waves = [one for one in current.hypothesis.additions if "order" in one.values]
        named = {name for step in before for name in step.names}
        hits = [hit for hit in found.hits if hit.candidate.key not in known or _is_another_wave(hit, waves)]
        beyond_chance = [hit for hit in hits if found.p_value(hit) < LEVEL]
        significant = [hit for hit in beyond_chance if hit.gain.total > least.of(hit)] or self._unsure(
            seen.found, hits, least
        )
        self.refused = {}
        for hit in beyond_chance:
            enough = f"fitted with all values it gains less than {least.of(hit):.3g}"
            self._refuse(hit, enough if hit in significant else least.why_not(hit))
        chance = LEVEL / max(len(values), 1)
        wrong = [
            hit
            for hit in values
            if np.exp(hit.log_p) < chance
            and hit.gain > least.of(hit)
            and not named & set(hit.names)
            and _stands_out(hit, hits, least)
        ]
        rivals: list[Rival] = [
            search.refined(hit, as_it_is=is_fixed(hit, search)) for hit in _varied(significant)
        ]
        rivals += wrong[:RIVALS]
        rivals.sort(key=lambda hit: hit.worth, reverse=True)
        most = max((total(hit) for hit in rivals), default=0.0)
        near = [hit for hit in rivals if total(hit) > NEAR * most or hit is rivals[0]][:RIVALS]
        near += [hit for hit in rivals if hit not in near and alike(hit, rivals[0])]
        return near, [hit for hit in rivals if hit not in near]

    def _unsure(self, found: Found, hits: Sequence[Hit], least: LeastGains) -> list[Hit]:
        """Return what only a fit can judge: a search about springs that were refitted shows a part of a law's gain."""
        return [
            hit for hit in hits if found.p_value(hit) < UNSURE and hit.gain.total > PROMISES * least.of(hit)
        ]

    def _judged(
        self,
        trial: Trial,
        trials: Sequence[Trial],
        seen: Searched,
        n_value: int,
    ) -> Step | None:
        """Return the step that a trial is, none where held-out data do not agree."""
        search, groups = seen.search, seen.groups
        near = [other for other in trials if other is not trial and other.is_like(trial)]
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
                nothing,
                float("nan"),
                trial.freedom,
                tuple(near),
            )
        assert trial.addition is not None
        projection, whole = search.projection, trial.hit
        held = projection.held_out(whole.sums, whole.gain, groups)
        by_tolerances = trial.gain_of_tolerances >= TOLERANCES * trial.gain
        if not (by_tolerances or holds_elsewhere(projection, whole, groups)):
            return None
        differs = differs_between(projection, whole, groups)
        if differs and differs_at_fit(trial.fitted, trial.addition.names, trial.gain):
            self.failures.append(Failure(*whole.candidate.key, differs))
            return None
        share, best = self._share(trial, search)
        return Step(
            "effect",
            trial.addition.use,
            trial.addition.on,
            trial.addition.side,
            trial.addition.names,
            trial.gain,
            p_value_of(trial, seen.found),
            held,
            projection.by_group(whole.sums, whole.gain, groups),
            projection.by_own_size(whole.sums, whole.gain, groups),
            share,
            trial.freedom,
            tuple(near),
            as_well=best.function_of if trial.hit.candidate.place is None and share < CHANGE else "",
        )

    def _share(self, trial: Trial, search: Search) -> tuple[float, Ceiling]:
        """Gain over that of the best free functions at the axis; at all axes, where the robot itself is changed.

        With these functions. A wave is not held against waves of all orders: it is not the less one where others act
        beside it.
        """
        assert isinstance(trial.hit, Hit)
        place, wave = trial.hit.candidate.place, trial.hit.meaning.paired
        axes = tuple(range(self.case.told.n_axis)) if place is None else (place.axis,)
        free = [
            one
            for asked in (ceilings, drifts, memories)
            for one in asked(search.motion, search.projection, axes)
        ]
        best = max((one for one in free if not (wave and one.variable == ANGLE)), key=lambda one: one.gain)
        return (trial.gain / best.gain if best.gain > LEAST else float("nan")), best


def fits_worse(loss: float, misfit: float, before: float) -> bool:
    """Whether data fit worse with a law, or are further from the noise that its own robot leaves.

    Where noise is a small part of what is left, a law may well promise less of it.

    Parameters
    ----------
    loss
        By which share the squares of what is left grow, in the weights of the fit without it.
    misfit, before
        With the law and without, each in the noise of its own robot.
    """
    return loss > WORSE or (before < MUCH_LACKS and misfit > DOUBTS_MORE * before)


def p_value_of(trial: Trial, found: Found) -> float:
    """p-value after the search of an effect: by what its fit gains, where the search alone is not sure."""
    assert isinstance(trial.hit, Hit)
    searched = found.p_value(trial.hit)
    return searched if searched < LEVEL else found.p_value_of_gain(trial.gain, trial.freedom)


def explains_little(loss: float, misfit: float) -> bool:
    """Whether so little of what is left is explained that something else, which lacks, has to be what is left.

    Parameters
    ----------
    loss
        By which share the squares of what is left grow with the law.
    misfit
        Without it.
    """
    return misfit > MUCH_LACKS and loss > -LITTLE


def _stands_out(value: ValueHit, hits: Sequence[Hit], least: LeastGains) -> bool:
    """Whether a wrong value gains what an effect has to, or no effect explains as much.

    Less is asked of a value. A law that is too weak to be named must not come back as a value that does the same.
    """
    most = max((hit.worth for hit in hits), default=0.0)
    return value.gain > least.beside_chance or most < value.worth - TIE


def _is_another_wave(hit: Hit, waves: Sequence[Addition]) -> bool:
    """Whether it is a wave of another order than those that a robot has there: of one kind there may be several."""
    there = [one.values["order"] for one in waves if (one.use, one.on, one.side) == hit.candidate.key]
    return hit.meaning.paired and all(abs(hit.values["order"] - order) > APART for order in there)


def _varied(hits: Sequence[Hit]) -> list[Hit]:
    """Return the best hits, of one effect only its best places: near the truth its own kind crowds others out."""
    found: list[Hit] = []
    for hit in _plainest(hits):
        if sum(one.candidate.use == hit.candidate.use for one in found) < SAME:
            found.append(hit)
    kept = found[: 2 * RIVALS]
    return kept + [hit for hit in found if hit not in kept and any(alike(hit, one) for one in kept)]


def _plainest(hits: Sequence[Hit]) -> list[Hit]:
    """Of laws that do the same at one place only that with the fewest numbers: it is a special case of the others."""

    def holds(one: Hit, other: Hit) -> bool:
        here = one.candidate.key[1:] == other.candidate.key[1:]
        alike = abs(one.gain.total - other.gain.total) <= EQUAL * other.gain.total
        plainer = len(other.candidate.effect.parameters) < len(one.candidate.effect.parameters)
        return here and alike and plainer and other.freedom <= one.freedom

    return [hit for hit in hits if not any(holds(hit, other) for other in hits)]
