"""Second thoughts of the search: a cause that stood in for another one is exchanged once that one is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robid_core import Record, Robot
from robid_diagnosis.hypothesis import Case
from robid_diagnosis.likelihood import lost
from robid_diagnosis.revision import Revision
from robid_diagnosis.selection import Selection
from robid_diagnosis.trials import TIE

RIPPLE, STANDS_IN, TRUE = "drive.torque_ripple", "transmission.piecewise_linear", "transmission.backlash"


def selection(case: Case, uses: list[str]) -> Selection:
    return Selection(case, uses, {}, np.random.default_rng(0), lambda *_: None, 4)


def test_a_cause_that_stood_in_for_another_is_exchanged(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record]
) -> None:
    """A gap of the gear, and ripple, searched without that law: a spring of two slopes stands in for the gap.

    Once the law is known it takes that one's place, the cost falls by more than a tie, and what is left is noise.
    """
    plant = plant_of(told, 31)
    level = plant.parameter("friction.axis_1.coulomb")
    plant = plant.with_effect("play", TRUE, "axis_1", values={"gap": 1e-5})
    plant = plant.with_effect("wave", RIPPLE, "axis_1", values={"amplitude": 0.003 * level, "order": 7.0})
    case = Case((measured(plant, 32),), told, {}, 100.0, 0, 12, 5e-4)
    first = selection(case, [STANDS_IN, RIPPLE])
    outcome = first.run()
    assert [step.use for step in outcome.steps] == [STANDS_IN, RIPPLE]
    whole = selection(first.case, [STANDS_IN, TRUE, RIPPLE])
    revision = Revision(
        whole.case, whole.searched, whole.next_cause, outcome.base, whole.failures, lambda *_: None
    )
    fitted, steps = revision.run(outcome.final, list(outcome.steps), None)
    assert {step.use for step in steps} == {TRUE, RIPPLE}
    about = outcome.final.about
    assert lost(fitted, outcome.final, about) < -TIE
    assert fitted.misfit < 1.02 < outcome.final.misfit
