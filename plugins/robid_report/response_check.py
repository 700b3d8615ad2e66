"""What frequency responses say of the stiffnesses that a diagnosis found by torques, side by side."""

from __future__ import annotations

from typing import Any

from robid_core import Diagnosis
from robid_report.numbers import percent, significant, with_error


def response_check_table(diagnosis: Diagnosis | None) -> dict[str, Any] | None:
    """Return stages, limit and rows as text; None where there is no check, which the verdict says."""
    response_check = diagnosis.response_check if diagnosis is not None else None
    if response_check is None or response_check.reason:
        return None
    rows = [
        {
            "name": name,
            "unit": unit,
            "by_torques": with_error(torques, torques_error),
            "by_responses": with_error(responses, responses_error),
            "difference": percent(responses / torques - 1, signed=True),
            "apart": f"{z:+.1f}".replace("-", "−"),
            "agree": agree,
        }
        for name, unit, torques, torques_error, responses, responses_error, z, agree in zip(
            response_check.names,
            response_check.units,
            response_check.by_torques.tolist(),
            response_check.torques_error.tolist(),
            response_check.by_responses.tolist(),
            response_check.responses_error.tolist(),
            response_check.z.tolist(),
            response_check.agree.tolist(),
            strict=True,
        )
    ]
    return {
        "method": response_check.method,
        "misfit": significant(response_check.misfit, 3),
        "limit": significant(response_check.limit, 2),
        "rows": rows,
    }
