"""Axes whose turns do not count: what friction is there no function of the measured speed says.

Friction that turns abruptly holds an axis where it turns back, and the measured angle shows it. Or friction turns
within less than the noise of the angle resolves, and the torque says more of all else without those samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid_core import Record
from robid_core.residual import clearer_without_turns, parts_by_variant, sticking_in, turning_seldom
from robid_diagnosis.hypothesis import Case, Fitted


def with_sticking_axes(case: Case, records: Sequence[Record]) -> Case:
    """Return a case in which those axes stick whose angles show it in any of the records, held-out ones included."""
    parts = [part for record in records for _, part in parts_by_variant(record)]
    motions = [case.spectra(part, case.discard, case.highest_hz, case.told.sample_time_s) for part in parts]
    names = np.array(case.told.axis_names)
    sticking, seldom = (tuple(names[found(motions)].tolist()) for found in (sticking_in, turning_seldom))
    return replace(case, sticking=sticking, turning_seldom=seldom)


def without_unclear_turns(fitted: Fitted) -> Case:
    """Return a fit's case without the turns of axes whose torque says more without them; as it is where none does."""
    case, known = fitted.case, set(fitted.case.sticking or ())
    if not case.leave_out_rests or known >= set(case.turning_seldom):
        return case
    clearer = clearer_without_turns(fitted.problem, fitted.point)
    more = (set(clearer) & set(case.turning_seldom)) - known
    if not more:
        return case
    return replace(case, sticking=tuple(name for name in case.told.axis_names if name in known | more))
