"""The zero-speed width of friction beside causes that were found: fitted anew, since it is held in a fit.

A law of friction that is held at a wrong width leaves what another law, which has nothing to do with it, explains.
"""

from __future__ import annotations

from collections.abc import Callable

from robid_core import RobidError
from robid_diagnosis.hypothesis import Fitted
from robid_diagnosis.search import Failure

WIDTHS = 4  # one after the other
MOVED = 1.02  # times a width, or more: it is another one


def with_own_width(
    current: Fitted, failures: list[Failure], progress: Callable[[float, float, str], None]
) -> Fitted:
    """Fit again with the width that friction has beside a hypothesis, until it stays; its case has that width then.

    Only where a cause has such a width itself: functions about another width can do what those of the motor can.
    """
    for _ in range(WIDTHS):
        case = current.case.with_fitted_width(current)
        if not current.hypothesis.has_signs or case.width_is_near(current.case, MOVED):
            break
        shares = dict(zip(case.told.axis_names, (case.width / current.case.width).tolist(), strict=True))
        hypothesis = current.hypothesis.with_wider_signs(shares)
        try:
            fitted = case.fit(hypothesis, progress, begin=current)
        except RobidError as error:
            failures.append(Failure("zero-speed width", None, None, str(error)))
            break
        if fitted.misfit > current.misfit:
            break
        current = fitted
    return current
