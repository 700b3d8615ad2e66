"""Axes that friction holds where they turn back, though their measured angles are too coarse to show it.

What friction is then no function of the speed says: a search ends far from noise, with an unknown cause or a wrong one.
Where a search that does not count the turns of such axes leaves next to nothing, it was that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from robid_core.estimation.sticks import explains_most
from robid_diagnosis.hypothesis import Case


def cases_without_turns(case: Case, misfit: float, axes: Sequence[str]) -> Iterator[Case]:
    """Yield cases in which turns of some axes do not count, then of all; none where that cannot explain a misfit.

    A right model leaves a misfit of one.
    """
    if case.leave_out_rests and explains_most(1.0, misfit):
        known = set[str]()
        for more in (axes, case.told.axis_names):
            if not set(more) <= known:
                known |= set(more)
                yield replace(case, sticking=tuple(name for name in case.told.axis_names if name in known))
