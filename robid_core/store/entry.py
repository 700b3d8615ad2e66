"""An index entry: under which key an artifact was made, out of what, and the hash of its bytes.

Entries are JSON files that carry their own hash, so that a flipped byte in one is found like a flipped byte
in the artifact.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from robid_core.errors import StoreError

STORE_FORMAT = 1


@dataclass(frozen=True)
class Entry:
    """What the store knows about one artifact; `recording` marks what was measured on hardware."""

    key: str
    stage: str
    artifact: str  # class name
    sha256: str
    suffix: str
    recording: bool
    ingredients: Mapping[str, Any]

    @property
    def blob_name(self) -> str:
        """Name of the file that holds the bytes."""
        return f"{self.sha256}{self.suffix}"


def canonical_json(value: Any) -> str:
    """Write a value so that equal content gives equal text: sorted keys, no spaces, no NaN."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=True)


def text_hash(text: str) -> str:
    """Return the sha256 of a text, in hex."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def entry_to_bytes(entry: Entry) -> bytes:
    """Write an entry with its own hash."""
    content = {"format": STORE_FORMAT, **asdict(entry)}
    return json.dumps({**content, "check": text_hash(canonical_json(content))}, indent=1).encode() + b"\n"


def entry_from_bytes(data: bytes, path: str) -> Entry | None:
    """Read an entry; None where it is damaged, StoreError where a newer robid wrote it."""
    try:
        content = json.loads(data)
        check = content.pop("check")
        if check != text_hash(canonical_json(content)):
            return None
        written = content.pop("format")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    if written > STORE_FORMAT:
        raise StoreError(
            f"{path}: written by a newer robid (store format {written}, this one reads up to {STORE_FORMAT}); "
            "update robid, or run in another folder"
        )
    try:
        return Entry(**content)
    except TypeError:
        return None
