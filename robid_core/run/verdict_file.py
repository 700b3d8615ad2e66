"""The verdict of a diagnosis as JSON, for programs: `verdict.<stage>.json` in the folder of a run.

Fields: `verdict` (sentences), `robot` (name and hash of the nominal one), `data` (experiments in how many
configurations, those kept apart and left out, variants, bins, source of the noise), `findings` (kind, effect, axis,
side, parameters with nominal value, estimate, standard error, 95 % interval and unit, gain of twice the log-likelihood,
p-value after the search, share of the gain of free functions, ties, the experiment that separates them with the
expected log-likelihood ratio for each rival, gain in each configuration, where held out, and by a size of its own),
`values` (all that was estimated, with its tolerance in the robot file), `response_check` (stiffnesses by responses
and by torques, their difference in standard errors and whether they agree within the limit, or the reason why there
is none), `timing` (by how many samples the torque of each axis lags), `errors` (torque that each model leaves, and as
`of_noise` what noise alone would; where references were recorded, speed in closed loop), `left` (misfit of each axis
in each band, on the excited lines and in the bins between), `residuals` (which part of what the refitted robot
leaves, squared, functions of speed, angle, load and acceleration would do, odd and even ones), `searched` (how many,
which, excluded, failed, smallest sizes that would have been found).
Numbers that do not exist are null.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import (
    DiagnosedData,
    Diagnosis,
    Finding,
    MisfitTable,
    ResponseCheck,
    SeparatingExperiment,
    Timing,
)

VERSION = 2
SURE = 1.96  # standard errors to either side


def verdict_json(diagnosis: Diagnosis, robot: str, sha256: str) -> str:
    """Return the text of the file."""
    values, search = diagnosis.values, diagnosis.search
    told: dict[str, Any] = {
        "robid_verdict": VERSION,
        "robot": {"name": robot, "sha256": sha256},
        "method": diagnosis.method,
        "verdict": diagnosis.verdict.split("\n"),
        "data": None if diagnosis.data is None else _data(diagnosis.data),
        "findings": [_finding(one) for one in diagnosis.findings],
        "values": []
        if values is None
        else [
            _value(*row) | {"tolerance": _number(tolerance)}
            for *row, tolerance in zip(
                values.names,
                values.units,
                values.start,
                values.estimate,
                values.standard_error,
                np.full(len(values.names), np.nan) if values.prior is None else values.prior,
                strict=True,
            )
        ],
        "response_check": None
        if diagnosis.response_check is None
        else _response_check(diagnosis.response_check),
        "timing": None if diagnosis.timing is None else _timing(diagnosis.timing),
        "errors": [
            {
                "model": one.model,
                "quantity": one.quantity,
                "unit": one.unit_symbol,
                "axes": {
                    axis: {
                        "rms": rms,
                        "relative": _number(share),
                        "interval": [_number(low), _number(high)],
                        "of_noise": _number(noise),
                    }
                    for axis, rms, share, low, high, noise in zip(
                        one.axis_names,
                        one.rms.tolist(),
                        one.relative,
                        one.low,
                        one.high,
                        np.full(len(one.rms), np.nan) if one.noise is None else one.noise,
                        strict=True,
                    )
                },
            }
            for one in diagnosis.errors
        ],
        "left": None if diagnosis.left is None else _left(diagnosis.left),
        "residuals": [
            {
                "axis": one.axis,
                "variable": one.variable,
                "share": _number(one.share),
                "odd": _number(one.odd),
                "even": _number(one.even),
            }
            for one in diagnosis.residuals
            if math.isfinite(one.share)
        ],
        "searched": None
        if search is None
        else {
            "tried": search.n_tried,
            "independent_trials": search.trials,
            "effects": list(search.effects),
            "excluded": list(search.excluded),
            "failed": list(search.failed),
            "visible": [
                {
                    "effect": one.effect,
                    "on": one.on,
                    "side": one.side or None,
                    "parameter": one.parameter,
                    "size": _number(one.size),
                    "unit": one.unit_symbol,
                }
                for one in search.visible
            ],
        },
    }
    return json.dumps(told, indent=1, allow_nan=False) + "\n"


def _data(data: DiagnosedData) -> dict[str, Any]:
    return {
        "configurations": data.n_config,
        "experiments": data.n_experiment,
        "kept_apart": data.n_test,
        "left_out": data.n_left_out,
        "variants": list(data.variants),
        "highest_hz": data.highest_hz,
        "noise": list(data.noise),
    }


def _finding(finding: Finding) -> dict[str, Any]:
    rows = zip(
        finding.names, finding.units, finding.nominal, finding.value, finding.standard_error, strict=True
    )
    return {
        "kind": finding.kind,
        "effect": finding.effect,
        "on": finding.on,
        "side": finding.side or None,
        "parameters": [_value(*row) for row in rows],
        "gain": finding.gain,
        "p_value": finding.p_value,
        "share_of_ceiling": _number(finding.share),
        "ties": list(finding.ties),
        "separation": None if finding.separation is None else _separation(finding.separation),
        "by_configuration": _numbers(finding.by_configuration),
        "held_out": _numbers(finding.held_out),
        "by_own_size": _numbers(finding.by_own_size),
    }


def _separation(best: SeparatingExperiment) -> dict[str, Any]:
    return {
        "sentence": best.sentence,
        "configuration": best.configuration.tolist(),
        "difference": best.difference,
        "amplitude": best.amplitude,
        "duration_s": best.duration_s,
        "rivals": [
            {"rival": name, "expected": ratio, "repeat": _number(repeat), "separated": bool(tells)}
            for name, ratio, repeat, tells in zip(
                best.rivals, best.ratio.tolist(), best.repeat, best.tells, strict=True
            )
        ],
    }


def _response_check(response_check: ResponseCheck) -> dict[str, Any]:
    rows = zip(
        response_check.names,
        response_check.units,
        zip(response_check.by_responses.tolist(), response_check.responses_error.tolist(), strict=True),
        zip(response_check.by_torques.tolist(), response_check.torques_error.tolist(), strict=True),
        response_check.z.tolist(),
        response_check.agree.tolist(),
        strict=True,
    )
    return {
        "method": response_check.method or None,
        "reason": response_check.reason or None,
        "misfit": _number(response_check.misfit),
        "limit": _number(response_check.limit),
        "stiffnesses": [
            {
                "name": name,
                "unit": unit,
                "by_responses": {"estimate": responses[0], "standard_error": responses[1]},
                "by_torques": {"estimate": torques[0], "standard_error": torques[1]},
                "z": z,
                "agree": agree,
            }
            for name, unit, responses, torques, z, agree in rows
        ],
    }


def _timing(timing: Timing) -> dict[str, Any]:
    rows = zip(timing.axis_names, timing.lag, timing.standard_error, strict=True)
    return {
        "sample_time_s": timing.sample_time_s,
        "lag": [_value(axis, "sample", 0.0, float(lag), float(error)) for axis, lag, error in rows],
    }


def _left(table: MisfitTable) -> dict[str, Any]:
    return {
        "band_edges_hz": table.band_edges_hz.tolist(),
        "axes": {
            axis: {"lines": _numbers(table.lines[i]), "other_bins": _numbers(table.other[i])}
            for i, axis in enumerate(table.axis_names)
        },
    }


def _value(name: str, unit: str, nominal: float, value: float, error: float) -> dict[str, Any]:
    interval = [_number(value - SURE * error), _number(value + SURE * error)]
    return {
        "name": name,
        "unit": unit,
        "nominal": _number(nominal),
        "estimate": _number(value),
        "standard_error": _number(error),
        "interval": interval,
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _numbers(values: FloatArray) -> list[float | None]:
    return [_number(value) for value in values.tolist()]
