"""A torque fit again without the samples at which axes turn back, where the torque says more without them.

So it does where noise of their angles hides friction there, and where what is left then is next to nothing.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection

import numpy as np

from robid_core import RobidError
from robid_core.estimation.torque.nearest_friction import NearestFriction
from robid_core.residual import (
    Solution,
    TorqueProblem,
    clearer_without_turns,
    explained_by_turns,
    faded_misfit,
    sticking_in,
)

Fitted = tuple[TorqueProblem, Solution, tuple[NearestFriction, ...], int]
"""Problem, solution, friction in the numbers of a robot file, and from how many starts."""


def fitted_without_turns(
    fitted: Fitted, again: Callable[[Collection[str]], Fitted], log: logging.Logger
) -> tuple[Fitted, tuple[str, ...]]:
    """Return the fit that counts, and axes whose turns do not count since only what is left says so.

    Parameters
    ----------
    fitted
        With all turns but those of axes whose angles show that friction holds them.
    again
        Fits without the turns of some axes. Where it cannot, too little is left or does not say what is free: the fit
        of before stands.
    """
    every = fitted[0].free.robot.axis_names
    known = set(np.array(every)[sticking_in([block.motion for block in fitted[0].blocks])].tolist())
    if clearer := clearer_without_turns(fitted[0], fitted[1].point):
        log.info("%s: noise of angles hides friction at turns; again without", ", ".join(clearer))
        if found := _without({*known, *clearer}, again, log):
            fitted, known = found, {*known, *clearer}
    unseen = tuple(name for name in every if name not in known)
    left = faded_misfit(fitted[0], fitted[1].point)
    if unseen and explained_by_turns(1.0, left):
        log.info("misfit %.3g: again without the samples at which axes turn back", left)
        found = _without(set(every), again, log)
        if found and explained_by_turns(faded_misfit(found[0], found[1].point), left):
            return found, unseen
    return fitted, ()


def _without(
    names: Collection[str], again: Callable[[Collection[str]], Fitted], log: logging.Logger
) -> Fitted | None:
    try:
        return again(names)
    except RobidError as error:
        log.info("the fit of before stands: %s", error)
        return None
