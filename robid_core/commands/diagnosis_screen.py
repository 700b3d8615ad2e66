"""A diagnosis or a check as text: the whole verdict, then the tables that its page has."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

from robid_core.commands.fit_screen import aligned, misfit_lines, number_text, parameter_lines

if TYPE_CHECKING:
    from robid_core.artifacts import (
        Diagnosis,
        Finding,
        PredictionErrors,
        ResponseCheck,
        RunErrors,
        TimeComparison,
    )


def diagnosis_lines(diagnosis: Diagnosis) -> list[str]:
    """Return method and verdict, then a table for each thing that was found or measured; nothing of internals."""
    blocks = [[diagnosis.method, *(f"  {line}" for line in diagnosis.verdict.splitlines())]]
    blocks += [_numbers(diagnosis.findings)]
    blocks += [
        _errors(list(group)) for _, group in itertools.groupby(diagnosis.errors, key=lambda one: one.quantity)
    ]
    blocks += [_runs(errors) for errors in diagnosis.runs]
    blocks += [_over_time(diagnosis.time)]
    blocks += [_stiffnesses(diagnosis.response_check)] if diagnosis.response_check is not None else []
    blocks += [parameter_lines(diagnosis.values)] if diagnosis.values is not None else []
    blocks += [misfit_lines(diagnosis.left)] if diagnosis.left is not None else []
    return [line for block in blocks if block for line in ("", *block)][1:]


def _numbers(findings: tuple[Finding, ...]) -> list[str]:
    """Return a row for each number of each finding; nothing where none has any."""
    rows = [
        [one.kind, one.effect, one.where, name, unit if unit != "1" else "", *_three(values)]
        for one in findings
        for name, unit, *values in zip(
            one.names,
            one.units,
            one.nominal.tolist(),
            one.value.tolist(),
            one.standard_error.tolist(),
            strict=True,
        )
    ]
    head = ["finding", "effect", "where", "parameter", "unit", "robot file", "estimate", "std error"]
    return aligned([head, *rows], n_left=5) if rows else []


def _three(values: list[float]) -> list[str]:
    nominal, value, error = values
    sure = f"{error:.2g}" if math.isfinite(error) else "not determined"
    return [number_text(nominal) if math.isfinite(nominal) else "-", number_text(value, error), sure]


def _errors(models: list[PredictionErrors]) -> list[str]:
    """Return a row for each axis: what each model leaves, in units and as a share of what was measured."""
    first, noise = models[0], models[-1].noise
    rows = [["axis", *(part for one in models for part in (one.model, "share", "95 % interval"))]]
    rows[0] += ["noise alone"] if noise is not None else []
    for axis, name in enumerate(first.axis_names):
        row = [f"{name} (hardly moved)" if first.still[axis] else name]
        for one in models:
            row += [f"{one.rms[axis]:.3g} {one.unit_symbol}", _share(one.relative[axis])]
            known = math.isfinite(one.low[axis] + one.high[axis])
            row.append(f"{100 * one.low[axis]:.3g} to {100 * one.high[axis]:.3g} %" if known else "-")
        rows.append([*row, *([_share(noise[axis])] if noise is not None else [])])
    return [f"{first.quantity}:", *aligned(rows, n_left=1)]


def _runs(errors: RunErrors) -> list[str]:
    """Return a row for each run: whether it was predicted, and what the model leaves of each axis."""
    rows = [["run", "role", *(part for axis in errors.axis_names for part in (axis, "share"))]]
    for run, name in enumerate(errors.runs):
        cells = zip(errors.rms[run].tolist(), errors.relative[run].tolist(), strict=True)
        told = [part for rms, share in cells for part in (f"{rms:.3g} {errors.unit_symbol}", _share(share))]
        rows.append([name, "predicted" if errors.tested[run] else "of the fit", *told])
    return [f"{errors.quantity}, run by run ({errors.model}):", *aligned(rows, n_left=2)]


def _over_time(compared: tuple[TimeComparison, ...]) -> list[str]:
    rows = [[one.channel, f"{len(one.time_s)} samples", _share(one.relative_error)] for one in compared]
    return (
        aligned([["measured against simulated", "length", "relative error"], *rows], n_left=1) if rows else []
    )


def _stiffnesses(check: ResponseCheck) -> list[str]:
    """Return a row for each stiffness by responses and by torques; why there is none, the verdict says."""
    if check.reason:
        return []
    rows = [["stiffness", "unit", "by torques", "by responses", "in std errors", ""]]
    columns = (check.by_torques, check.torques_error, check.by_responses, check.responses_error, check.z)
    values = zip(*(column.tolist() for column in columns), check.agree.tolist(), strict=True)
    for name, unit, (own, own_error, other, other_error, apart, agree) in zip(
        check.names, check.units, values, strict=True
    ):
        numbers = [number_text(own, own_error), number_text(other, other_error), f"{apart:.2f}"]
        rows.append([name, unit, *numbers, "agree" if agree else "disagree"])
    return aligned(rows, n_left=2)


def _share(value: float) -> str:
    return f"{100 * value:.3g} %" if math.isfinite(value) else "-"
