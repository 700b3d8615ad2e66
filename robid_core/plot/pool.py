"""Many figures as one value: what stands in several of them is written once."""

from __future__ import annotations

import json
from typing import Any

REFERENCE = "$"  # {"$": 3} stands for entry 3 of the pool
SHORT = 24  # characters of JSON; what is shorter is written where it stands


def pooled(value: Any) -> dict[str, Any]:
    """Return `{"pool": [...], "value": ...}`, in which lists of numbers, texts and settings are referred to.

    A reference is `{"$": number}`; an entry of the pool may have references to earlier ones. Mappings whose key is `$`
    must not occur.
    """
    pool: list[Any] = []
    known: dict[str, int] = {}

    def entered(one: Any) -> Any:
        if isinstance(one, dict):
            one = {key: entered(entry) for key, entry in one.items()}
        elif isinstance(one, list) and any(isinstance(entry, dict | list) for entry in one):
            return [entered(entry) for entry in one]
        text = json.dumps(one)
        if len(text) < SHORT:
            return one
        if text not in known:
            known[text] = len(pool)
            pool.append(one)
        return {REFERENCE: known[text]}

    return {"value": entered(value), "pool": pool}
