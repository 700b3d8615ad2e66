"""What frequency responses say of the stiffnesses that a diagnosis found by torques, side by side."""

from __future__ import annotations

from typing import Any

from robid_core import Diagnosis
from robid_report.numbers import percent, significant


def witness_table(diagnosis: Diagnosis | None) -> dict[str, Any] | None:
    """Return stages, limit and rows as text; None where there is no witness, which the verdict says."""
    witness = diagnosis.witness if diagnosis is not None else None
    if witness is None or witness.reason:
        return None
    rows = [
        {
            "name": name,
            "unit": unit,
            "by_torques": f"{significant(torques)} ± {significant(torques_error, 2)}",
            "by_responses": f"{significant(responses)} ± {significant(responses_error, 2)}",
            "difference": percent(responses / torques - 1, signed=True),
            "apart": f"{z:+.1f}".replace("-", "−"),
            "agree": agree,
        }
        for name, unit, torques, torques_error, responses, responses_error, z, agree in zip(
            witness.names,
            witness.units,
            witness.by_torques.tolist(),
            witness.torques_error.tolist(),
            witness.by_responses.tolist(),
            witness.responses_error.tolist(),
            witness.z.tolist(),
            witness.agree.tolist(),
            strict=True,
        )
    ]
    return {
        "method": witness.method,
        "misfit": significant(witness.misfit, 3),
        "limit": significant(witness.limit, 2),
        "rows": rows,
    }
