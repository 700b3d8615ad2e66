"""A second search without the turns of axes that friction holds there, where only what is left shows it.

Where neither measured angles nor their noise say that turns should not count, a search ends far from noise, with an
unknown cause or a wrong one. Where one that does not count them leaves next to nothing, it was that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from robid_core import Context, RobidError
from robid_core.residual import explained_by_turns, faded_misfit
from robid_diagnosis.ceilings import REMEMBERED
from robid_diagnosis.hypothesis import Case, Hypothesis
from robid_diagnosis.results import unknown_of
from robid_diagnosis.selection import Selection
from robid_diagnosis.steps import Outcome


def searched_without_turns(
    selection: Selection,
    outcome: Outcome,
    again: Callable[[Case], Selection],
    context: Context,
) -> tuple[Selection, Outcome, tuple[str, ...]]:
    """Search again without the turns of axes, where these may make most of what is left.

    Returned are the search that counts, its outcome, and axes whose friction only the torque shows.
    """
    left, unknown = faded_misfit(outcome.final.problem, outcome.final.point), unknown_of(outcome)
    if any(one.effect.endswith(REMEMBERED) for one in unknown):  # angles show how friction changes at a turn
        return selection, outcome, ()
    for case in _cases(selection.case, [one.on for one in unknown], left):
        unseen = tuple(name for name in case.sticking or () if name not in (selection.case.sticking or ()))
        context.log.info("misfit %.3g: again without the turns of %s", left, " and ".join(unseen))
        try:
            for records in filter(None, (case.records, case.held_out)):
                case.problem(Hypothesis(), records)
            other = again(case)
            found = other.run()
        except RobidError as error:
            context.log.info("the first search stands: %s", error)
            continue
        if explained_by_turns(faded_misfit(found.final.problem, found.final.point), left):
            return other, found, unseen
    return selection, outcome, ()


def _cases(case: Case, axes: Sequence[str], left: float) -> Iterator[Case]:
    """Yield cases without the turns of some axes, then of all; none where a right model could not explain so much."""
    if case.leave_out_rests and explained_by_turns(1.0, left):
        known = set(case.sticking or ())
        for more in (axes, case.told.axis_names):
            if not set(more) <= known:
                known |= set(more)
                yield replace(case, sticking=tuple(name for name in case.told.axis_names if name in known))
