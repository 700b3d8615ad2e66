"""Fits of a law with corners that begin where its corners are round: a gap has many minima, a soft one has few.

How round they are is estimated on the way. Experiments that are explained far worse than the others do not count
until they are explained as well: near a corner a motion that is a little off becomes another one, and what it leaves
says nothing of the way there. In the end all experiments count again that the model repeats.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from robid_core import FloatArray
from robid_core.residual import PeriodicBlock, effect_class
from robid_core.residual.misfit import power_in_noise
from robid_diagnosis.hypothesis import Case, Fitted, Hypothesis

MOST = 0.25  # of the experiments, at most, do not count for the time being
FAR = 3.0  # times the median of the power that experiments leave, or more: explained far worse than others
ROUNDS = 8  # of passes, after each of which it is asked anew which these are
SLOW = 0.9  # of the misfit: a round that leaves more is slow
PATIENCE = 2  # slow rounds, one after the other: they were the last

Progress = Callable[[float, float, str], None]


def fits_from_smooth(
    case: Case, hypothesis: Hypothesis, begin: Fitted | None, progress: Progress
) -> tuple[Fitted, Fitted]:
    """Fit a hypothesis whose last law has corners, from round ones on: as round as they are, and as they were given.

    Parameters
    ----------
    case, hypothesis
        What is fitted.
    begin
        A fit from which its other numbers begin; None: those of the robot file.
    progress
        Told (done, all, what).
    """
    *before, last = hypothesis.additions
    smooth = effect_class(last.use).smoothest
    free = (*last.free, *(name for name in smooth if name not in last.free))
    soft = replace(last, values={**last.values, **smooth}, free=free)
    slow = 0
    fitted = case.fit_what_is_seen(
        replace(hypothesis, additions=(*before, soft)), progress, begin, as_told=begin is None
    )
    for _ in range(ROUNDS):
        if not _leave_out_worst(fitted) and fitted.solution.converged:
            break
        further = case.fit_what_is_seen(fitted.hypothesis, progress, fitted)
        slow = slow + 1 if further.misfit > SLOW * fitted.misfit else 0
        fitted = further
        if slow == PATIENCE:
            break
    for block in _periodic(fitted):
        block.left_out = block.rattles.copy()
    rounded = case.fit_what_is_seen(fitted.hypothesis, progress, fitted)
    return rounded, case.fit_what_is_seen(hypothesis, progress, rounded)


def _leave_out_worst(fitted: Fitted) -> int:
    """Leave out experiments that are explained far worse than the others; return how many that do not rattle."""
    problem, point = fitted.problem, fitted.point
    size, count = problem.friction_size(point), 0
    for block, robot, residual in zip(
        problem.blocks, problem.robots(point), problem.residuals(point), strict=True
    ):
        if isinstance(block, PeriodicBlock):
            power: FloatArray = power_in_noise(block, robot, size, residual)
            worst = np.quantile(power, 1 - MOST, method="higher")
            far = power > max(FAR * float(np.median(power)), float(worst))
            block.left_out = block.rattles | far
            count += int((far & ~block.rattles).sum())
    return count


def _periodic(fitted: Fitted) -> list[PeriodicBlock]:
    return [block for block in fitted.problem.blocks if isinstance(block, PeriodicBlock)]
