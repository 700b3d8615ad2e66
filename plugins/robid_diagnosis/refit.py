"""The refit of all that the told robot has: its values, its friction's width, how torques go, which samples count."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from robid_core import NotIdentifiable
from robid_core.residual import times_faster
from robid_diagnosis.hypothesis import Case, Fitted, Hypothesis
from robid_diagnosis.likelihood import costs
from robid_diagnosis.sticking import without_unclear_turns
from robid_diagnosis.timing import timing_of
from robid_diagnosis.trials import WRONG
from robid_diagnosis.zero_speed import WIDTHS

Progress = Callable[[float, float, str], None]


def refitted(case: Case, progress: Progress) -> Fitted:
    """Fit all that the told robot has; not to the end where that cannot be the answer.

    Springs and dampers that data do not tell stay as they are told. Turns of axes whose torque says more without them
    do not count. Torques that are stated as continuous count as held where their delays say so.
    """
    base = _about_its_width(case.fit_what_is_seen(Hypothesis(), progress, roughly=True), progress)
    without = without_unclear_turns(base)
    if without is not base.case:
        try:
            fitted = without.fit_what_is_seen(Hypothesis(), progress, begin=base, roughly=True)
            base = _about_its_width(fitted, progress)
        except NotIdentifiable:
            pass  # what the robot file has acts at turns alone: they count
    base = _with_held_torques(base, progress)
    if base.solution.converged or base.misfit > WRONG:
        return base
    return base.case.fit_what_is_seen(base.hypothesis, progress, begin=base)


def _with_held_torques(base: Fitted, progress: Progress) -> Fitted:
    """Fit with torques that a controller faster than the recording holds, where delays of all axes are those of one.

    Taken where it explains more: a delay alone leaves over what the hold takes from a torque at high frequencies.
    """
    if any(block.motion.torque_hold != "continuous" for block in base.problem.blocks):
        return base
    timing = timing_of(base)
    times = times_faster(timing.lag, timing.standard_error)
    if times is None:
        return base
    held_s = timing.sample_time_s / times
    case, early = replace(base.case, torque_held_s=held_s), np.full(base.case.told.n_axis, -0.5 * held_s)
    try:
        fitted = case.fit_what_is_seen(base.hypothesis, progress, begin=base, delay=early, roughly=True)
    except NotIdentifiable:
        return base
    return fitted if _explains_more(fitted, base, held_s) else base


def _explains_more(fitted: Fitted, base: Fitted, held_s: float) -> bool:
    """Whether a fit of held torques is likelier than one of the samples themselves, noise of the same samples in both.

    The mean over a hold makes noise smaller, too: what is left is weighed as that of the samples.
    """
    weights = []
    for weight, block in zip(base.about.weights, base.problem.blocks, strict=True):
        matrix = weight.matrix.copy()
        matrix[:, :, : len(block.motion.angle_noise)] /= np.sinc(block.motion.frequency_hz * held_s)[
            :, None, None
        ]
        weights.append(replace(weight, matrix=matrix))
    own, _ = costs(fitted, base, replace(base.about, weights=tuple(weights)))
    _, before = costs(fitted, base, base.about)
    return own < before


def _about_its_width(base: Fitted, progress: Progress) -> Fitted:
    """Fit again about the width that friction was found to have.

    It is often told by nobody: it is taken from each fit until it stays, or until a narrower one misfits more.
    """
    for number in range(WIDTHS):
        before, case = base.case, base.case.with_fitted_width(base)
        fitted = case.fit_what_is_seen(base.hypothesis, progress, begin=base, roughly=True)
        if number and fitted.misfit > base.misfit:
            break
        base = fitted
        if case.width_is_near(before):
            break
    return base
