"""Rivals of a cause judged once more, beside all causes that were found.

A cause is compared with its rivals when it is accepted, while those that come later are still missing. Their absence
makes laws alike, and may make them differ. So each rival is put into the place of its cause in the final robot and
fitted there, and what then explains the data as well is a tie. "As well" is counted in the noise that the robot leaves:
where it leaves more than was told, differences of the log-likelihood are divided by the misfit (quasi-likelihood:
Burnham and Anderson, Model Selection and Multimodel Inference, 2002, section 2.5).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from robid_core import RobidError
from robid_diagnosis.hypothesis import Case, Fitted
from robid_diagnosis.likelihood import lost
from robid_diagnosis.search import Failure
from robid_diagnosis.steps import Step
from robid_diagnosis.trials import SAME, Trial, clearly_less, key_of, nearness
from robid_diagnosis.values import PRICE, ValueHit

Progress = Callable[[float, float, str], None]


def with_final_ties(
    case: Case, final: Fitted, steps: Sequence[Step], failures: list[Failure], progress: Progress
) -> tuple[Step, ...]:
    """Return the causes with those of their rivals that explain the data as well beside all others.

    What cannot be fitted there is no tie; `failures` tells why.
    """
    return tuple(_with_ties(case, final, step, failures, progress) for step in steps)


def _with_ties(case: Case, final: Fitted, step: Step, failures: list[Failure], progress: Progress) -> Step:
    kept = list[Trial]()
    for rival in step.rivals:
        fewer = max(0, step.freedom - rival.freedom)
        near = nearness(final) + PRICE * fewer * max(1.0, final.misfit)
        if step.kind == "effect" and rival.addition is not None and step.key[1:] == key_of(rival.hit)[1:]:
            near += SAME * step.gain
        try:
            fitted = _beside(case, final, step, rival, progress)
            if fitted is not rival.fitted and _may_be_lower(fitted, final, near):
                fitted = case.fit(fitted.hypothesis, progress, begin=fitted)
        except RobidError as error:
            failures.append(Failure(*key_of(rival.hit), str(error)))
            continue
        if fitted is rival.fitted or _lacks(fitted, final) < near:
            kept.append(replace(rival, fitted=fitted))
    return replace(step, rivals=tuple(kept))


def _may_be_lower(fitted: Fitted, final: Fitted, near: float) -> bool:
    """Whether a fit with few derivatives by motions is no tie, and one with all of them might be."""
    return _lacks(fitted, final) >= near and not clearly_less(fitted, _lacks(fitted, final), near)


def _lacks(fitted: Fitted, final: Fitted) -> float:
    """By how much twice the log-likelihood of a fit is smaller than that of the final one."""
    return lost(fitted, final, final.about)


def _beside(case: Case, final: Fitted, step: Step, rival: Trial, progress: Progress) -> Fitted:
    """Fit the final hypothesis with a rival in the place of a cause; as it was fitted, where nothing else has come.

    With the derivatives that are cheap.
    """
    rest, own, addition = final.hypothesis.without(step.names), rival.fitted.hypothesis, rival.addition
    names = rival.hit.names if isinstance(rival.hit, ValueHit) else ()
    before = own.additions if addition is None else own.additions[:-1]
    if before == rest.additions and set(own.widened) - set(names) == set(rest.widened):
        return rival.fitted
    if addition is None:
        hypothesis = rest.with_widened(tuple(name for name in names if name not in rest.widened))
    else:
        taken = {one.label for one in rest.additions}
        label = f"{addition.label}_instead" if addition.label in taken else addition.label
        hypothesis = rest.with_addition(replace(addition, label=label))
    held = dict.fromkeys((*final.hypothesis.held, *own.held))
    return case.fit(
        replace(hypothesis, held=tuple(held)), progress, begin=final, others=rival.fitted, thorough=False
    )
