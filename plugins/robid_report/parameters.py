"""Rows of the parameter table: true where known, start, estimate, standard error, and how far apart they are."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robid_core import EssentialParameters, ParameterTable, Truth, is_determined
from robid_report.numbers import percent, significant, to_error

LIMITS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0)


def relative_error(error: float, value: float) -> str:
    """Write a standard error as a share of the value, "not determined" where it exceeds the value by far.

    >>> relative_error(0.5, 4.0), relative_error(1.0, 7e-6), relative_error(1.0, 0.0)
    ('12.5\u202f%', 'not determined', '–')
    """
    if not is_determined(error, value):
        return "not determined"
    return percent(error / abs(value)) if value else "–"


@dataclass(frozen=True)
class Row:
    """One parameter as text, and where its mark stands in the small plot (percent of the plot's width)."""

    name: str
    unit: str
    group: str
    true: str
    start: str
    estimate: str
    standard_error: str
    spread: str
    """Standard error that the spread over experiments says; empty where it says none."""
    relative_error: str
    relative_size: str
    determined: bool
    deviation: str
    deviation_in_errors: str
    at_bound: bool
    reported: bool
    dot: float | None
    bar_left: float
    bar_width: float


@dataclass(frozen=True)
class Deviation:
    """Estimate against truth, both relative to the truth."""

    share: float
    error: float


def deviations(table: ParameterTable, truth: Truth | None) -> list[Deviation | None]:
    """Relative deviation and standard error of each parameter whose truth is known and not zero."""
    known = truth.as_mapping() if truth is not None else {}
    result: list[Deviation | None] = []
    for i, name in enumerate(table.names):
        value = known.get(name, 0.0)
        if value == 0:
            result.append(None)
        else:
            result.append(
                Deviation(float(table.estimate[i]) / value - 1, float(table.standard_error[i]) / abs(value))
            )
    return result


def plot_limit(found: list[Deviation | None]) -> float:
    """Half width of the small plots: the widest deviation with two standard errors, on a round grid."""
    reach = [abs(d.share) + (2 * d.error if math.isfinite(d.error) else 0.0) for d in found if d is not None]
    widest = max(reach, default=0.0)
    return next((limit for limit in LIMITS if widest <= limit), 2.0)


def rows(table: ParameterTable, truth: Truth | None) -> tuple[list[Row], float]:
    """Return the rows and the half width of their plots as a share of the truth."""
    found = deviations(table, truth)
    shown = [d if table.reported[i] else None for i, d in enumerate(found)]
    limit = plot_limit(shown)
    known = truth.as_mapping() if truth is not None else {}
    result = []
    for i, name in enumerate(table.names):
        estimate, error = float(table.estimate[i]), float(table.standard_error[i])
        start, deviation = float(table.start[i]), found[i]
        if deviation is not None:
            share, in_errors = (
                deviation.share,
                deviation.share / deviation.error if deviation.error > 0 else math.nan,
            )
        else:
            share, in_errors = (estimate / start - 1 if start and truth is None else math.nan), math.nan
        dot, left, width = _mark(deviation, limit)
        result.append(
            Row(
                name=name,
                unit=table.units[i],
                group=table.groups[i],
                true=to_error(known[name], error) if name in known else "–",
                start=significant(start),
                estimate=to_error(estimate, error),
                standard_error=significant(error, 2),
                spread=_spread(table, i),
                relative_error=relative_error(error, estimate),
                relative_size=percent(error / abs(estimate)) if estimate else "–",
                determined=is_determined(error, estimate),
                deviation=percent(share, signed=True),
                deviation_in_errors=f"{in_errors:+.1f}".replace("-", "−")
                if math.isfinite(in_errors)
                else "–",
                at_bound=bool(table.at_bound[i]),
                reported=bool(table.reported[i]),
                dot=dot,
                bar_left=left,
                bar_width=width,
            )
        )
    return result, limit


def _spread(table: ParameterTable, i: int) -> str:
    if table.spread is None or not math.isfinite(table.spread[i]):
        return ""
    return significant(float(table.spread[i]), 2)


@dataclass(frozen=True)
class Essential:
    """Essential parameters as text: what is kept, and what was left out in which order."""

    kept: list[tuple[str, str, str, str, str]]
    """Name, unit, estimate, standard error, both over one another."""
    removed: list[tuple[str, str, str, str]]
    """Name, relative standard error when it went, growth of the residual, probability by chance."""


def essential_rows(found: EssentialParameters | None) -> Essential | None:
    """Return the table of essential parameters, None where there is none."""
    if found is None:
        return None
    values = zip(found.estimate.tolist(), found.standard_error.tolist(), strict=True)
    kept = [
        (name, unit, to_error(value, error), significant(error, 2), relative_error(error, value))
        for name, unit, (value, error) in zip(found.names, found.units, values, strict=True)
    ]
    steps = found.relative_error.tolist(), found.increase.tolist(), found.probability.tolist()
    removed = [
        (name, percent(relative), percent(increase), significant(chance, 2))
        for name, relative, increase, chance in zip(found.removed, *steps, strict=True)
    ]
    return Essential(kept, removed)


def _mark(deviation: Deviation | None, limit: float) -> tuple[float | None, float, float]:
    """Place dot and bar of two standard errors in a plot from -limit to +limit, in percent of its width."""
    if deviation is None or abs(deviation.share) > limit:
        return None, 0.0, 0.0
    error = deviation.error if math.isfinite(deviation.error) else 0.0
    low, high = max(deviation.share - 2 * error, -limit), min(deviation.share + 2 * error, limit)
    place = [round(50 * (1 + share / limit), 2) for share in (deviation.share, low, high)]
    return place[0], place[1], round(place[2] - place[1], 2)
