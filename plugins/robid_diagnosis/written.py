"""A fit once more with what a robot file can express: friction of one zero-speed width at each axis.

A search fits friction by functions of several widths, so that a width that is told wrong is no cause. Beside a law of
the same speeds (Stribeck) these functions may be large against one another, and follow together a curve that no robot
file has. So the width is fitted, too, and laws that have such a width share it. Two functions of about that width tell
by their sum where it should be, as far as the laws beside them stay; a secant leads to the width that stays with them.
Where one width for all leaves much, each law is given its own, if that leaves little. Where a fit found no minimum, its
first width is taken: none would settle beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy

from robid_core import FloatArray, RobidError
from robid_core.estimation.scaled_inverse import scaled_inverse
from robid_core.estimation.torque.speed_functions import NEAR_ALONE
from robid_diagnosis.hypothesis import Fitted
from robid_diagnosis.likelihood import lost
from robid_diagnosis.search import Failure
from robid_diagnosis.trials import DOUBTFUL, WRONG
from robid_diagnosis.values import PRICE

ALONE = (1.0,)
PAIR = (1.0, 1.1)  # widths whose sum is one of a width in between, or near by
ROUNDS = 6  # of widths
OWN = (0.3, 1.0, 3.0)  # times the width of the motors' friction: where a law's own one begins
MUCH = 1.05  # of the misfit of several widths: what one width for all leaves beyond
SAME = 0.003  # of the logarithm of a width: it stays
FARTHEST = 0.7  # likewise: one round moves it no farther

OF_LAW = "zero-speed width of a law"

Progress = Callable[[float, float, str], None]


def as_written(final: Fitted, failures: list[Failure], progress: Progress) -> Fitted:
    """Return a fit with one zero-speed width at each axis; the fit as it is where there is none, which is noted.

    None is where friction would be negative beside a law that follows it: no robot file has that.

    Parameters
    ----------
    final
        With functions of several widths.
    failures
        Grows by why it could not be fitted.
    progress
        Told (done, all, what).
    """
    numbers = (len(NEAR_ALONE) - 1) * final.case.told.n_axis
    try:
        fitted = _with_width(final, final.case.with_fitted_width(final).width, ALONE, progress)
        near = lost(fitted, final, final.about) < PRICE * numbers * max(1.0, final.misfit)
        if near and is_possible(fitted):
            return as_sure_as(final, fitted)
        if final.misfit > WRONG and not final.solution.converged:
            return as_sure_as(final, fitted) if is_possible(fitted) else final
        pair = _fitted_width(fitted, progress)
        other = as_sure_as(pair, _with_width(pair, pair.case.width, ALONE, progress))
    except RobidError as error:
        failures.append(Failure("zero-speed width", None, None, str(error)))
        return final
    found = [as_sure_as(pair, fitted), other]
    if other.misfit > max(DOUBTFUL, MUCH * final.misfit) and other.hypothesis.has_signs:
        nearer = min(fitted, pair, key=lambda one: one.misfit)  # secants may lead astray: no width is right
        found += _with_own_widths([(nearer, 1.0), *((final, share) for share in OWN)], failures, progress)
    possible = [one for one in found if is_possible(one)]
    if not possible:
        failures.append(Failure("zero-speed width", None, None, "friction of one width would be negative"))

    def cost(one: Fitted) -> float:
        """Beside that of the final fit, with what its numbers gain by chance."""
        return lost(one, final, final.about) + PRICE * one.problem.n_free * max(1.0, final.misfit)

    return min(possible, key=cost, default=final)


def is_possible(fitted: Fitted) -> bool:
    """Whether friction is nowhere negative: a robot file has zero there, which must change next to nothing.

    Two standard errors with all other numbers held are four of twice the log-likelihood.
    """
    own = slice(fitted.problem.n_free, fitted.problem.n_free + fitted.case.told.n_axis)
    information = np.diag(scaled_inverse(fitted.solution.covariance))[own]
    return bool((fitted.point[own] >= -2 / np.sqrt(information)).all())


def _with_width(begin: Fitted, width: FloatArray, widths: tuple[float, ...], progress: Progress) -> Fitted:
    """Fit with functions of speed about a zero-speed width, rad/s, (n_axis,), which laws with a sign have, too."""
    case = replace(begin.case, friction_speed=width, widths=widths)
    shares = dict(zip(case.told.axis_names, (case.width / begin.case.width).tolist(), strict=True))
    return case.fit(begin.hypothesis.with_wider_signs(shares), progress, begin=begin)


def _with_own_widths(
    begins: Sequence[tuple[Fitted, float]], failures: list[Failure], progress: Progress
) -> list[Fitted]:
    """Fit laws that have widths of their own, so many times the motors' to begin with; none if that leaves much.

    Secants for the motors' width follow where a first fit leaves least, and from others only where that ends badly.
    """
    first = list[Fitted]()
    for begin, share in begins:
        shares = dict.fromkeys(begin.case.told.axis_names, share)
        hypothesis = begin.hypothesis.with_wider_signs(shares).with_own_widths()
        try:
            first.append(begin.case.fit(hypothesis, progress, begin=begin))
        except RobidError as error:
            failures.append(Failure(OF_LAW, None, None, str(error)))
    for one in sorted(first, key=lambda one: one.misfit):
        try:
            pair = _fitted_width(one, progress)
            fitted = as_sure_as(pair, _with_width(pair, pair.case.width, ALONE, progress))
        except RobidError as error:
            failures.append(Failure(OF_LAW, None, None, str(error)))
            continue
        if fitted.misfit < WRONG:
            return [fitted]
    return []


def _fitted_width(fitted: Fitted, progress: Progress) -> Fitted:
    """Return the fit of two functions that leave their width where it is, found by secants from that of a fit."""
    at, before = np.log(fitted.case.width), None
    for _ in range(ROUNDS):
        fitted = _with_width(fitted, np.exp(at), PAIR, progress)
        moves = np.log(fitted.case.with_fitted_width(fitted).width) - at
        if (np.abs(moves) < SAME).all():
            break
        step = moves
        if before is not None:
            way, less = at - before[0], before[1] - moves
            step = np.divide(moves * way, less, out=moves.copy(), where=np.abs(less) > SAME * np.abs(way))
        before = at, moves
        at = at + np.clip(step, -FARTHEST, FARTHEST)
    return fitted


def as_sure_as(other: Fitted, fitted: Fitted) -> Fitted:
    """Return a fit of one width with the covariance of one of several, whose sum the one is: the width is unknown.

    The other may have free parameters more, which are then unknown likewise.
    """
    n_axis, n_delay = fitted.case.told.n_axis, fitted.problem.n_delay
    n_law = len(other.problem.friction_names) - 1
    names = other.problem.free.names
    own = np.eye(len(names))[[names.index(name) for name in fitted.problem.free.names]]
    of_axes = np.kron(np.repeat(np.eye(2), (n_law, 1), axis=1), np.eye(n_axis))
    sums = scipy.linalg.block_diag(own, of_axes, np.eye(n_delay))
    covariance = sums @ other.solution.covariance @ sums.T
    return replace(fitted, solution=replace(fitted.solution, covariance=covariance))
