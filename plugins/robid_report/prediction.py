"""How far models are from a record: axis by axis and run by run as rows of text, and what is left as pictures."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from robid_core import Diagnosis, FloatArray, PredictionCurve, PredictionErrors, RunErrors
from robid_report.chart import chart
from robid_report.numbers import percent, significant

ROLES = ("trained", "tested")
SIZES = ("time in the run, s", "order, waves in a turn of the motor")  # variables over which sizes are drawn


def error_sections(diagnosis: Diagnosis | None) -> list[dict[str, Any]]:
    """Return for each quantity its models and a row for each axis; a cell is (error in its unit, share, interval).

    And the share that noise alone would leave, for each axis, where it is known.
    """
    errors = diagnosis.errors if diagnosis is not None else ()
    sections = []
    for quantity, group in itertools.groupby(errors, key=lambda one: one.quantity):
        models = list(group)
        limited = any(_over_limit(one) is not None for one in models)
        rows = [
            (axis, bool(models[0].still[a]), [_cell(one, a, limited) for one in models])
            for a, axis in enumerate(models[0].axis_names)
        ]
        names, floor = [one.model for one in models], models[-1].noise
        noise = None if floor is None else [percent(float(share)) for share in floor]
        drawn = any(np.isfinite(one.low + one.high).any() for one in models)
        sections.append(
            {
                "quantity": quantity,
                "models": names,
                "rows": rows,
                "limited": limited,
                "drawn": drawn,
                "noise": noise,
            }
        )
    return sections


def run_sections(diagnosis: Diagnosis | None) -> list[dict[str, Any]]:
    """Return for each quantity a row for each run, trained ones first: role, name, (error, share) of each axis."""
    return [_run_section(errors) for errors in (diagnosis.runs if diagnosis is not None else ())]


def _run_section(errors: RunErrors) -> dict[str, Any]:
    rows = [
        (
            ROLES[int(errors.tested[r])],
            name,
            [
                (f"{significant(rms, 3)} {errors.unit_symbol}", percent(float(share)))
                for rms, share in zip(errors.rms[r].tolist(), errors.relative[r].tolist(), strict=True)
            ],
        )
        for r, name in enumerate(errors.runs)
    ]
    return {
        "quantity": errors.quantity,
        "model": errors.model,
        "axes": errors.axis_names,
        "rows": rows,
        "both": bool(errors.tested.any() and not errors.tested.all()),
    }


def curve_sections(diagnosis: Diagnosis | None) -> list[dict[str, Any]]:
    """Return for each axis the pictures of what is left over each variable."""
    curves = diagnosis.curves if diagnosis is not None else ()
    return [
        {"axis": axis, "pictures": [_curve(one) for one in group if _is_drawn(one)]}
        for axis, group in itertools.groupby(curves, key=lambda one: one.axis)
    ]


def _is_drawn(curve: PredictionCurve) -> bool:
    return len(curve.abscissa) > 1 and any(np.isfinite(one).any() for one in (curve.trained, curve.tested))


def _curve(curve: PredictionCurve) -> Any:
    dots: dict[str, FloatArray] = {
        role: values
        for role, values in zip(ROLES, (curve.trained, curve.tested), strict=True)
        if np.isfinite(values).any()
    }
    size = " (rms)" if curve.variable == SIZES[0] else " (amplitude)" if curve.variable == SIZES[1] else ""
    return chart(
        curve.variable,
        curve.unit_symbol,
        curve.abscissa,
        dots,
        {},
        spoken=f"residual of the prediction on {curve.axis} over {curve.variable}",
        ordinate=f"residual{size}",
    )


def _over_limit(errors: PredictionErrors) -> FloatArray | None:
    known = errors.of_limit
    return None if known is None or not np.isfinite(known).any() else known


def _cell(errors: PredictionErrors, axis: int, limited: bool) -> tuple[str, ...]:
    low, high = errors.low[axis], errors.high[axis]
    between = (
        f"{significant(100 * low, 3)} to {significant(100 * high, 3)} %" if np.isfinite(low + high) else "–"
    )
    size = f"{significant(errors.rms[axis], 3)} {errors.unit_symbol}"
    known = _over_limit(errors)
    own = (percent(float(known[axis])) if known is not None else "–",) if limited else ()
    return size, percent(float(errors.relative[axis])), *own, between
