"""Axes whose turns do not count: what friction is there no function of the measured speed says.

Friction that turns abruptly holds an axis where it turns back, and the measured angle shows it. Or friction turns
within less than the noise of the angle resolves, and the torque says more of all else without those samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid_core import DataRejected, Record
from robid_core.residual import clearer_without_turns, parts_by_variant, sticking_in
from robid_diagnosis.hypothesis import Case, Fitted, Hypothesis


def with_sticking_axes(case: Case, records: Sequence[Record]) -> Case:
    """Return a case in which those axes stick whose angles show it in any of the records, held-out ones included."""
    parts = [part for record in records for _, part in parts_by_variant(record)]
    sampling = case.discard, case.highest_hz, case.told.sample_time_s
    shown = sticking_in([case.spectra(part, *sampling) for part in parts])
    return replace(case, sticking=tuple(np.array(case.told.axis_names)[shown].tolist()))


def without_unclear_turns(fitted: Fitted) -> Case:
    """Return a fit's case without the turns of axes whose torque says more without them; as it is where none does.

    Not of axes of which too little would be left then in its records, or in those that judge.
    """
    case = fitted.case
    clearer = clearer_without_turns(fitted.problem, fitted.point) if case.leave_out_rests else ()
    if clearer and case.sticking is None:
        case = with_sticking_axes(case, case.records)
    for name in clearer:
        more = {name, *(case.sticking or ())}
        other = replace(case, sticking=tuple(one for one in case.told.axis_names if one in more))
        case = other if _is_possible(other) else case
    return case


def _is_possible(case: Case) -> bool:
    """Whether enough is left of all axes in a case's records, and in those that judge."""
    try:
        for records in filter(None, (case.records, case.held_out)):
            case.problem(Hypothesis(), records)
    except DataRejected:
        return False
    return True
