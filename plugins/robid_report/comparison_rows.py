"""Parameters of several fits side by side: estimates, 95 % intervals, and how far each is from the first."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from robid_core import Fit
from robid_report.numbers import to_error

QUANTILE = 1.959964  # of the normal law: 95 % lie within
WIDTH = 100.0  # of the plot of a row


@dataclass(frozen=True)
class Cell:
    """A parameter in one run as text, and where its interval stands in the plot of its row."""

    estimate: str
    interval: str
    over_error: str
    left: float | None = None
    width: float = 0.0
    dot: float = 0.0


@dataclass(frozen=True)
class ComparedRow:
    """A parameter in all runs."""

    name: str
    unit: str
    cells: tuple[Cell, ...]


def compared_rows(fits: Mapping[str, Fit]) -> list[ComparedRow]:
    """Return the parameters that at least one fit reports, in the order in which they come.

    The distance to the first run that has a parameter is over the standard error of the difference, the two errors
    taken as independent.
    """
    places = [{name: i for i, name in enumerate(fit.parameters.names)} for fit in fits.values()]
    names = dict.fromkeys(
        name
        for fit in fits.values()
        for name, reported in zip(fit.parameters.names, fit.parameters.reported, strict=True)
        if reported
    )
    rows = []
    for name in names:
        values = [
            (float(fit.parameters.estimate[own[name]]), float(fit.parameters.standard_error[own[name]]))
            if name in own
            else None
            for fit, own in zip(fits.values(), places, strict=True)
        ]
        unit = next(
            fit.parameters.units[own[name]]
            for fit, own in zip(fits.values(), places, strict=True)
            if name in own
        )
        rows.append(ComparedRow(name, "" if unit == "1" else unit, cells_of(values)))
    return rows


def cells_of(values: list[tuple[float, float] | None]) -> tuple[Cell, ...]:
    """Return the cells of one row from estimate and standard error in each run; None where a run lacks it."""
    known = [(e, QUANTILE * s if math.isfinite(s) else 0.0) for e, s in filter(None, values)]
    low, high = min(e - reach for e, reach in known), max(e + reach for e, reach in known)
    span = high - low
    first = next(pair for pair in values if pair is not None)
    cells = []
    for pair in values:
        if pair is None:
            cells.append(Cell("–", "", ""))
            continue
        estimate, error = pair
        reach = QUANTILE * error if math.isfinite(error) else 0.0
        both = math.hypot(error, first[1])
        apart = (estimate - first[0]) / both if pair is not first and both > 0 else math.nan
        cells.append(
            Cell(
                estimate=to_error(estimate, error),
                interval=f"{to_error(estimate - reach, error)} to {to_error(estimate + reach, error)}"
                if math.isfinite(error)
                else "",
                over_error=f"{apart:+.2f}".replace("-", "−") if math.isfinite(apart) else "",
                left=round(WIDTH * (estimate - reach - low) / span, 2) if span > 0 else 0.0,
                width=round(WIDTH * 2 * reach / span, 2) if span > 0 else 0.0,
                dot=round(WIDTH * (estimate - low) / span, 2) if span > 0 else WIDTH / 2,
            )
        )
    return tuple(cells)
