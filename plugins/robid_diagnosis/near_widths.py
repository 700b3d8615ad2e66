"""Laws at motors that turn their sign at a speed of their own, near to that of the motor's friction.

A search gives a law at a motor the zero-speed width of the motor's Coulomb friction. Both are of one contact, and yet
they differ: a law that turns round at 0.8 times that speed is found 4 to 12 % too small, at a stated error of
1 %. So its width is an unknown of the last fit, with a normal prior in its logarithm about the motor's. The data
move the size as far as they show the width; where they do not, the size's error has the prior's share.

The width itself is held where the fit found it and has no stated error: where a law and Coulomb friction are alike
(Stribeck friction), one as much narrower as the other is wider explains nearly the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from robid_core import RobidError
from robid_core.residual import Linearisation
from robid_diagnosis.hypothesis import Addition, Fitted, Hypothesis
from robid_diagnosis.likelihood import lost
from robid_diagnosis.search import Failure
from robid_diagnosis.trials import WRONG
from robid_diagnosis.values import PRICE
from robid_diagnosis.written import ALONE, OF_LAW, PAIR, as_sure_as, is_possible

TOLERANCE = (
    0.2  # standard deviation, in natural scales, of a law's width about the motor's: a factor of 1.5 is rare
)
MOTOR = "motor"

Progress = Callable[[float, float, str], None]


def with_near_widths(
    written: Fitted, about: Linearisation, failures: list[Failure], progress: Progress
) -> Fitted:
    """Return a fit of one zero-speed width at each motor with widths of the laws there that are near to it.

    The fit as it is where no law has a width that is held, or much is left, of which a width says nothing. Where widths
    of their own explain no more than as many numbers do by chance, values stay, and errors are those with the widths
    unknown.

    Parameters
    ----------
    written
        As a robot file has it.
    about
        Weights in which likelihoods are compared.
    failures
        Grows by why widths could not be fitted.
    progress
        Told (done, all, what).
    """
    if written.case.widths != ALONE or not any(_follows(one) for one in written.hypothesis.additions):
        return written
    try:
        unknown = _with_unknown_widths(written, progress)
        if unknown.misfit > WRONG:
            return written
        nearer = _with_widths_of(unknown, written, progress)
    except RobidError as error:
        failures.append(Failure(OF_LAW, None, None, str(error)))
        return written
    numbers = unknown.problem.n_free - written.problem.n_free
    gains = lost(nearer, written, about) < -PRICE * numbers * max(1.0, written.misfit)
    return as_sure_as(unknown, nearer if gains and is_possible(nearer) else written)


def _follows(addition: Addition) -> bool:
    """Whether a law has the zero-speed width of the friction of its motor."""
    return addition.side == MOTOR and bool(addition.held_widths)


def _with_unknown_widths(written: Fitted, progress: Progress) -> Fitted:
    """Fit widths of laws with their prior, and that of each motor by two functions whose sum is one of a width near."""
    laws = [one for one in written.hypothesis.additions if _follows(one)]
    additions = (one.with_own_width() if one in laws else one for one in written.hypothesis.additions)
    prior = {f"effect.{one.label}.{width}": TOLERANCE for one in laws for width in one.held_widths}
    before = written.case
    case = replace(before, friction_speed=before.width, widths=PAIR, priors={**before.priors, **prior})
    return case.fit(replace(written.hypothesis, additions=tuple(additions)), progress, begin=written)


def _with_widths_of(unknown: Fitted, written: Fitted, progress: Progress) -> Fitted:
    """Fit with one width at each motor, these and those of laws as a fit found them."""
    width = unknown.case.with_fitted_width(unknown).width
    case = replace(written.case, friction_speed=width)
    shares = dict(zip(case.told.axis_names, (width / written.case.width).tolist(), strict=True))

    def of_law(one: Addition) -> Addition:
        if not _follows(one):
            return one
        found = {name: unknown.estimate(f"effect.{one.label}.{name}")[0] for name in one.held_widths}
        return replace(one, values={**one.values, **found})

    hypothesis: Hypothesis = written.hypothesis.with_wider_signs(shares)
    additions = tuple(of_law(one) for one in hypothesis.additions)
    return case.fit(replace(hypothesis, additions=additions), progress, begin=unknown)
