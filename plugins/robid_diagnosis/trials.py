"""Rivals put into the robot and fitted, all unknowns with them: what a search promises, the fits keep or not.

A few passes compare the most promising; those that come near to the best are fitted to the end. Where even the best
leaves much, the search saw the laws from too far away: then rivals that promised less have their turn, laws of friction
get zero-speed widths of their own, and the best are fitted from every start that the search knows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from robid_core import RobidError
from robid_diagnosis.additions import addition_of, is_fixed, label_of
from robid_diagnosis.from_smooth import fits_from_smooth
from robid_diagnosis.hypothesis import FEW, Addition, Case, Fitted
from robid_diagnosis.least_gains import LeastGains
from robid_diagnosis.likelihood import costs, is_nearer
from robid_diagnosis.search import Failure, Hit, Search
from robid_diagnosis.values import PRICE, ValueHit
from robid_diagnosis.zero_speed import with_own_width

LUCK = 4.0  # a rival is not fitted that would have to keep more than this times what the others kept of their promise
LITTLE_LUCK = 1.5  # likewise, where another one has left no more than noise
CLOSE = 0.9  # of the largest gain of trials: fitted to the end before they are compared; of a promise: it was kept
DOUBTFUL = 1.1  # misfit: above, something is left to explain
WRONG = 2.0  # misfit: above, something lacks, and a fit need not go on to its last digit
FAILED = 0.5  # of a promise: a fit that keeps less is given all its passes
MUCH = 0.01  # of the misfit's excess: what more is left was not explained
PROMISING = 0.1  # likewise, after a few passes
AGAIN = 2  # trials that are fitted from other starts
STARTS = 4  # of each
ROUNDS = 8  # of passes
SLOW = 0.8  # of the misfit: a round that leaves more is the last
CLEARLY = 5.0  # times what decides: so far apart, few derivatives by motions are enough
TIE = 6.0  # of twice the log-likelihood, where a fit leaves noise: nearer, two hypotheses are one class
SAME = 1e-3  # of a gain: likewise, of laws at one place; none is its machine's to 3 % of itself

Rival = Hit | ValueHit


@dataclass(frozen=True, eq=False)
class Trial:
    """A candidate after its fit."""

    fitted: Fitted
    gain: float
    """Of twice the log-likelihood."""
    hit: Rival
    gain_of_tolerances: float
    """What of the gain is that told numbers need not leave their tolerances."""
    loss: float
    """By which share the squares of what is left of the data grow; negative where they shrink."""

    @property
    def addition(self) -> Addition | None:
        """The effect that was put into the robot; None where a prior was given up."""
        return None if isinstance(self.hit, ValueHit) else self.fitted.hypothesis.additions[-1]

    @property
    def freedom(self) -> int:
        """Numbers that were fitted: of an effect its exponents, too, which the search holds."""
        free = 0 if self.addition is None else len(self.addition.free)
        return max(self.hit.freedom, free)

    @property
    def worth(self) -> float:
        """What the fit gains, less what as many numbers gain by chance, in the noise that it leaves."""
        return self.gain - PRICE * self.freedom * max(1.0, self.fitted.misfit)

    def is_like(self, other: Trial) -> bool:
        """Whether it explains data as well as a better one does, as they are or by its numbers' worth."""
        near = nearness(other.fitted) + resolution(self.hit, other)
        return self.gain > other.gain - near or self.worth > other.worth - near


class Trials:
    """Fits of candidates beside one fitted hypothesis."""

    def __init__(
        self,
        case: Case,
        current: Fitted,
        search: Search,
        least: LeastGains,
        progress: Callable[[float, float, str], None],
    ) -> None:
        self.case, self.current, self.search, self.least = case, current, search, least
        self.progress = progress
        self.failures: list[Failure] = []
        self._kept: dict[tuple[str, str | None, str | None], float] = {}
        self._ended = set[Trial]()

    def run(self, rivals: Sequence[Rival], others: Sequence[Rival]) -> list[Trial]:
        """Return the rivals that gain, the best first; `others` have their turn where these leave much."""
        trials = self._settled(self._each(rivals, []))
        if self.leaves_much(trials):
            trials = self._settled(self._each(others, trials))
        if self.leaves_much(trials):
            own = [self._with_own_width(trial) for trial in trials]
            trials = trials if own == trials else self._settled(own)
        trials = self._from_smooth((*rivals, *others), trials)
        if self.leaves_much(trials):
            shaped = [
                hit
                for hit in (*rivals, *others)
                if isinstance(hit, Hit)
                and hit.candidate.shape
                and hit.candidate.place is not None
                and (self._lost(hit, trials) or self._is_gap(hit, trials))
            ]
            for hit in sorted(shaped, key=total, reverse=True)[:AGAIN]:
                trials = self._restarted(hit, trials)
                if not self.leaves_much(trials):
                    break
        return trials

    def has_tried(self, rival: Rival) -> bool:
        """Whether a rival was fitted, or could not be."""
        return key_of(rival) in self._kept

    def _each(self, rivals: Sequence[Rival], trials: list[Trial]) -> list[Trial]:
        """Fit one after the other, but for those that cannot overtake the best."""
        found, reach = list(trials), max((trial.gain / total(trial.hit) for trial in trials), default=0.0)
        for hit in rivals:
            best = max(found, key=lambda trial: trial.gain, default=None)
            luck = LUCK if best is None or best.fitted.misfit > DOUBTFUL or _frees(best, hit) else LITTLE_LUCK
            if best is not None and total(hit) * reach * luck < best.gain and not alike(hit, rivals[0]):
                continue
            trial = self._fitted(hit, self.current)
            if trial is not None and trial.gain < FAILED * total(hit) and self.case.passes > FEW:
                trial = self._fitted(hit, self.current, roughly=False) or trial
            self._kept[key_of(hit)] = 0.0 if trial is None else trial.gain
            if trial is not None and trial.gain > self.least.of(hit):
                found.append(trial)
                reach = max(reach, trial.gain / total(hit))
        return found

    def leaves_much(self, trials: Sequence[Trial], much: float = MUCH) -> bool:
        """Whether the best leaves more than noise and a small part of what there was to explain."""
        if not trials:
            return self.current.misfit > WRONG
        left = trials[0].fitted.misfit
        return left > WRONG and left - 1 > much * (self.current.misfit - 1)

    def _with_own_width(self, trial: Trial) -> Trial:
        """Return a law of friction fitted again with a zero-speed width of its own, where that leaves little.

        At a motor a law has the width of its Coulomb friction, which is known from every fit. A robot may be otherwise:
        then another law, with more numbers to bend, is less wrong than the right one. Where much is left all the same,
        one number more gains, too, and says nothing of a width.
        """
        if trial.addition is None or not trial.addition.held_widths:
            return trial
        *before, last = trial.fitted.hypothesis.additions
        hypothesis = replace(trial.fitted.hypothesis, additions=(*before, last.with_own_width()))
        try:
            own = self.trial_of(
                self.case.fit_what_is_seen(hypothesis, self.progress, trial.fitted), trial.hit
            )
        except RobidError as error:
            self.failures.append(Failure(*key_of(trial.hit), str(error)))
            return trial
        gains = own.worth > trial.worth + nearness(own.fitted)
        return own if gains and own.fitted.misfit < WRONG else trial

    def _lost(self, hit: Rival, trials: Sequence[Trial]) -> bool:
        """Whether a rival promised more than any trial gained, and its own fit did not keep it: it began wrong."""
        most = max((trial.gain for trial in trials), default=0.0)
        return total(hit) > most and self._kept.get(key_of(hit), 0.0) < CLOSE * total(hit)

    def _is_gap(self, hit: Hit, trials: Sequence[Trial]) -> bool:
        """Whether a law is in proportion to none of its numbers, and acts where the best trial does.

        A search far from its size, about springs that were refitted without it, promises next to nothing of it.
        """
        return _acts_there(hit, trials) and is_fixed(hit, self.search)

    def _settled(self, trials: Sequence[Trial]) -> list[Trial]:
        """Fit those that gain nearly as much as the best to the end, and return all, the best first.

        Where there are several, each with the zero-speed width that it has.
        """
        most = max((trial.gain for trial in trials), default=0.0)
        near = [trial for trial in trials if trial.gain > CLOSE * most]
        found = [trial for trial in trials if trial not in near]
        for trial in near:
            try:
                settled = trial
                if not (_has_ended(trial.fitted) or trial in self._ended):
                    settled = self.to_the_end(trial)
                if len(near) > 1 and settled.fitted.misfit < WRONG:
                    fitted = with_own_width(settled.fitted, self.failures, self.progress)
                    settled = self.trial_of(fitted, trial.hit)
                found.append(settled)
                self._ended.add(settled)
            except RobidError as error:
                self.failures.append(Failure(*key_of(trial.hit), str(error)))
        return plainest_first(sorted(found, key=lambda trial: -trial.worth))

    def to_the_end(self, trial: Trial) -> Trial:
        """Fit until passes end by themselves, or gain no more: over a gap the way is long, beside noise it is not."""
        for _ in range(ROUNDS):
            before = trial.fitted
            fitted = self.case.fit_what_is_seen(
                before.hypothesis, self.progress, before, thorough=not before.leaves_noise
            )
            further = self.trial_of(fitted, trial.hit)
            if further.gain < trial.gain:  # an accelerated pass may leave the minimum, and be the last
                break
            trial = further
            if _has_ended(fitted) or fitted.misfit < WRONG or fitted.misfit > SLOW * before.misfit:
                break
        return trial

    def _from_smooth(self, hits: Sequence[Rival], trials: list[Trial]) -> list[Trial]:
        """Fit a law with corners from where they are round, where fits went astray or its robot rattles."""
        rattles = bool(trials) and any(trials[0].fitted.problem.left_out)
        if not (rattles or self.leaves_much(trials)):
            return trials
        cornered = (hit for hit in hits if isinstance(hit, Hit) and hit.candidate.effect.smoothest)
        hit = next((hit for hit in cornered if _acts_there(hit, trials)), None)
        if hit is None:
            return trials
        before = self.current.hypothesis
        law = before.with_addition(addition_of(hit, self.search, label_of(hit, before)))
        begin = self.current if before.additions else None
        try:
            fits = fits_from_smooth(self.case, law, begin, self.progress)
        except RobidError as error:
            self.failures.append(Failure(*key_of(hit), str(error)))
            return trials
        rounded, plain = (self.trial_of(fitted, hit) for fitted in fits)
        trial = plain if plain.worth > rounded.worth - nearness(rounded.fitted) else rounded
        others = [one for one in trials if key_of(one.hit) != key_of(hit)]
        same = [one for one in trials if one not in others]
        nearer = all(is_nearer(trial.fitted, one.fitted, self.current) for one in same)
        return self._settled([*others, trial]) if nearer and trial.gain > self.least.of(hit) else trials

    def _restarted(self, hit: Hit, trials: list[Trial]) -> list[Trial]:
        """Fit from all values of the search's grid: a gap has many minima.

        From here and, as long as nothing was found, from the told robot, too.
        """
        best: Trial | None = None
        for start, begin, as_told in self._starts(hit):
            trial = self._fitted(start, begin, as_told=as_told)
            if trial is not None and trial.gain > max(self.least.of(hit), best.gain if best else 0.0):
                best = trial
                if not self.leaves_much([best], PROMISING):
                    break
        if best is None or any(key_of(one.hit) == key_of(hit) and one.gain > best.gain for one in trials):
            return trials
        rest = [trial for trial in trials if key_of(trial.hit) != key_of(hit)]
        return self._settled([*rest, best])

    def _starts(self, hit: Hit) -> Iterator[tuple[Hit, Fitted | None, bool]]:
        """Hits of one law at one place, the orders of waves the best first, gaps from wide to narrow, all else upwards.

        With the fit to begin from, if any, and whether to begin from the numbers of the robot file instead.
        """
        candidates = self.search.motion.candidates(hit.candidate.use)
        hits = [self.search.hit(one, {}) for one in candidates if one.key == hit.candidate.key]
        hits = [one for one in hits if one.gain.freedom]
        if is_fixed(hit, self.search):
            hits = hits[::-1]
        if hit.meaning.paired:
            hits.sort(key=lambda one: -one.gain.total)
        for one in hits[:STARTS]:
            yield one, self.current, False
            if not self.current.hypothesis.additions:
                if is_fixed(one, self.search):
                    yield one, None, True
                yield one, None, False

    def _fitted(
        self, hit: Rival, begin: Fitted | None, *, roughly: bool = True, as_told: bool = False
    ) -> Trial | None:
        """Fit the robot with one cause more, in a few passes; none where the engine cannot, which is noted."""
        before, delay = self.current.hypothesis, None
        try:
            if isinstance(hit, ValueHit):
                hypothesis = before.with_widened(hit.names)
            else:
                hypothesis = before.with_addition(addition_of(hit, self.search, label_of(hit, before)))
                delay = None if begin is None else hit.meaning.delay
            fitted = self.case.fit_what_is_seen(
                hypothesis, self.progress, begin, delay, roughly=roughly, as_told=as_told
            )
            return self.trial_of(fitted, hit)
        except RobidError as error:
            self.failures.append(Failure(*key_of(hit), str(error)))
        return None

    def trial_of(self, fitted: Fitted, hit: Rival) -> Trial:
        """Return what a fit of a rival gains beside the hypothesis that all are tried beside."""
        before, after = costs(self.current, fitted, self.current.about)
        pull, other = (float(((one.point / one.problem.prior) ** 2).sum()) for one in (self.current, fitted))
        return Trial(fitted, before - after, hit, pull - other, (after - other) / (before - pull) - 1)


def _has_ended(fitted: Fitted) -> bool:
    """Whether passes are over: beside much that is left, those over nonlinear springs end before they are there."""
    bent = bool(fitted.robot.bending_forces) and fitted.misfit > WRONG
    return fitted.solution.converged and not bent


def _acts_there(hit: Rival, trials: Sequence[Trial]) -> bool:
    """Whether a rival acts where the best trial does."""
    return bool(trials) and key_of(hit)[1] == key_of(trials[0].hit)[1]


def nearness(fitted: Fitted) -> float:
    """By how much twice the log-likelihood of another hypothesis may be smaller, for both to be one class."""
    return TIE * max(1.0, fitted.misfit)


def clearly_less(fitted: Fitted, lost: float, enough: float) -> bool:
    """Whether a fit with few derivatives by motions settles that a hypothesis explains less by `enough`.

    More of them only lower its cost; where passes ended, by little of what a cause gains.

    Parameters
    ----------
    fitted
        Not thorough.
    lost
        By how much its twice log-likelihood is smaller than that of another hypothesis.
    enough
        What decides.
    """
    return fitted.solution.converged and lost > CLEARLY * enough


def resolution(hit: Rival, best: Trial) -> float:
    """By how much a law may gain less than the best trial for what no law is exact to; nothing at another place."""
    laws = isinstance(hit, Hit) and isinstance(best.hit, Hit)
    return SAME * best.gain if laws and key_of(hit)[1:] == key_of(best.hit)[1:] else 0.0


def plainest_first(trials: list[Trial]) -> list[Trial]:
    """Of laws that gain the same at the place of the best, put that with the fewest numbers first.

    None that leaves more than noise where the best leaves noise.
    """
    if not trials:
        return trials
    most = DOUBTFUL * max(1.0, trials[0].fitted.misfit)
    same = [
        trial
        for trial in trials
        if trial is trials[0]
        or (trial.worth >= trials[0].worth - resolution(trial.hit, trials[0]) and trial.fitted.misfit < most)
    ]
    plainest = min(same, key=lambda trial: trial.freedom)
    return [plainest, *(trial for trial in trials if trial is not plainest)]


def _frees(best: Trial, hit: Rival) -> bool:
    """Whether a law is compared with a prior that was given up: where bodies were bent far, it promises too little."""
    return isinstance(best.hit, ValueHit) and isinstance(hit, Hit)


def alike(one: Rival, other: Rival) -> bool:
    """Whether two change the robot at one place: springs that were refitted hide which of them it is."""
    changes = all(isinstance(hit, Hit) and hit.candidate.place is None for hit in (one, other))
    return changes and key_of(one)[1] == key_of(other)[1]


def total(hit: Rival) -> float:
    """What a rival promises, in twice the log-likelihood."""
    return hit.gain if isinstance(hit, ValueHit) else hit.gain.total


def key_of(hit: Rival) -> tuple[str, str | None, str | None]:
    """Effect or kind of value, and place."""
    return (hit.kind, hit.on, None) if isinstance(hit, ValueHit) else hit.candidate.key
