"""Two fits of the same parameters side by side: estimates, and how far they are apart in what both state."""

from __future__ import annotations

import math
from typing import Any

from robid_core import Fit
from robid_report.numbers import percent, with_error


def other_fits(fit: Fit | None, fits: tuple[Fit, ...]) -> list[Fit]:
    """Return those that are not the fit of the page, which may be among them."""
    return [other for other in fits if fit is None or not _same(fit, other)]


def fit_with_response(fit: Fit | None, fits: tuple[Fit, ...]) -> Fit | None:
    """Return the fit of the page, or another that has a modelled response where that one has none."""
    if fit is not None and fit.response is not None:
        return fit
    return next((other for other in fits if other.response is not None), fit)


def comparison(fit: Fit | None, other: Fit) -> dict[str, Any]:
    """Return the parameters that both report as text: both estimates, their difference, that in standard errors."""
    rows = []
    own = fit.parameters if fit is not None else other.parameters
    for i, name in enumerate(own.names):
        if not own.reported[i] or name not in other.parameters.names:
            continue
        k = other.parameters.names.index(name)
        mine, theirs = float(own.estimate[i]), float(other.parameters.estimate[k])
        errors = float(own.standard_error[i]), float(other.parameters.standard_error[k])
        both = math.hypot(*errors)
        apart = (theirs - mine) / both if both > 0 else math.nan
        rows.append(
            {
                "name": name,
                "unit": own.units[i],
                "own": with_error(mine, errors[0]),
                "other": with_error(theirs, errors[1]),
                "difference": percent(theirs / mine - 1, signed=True) if mine else "–",
                "apart": f"{apart:+.1f}".replace("-", "−") if math.isfinite(apart) else "–",
            }
        )
    return {"method": other.method, "status": other.status, "rows": rows}


def _same(fit: Fit, other: Fit) -> bool:
    """Whether two fits are one: a stage's result is read anew for each input."""
    ends = [
        (one.method, one.status, one.parameters.names, one.parameters.estimate.tobytes())
        for one in (fit, other)
    ]
    return ends[0] == ends[1]
