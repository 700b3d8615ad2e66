"""A fit as text: why it should be doubted, how it ended, its parameters, and where the model misfits."""

from __future__ import annotations

import math
import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robid_core.artifacts import EssentialParameters, Fit, MisfitTable, ParameterTable


def doubt_lines(doubts: Sequence[object], remarks: Sequence[object] = ()) -> list[str]:
    """Return each doubt, then each remark as a line of its own, whole; for a person broken at the terminal's edge."""
    marked = [*(f"! {doubt}" for doubt in doubts), *(f"- {remark}" for remark in remarks)]
    texts, width = [" ".join(text.split()) for text in marked], _width()
    if width is None:
        return texts
    broken = [textwrap.wrap(t, width, subsequent_indent="  ", break_on_hyphens=False) for t in texts]
    return [line for lines in broken for line in lines]


def fit_line(fit: Fit) -> str:
    """Say in one line how a fit ended, and whether it is doubted."""
    state = "NOT CONVERGED: " if not fit.converged else "DO NOT RELY ON IT: " if fit.is_doubted else ""
    misfit = f"; misfit {fit.misfit:.3g}" if fit.misfit_against else ""
    return f"{state}{fit.status}{misfit}; {fit.n_agree} of {fit.n_starts} starts agree"


def fit_table(fit: Fit, true: dict[str, float], everything: bool = False) -> list[str]:
    """Return a fit's parameters as aligned text, the reported ones or all."""
    return parameter_lines(fit.parameters, true, everything)


def parameter_lines(
    table: ParameterTable, true: Mapping[str, float] | None = None, everything: bool = True
) -> list[str]:
    """Return parameters as aligned text; "not determined" stands where the page has it (`is_determined`).

    "by experiments": the standard error that the spread over experiments says.
    """
    import numpy as np

    from robid_core.artifacts import is_determined

    true = true or {}
    head = ["parameter", "unit", *(["true"] if true else []), "start", "estimate", "std error"]
    spread = None if table.spread is None or np.isnan(table.spread).all() else table.spread.tolist()
    head += ["by experiments"] if spread else []
    head += ["off / std error"] if true else []
    rows = [head]
    for index, name in enumerate(table.names):
        if not (everything or table.reported[index]):
            continue
        value, size = float(table.estimate[index]), float(table.standard_error[index])
        error = "at bound" if table.at_bound[index] else f"{size:.2g}" if size == size else "held"
        error += "" if is_determined(size, value) or table.at_bound[index] else ", not determined"
        truth = [number_text(true[name], size) if name in true else "-"] if true else []
        off = [f"{(value - true[name]) / size:.2f}" if name in true and size > 0 else "-"] if true else []
        rows.append(
            [
                name,
                table.units[index],
                *truth,
                number_text(table.start[index]),
                number_text(value, size),
                error,
                *([f"{spread[index]:.2g}" if spread[index] == spread[index] else "-"] if spread else []),
                *off,
            ]
        )
    return aligned(rows, n_left=2)


def essential_lines(found: EssentialParameters) -> list[str]:
    """Return essential parameters as aligned text, and in what order the others were left out."""
    rows = [["essential parameter", "unit", "estimate", "std error"]]
    numbers = zip(found.estimate.tolist(), found.standard_error.tolist(), strict=True)
    for name, unit, (value, error) in zip(found.names, found.units, numbers, strict=True):
        rows.append([name, unit, number_text(value), number_text(error)])
    lines = aligned(rows, n_left=2)
    if not found.removed:
        return lines
    rows = [["left out", "std error / size", "residual grows by", "chance"]]
    columns = found.relative_error.tolist(), found.increase.tolist(), found.probability.tolist()
    for name, relative, increase, chance in zip(found.removed, *columns, strict=True):
        rows.append([name, f"{relative:.3g}", f"{100 * increase:.2g} %", f"{chance:.2g}"])
    return [*lines, "", *aligned(rows, n_left=1)]


def misfit_lines(table: MisfitTable) -> list[str]:
    """Return where a model misfits as aligned text: a row for each axis, in each band lines | other bins."""
    rows = [["misfit: lines | other bins", *table.band_names]]
    for name, lines, other in zip(table.axis_names, table.lines.tolist(), table.other.tolist(), strict=True):
        pairs = zip(lines, other, strict=True)
        rows.append([name, *(" | ".join(f"{x:.3g}" if x == x else "-" for x in pair) for pair in pairs)])
    return aligned(rows, n_left=1)


def aligned(rows: list[list[str]], n_left: int) -> list[str]:
    """Return rows with their columns under one another, the first few to the left and the others to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        "  ".join(
            cell.ljust(width) if column < n_left else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def number_text(value: float, error: float = math.nan) -> str:
    """Return a number with four digits, or with as many as show its standard error: two of that."""
    from robid_core.artifacts import significant_digits

    if value != value:
        return "held"  # it was not estimated
    return f"{value:.{significant_digits(error, value)}g}"


def _width() -> int | None:
    """Return how wide the terminal is; None where stdout is none, and a file or a pipe takes lines of any length."""
    return max(shutil.get_terminal_size().columns, 60) if sys.stdout.isatty() else None


def first_line(text: str) -> str:
    """Return the first line of a text, no wider than the terminal."""
    first, most = text.partition("\n")[0], _width()
    return first if most is None or len(first) <= most else first[: most - 3] + "..."
