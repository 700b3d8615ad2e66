"""Values of the robot file that a diagnosis fitted: robot file, estimate, standard error, tolerance."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core import Diagnosis, is_by_tolerance, is_determined
from robid_report.numbers import percent, significant, to_error

SURE = 5.0  # standard errors from the robot file: what has moved
OPEN = ("stiffness", "effect")  # groups that stand on the page; the others are folded


def refitted_table(diagnosis: Diagnosis | None) -> dict[str, list[Any]] | None:
    """Return rows that are shown and rows that are folded; None where no values were fitted.

    A row is name, unit, robot file, estimate, standard error, change, tolerance, whether the data determine the value
    rather than its tolerance, and whether it has moved from the robot file by more than five standard errors. Effects
    that were found have no value in the robot file.
    """
    table = diagnosis.values if diagnosis is not None else None
    if diagnosis is None or table is None or not table.names:
        return None
    added = tuple(f"effect.{one.effect.partition('.')[2]}_{one.on}" for one in diagnosis.findings)
    tolerances = table.prior if table.prior is not None else np.full(len(table.names), np.inf)
    found: dict[str, list[Any]] = {"shown": [], "folded": []}
    for name, unit, group, start, estimate, error, tolerance in zip(
        table.names,
        table.units,
        table.groups,
        table.start.tolist(),
        table.estimate.tolist(),
        table.standard_error.tolist(),
        tolerances.tolist(),
        strict=True,
    ):
        in_file = not name.startswith(added)
        limited = group == "inertia" and np.isfinite(tolerance)
        by_data = is_determined(error, estimate) and not (limited and is_by_tolerance(error, tolerance))
        row = (
            name,
            "" if unit == "1" else unit,
            significant(start) if in_file else "–",
            to_error(estimate, error),
            significant(error, 2) if np.isfinite(error) else "–",
            percent(estimate / start - 1, signed=True) if start and in_file else "–",
            significant(tolerance, 2) if limited else "–",
            by_data,
            bool(by_data and (abs(estimate - start) > SURE * error or not in_file)),
        )
        found["shown" if group in OPEN else "folded"].append(row)
    return found
