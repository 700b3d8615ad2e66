"""Second thoughts of a forward search: causes that were accepted before the last one, judged again beside it.

What the last cause explains as well is dropped; what another cause would explain better beside the others is exchanged
for that one. Each exchange lowers the cost and a drop leaves fewer causes, so that this ends; beside one new cause
there are as many exchanges as causes at most. Where much is left to explain, a cause is exchanged for a clearly better
one only: all of them are wrong there, and which is the least wrong changes with whatever is beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robid_core import RobidError
from robid_diagnosis.columns import Motion
from robid_diagnosis.hypothesis import Case, Fitted
from robid_diagnosis.least_gains import LEAST
from robid_diagnosis.likelihood import lost
from robid_diagnosis.search import Failure
from robid_diagnosis.steps import Searched, Step
from robid_diagnosis.trials import WRONG, clearly_less, nearness

BETTER = 0.1  # of what a cause gains: another one must gain so much more, where the misfit says that something lacks

Searches = Callable[[Fitted, Motion | None], Searched]
NextCause = Callable[[Fitted, Searched, Sequence[Step]], tuple[Fitted, Step] | None]


class Revision:
    """Backward elimination and exchanges among the causes of one case."""

    def __init__(
        self,
        case: Case,
        searched: Searches,
        next_cause: NextCause,
        bare: Fitted,
        failures: list[Failure],
        progress: Callable[[float, float, str], None],
    ) -> None:
        """Prepare.

        Parameters
        ----------
        case
            What is diagnosed.
        searched
            Holds every effect against what a fit leaves.
        next_cause
            Fits what such a search promises beside causes that are known; the best, where it is one.
        bare
            The fit without any cause.
        failures
            Grows by what could not be fitted.
        progress
            Told (done, all, what).
        """
        self.case, self.searched, self.next_cause = case, searched, next_cause
        self.bare, self.failures, self.progress = bare, failures, progress

    def run(
        self, current: Fitted, steps: list[Step], motion: Motion | None, exchanges: int | None = None
    ) -> tuple[Fitted, list[Step]]:
        """Return the fit and its causes once none that came before the last one is needless or worse than another.

        `exchanges`: how many there may be; as many as causes.
        """
        left = len(steps) if exchanges is None else exchanges
        for place, step in enumerate(steps[:-1]):
            before, after = steps[:place], steps[place + 1 :]
            least = LEAST * current.excess
            try:
                without = self._without(step, current, least)
            except RobidError as error:
                self.failures.append(Failure(*step.key, str(error)))
                continue
            if without.misfit > self.bare.misfit:  # which holds nothing more: no minimum was found
                self.failures.append(Failure(*step.key, "the fit without it went astray"))
                continue
            missing = lost(without, current, current.about)
            if missing < least:
                return self.run(without, [*before, *after], motion, left)
            margin = max(nearness(current), BETTER * missing if current.misfit > WRONG else 0.0)
            other = self._other(without, step, [*before, *after], missing + margin, motion) if left else None
            if other is not None and lost(other[0], current, current.about) < -margin:
                fitted, better = other
                return self.run(fitted, [*before, better, *after], motion, left - 1)
        return current, steps

    def _without(self, step: Step, current: Fitted, least: float) -> Fitted:
        """Fit all but one cause; with derivatives that cost many motions only where that may show it to be needless."""
        hypothesis = current.hypothesis.without(step.names)
        quick = self.case.fit_what_is_seen(hypothesis, self.progress, begin=current, thorough=False)
        if quick.misfit <= self.bare.misfit and clearly_less(
            quick, lost(quick, current, current.about), least
        ):
            return quick
        return self.case.fit_what_is_seen(quick.hypothesis, self.progress, begin=quick)

    def _other(
        self, without: Fitted, step: Step, others: Sequence[Step], least: float, motion: Motion | None
    ) -> tuple[Fitted, Step] | None:
        """Return a cause that gains more than `least` beside a fit that lacks one of the steps, where there is one.

        Rivals are fitted only where the search promises that much of another cause; then the one that was taken out is
        fitted as they are, from its best start beside the others: what was its minimum when it came may be none now.
        """
        known = {one.key for one in (step, *others)}
        seen = self.searched(without, motion)
        promises = (hit.gain.total for hit in seen.found.hits if hit.candidate.key not in known)
        if max(promises, default=0.0) <= least:
            return None
        other = self.next_cause(without, seen, others)
        return other if other is not None and other[1].gain > least else None
