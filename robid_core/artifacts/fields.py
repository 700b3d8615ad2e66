"""An artifact's fields as text: arrays with axes, unit and range, nested artifacts below their name."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from robid_core.artifacts.artifact import Artifact

LONGEST_TEXT = 60
MOST_NAMES = 8


def field_lines(artifact: Artifact, indent: str = "  ") -> list[str]:
    """Return every field, a line each."""
    lines = []
    for item in dataclasses.fields(artifact):
        value = getattr(artifact, item.name)
        if "axes" in item.metadata:
            lines.append(f"{indent}{item.name}: {_array_text(value, item.metadata)}")
            continue
        nested: dict[str, Any] = {}
        if isinstance(value, Artifact):
            nested = {item.name: value}
        elif isinstance(value, dict):
            nested = {f"{item.name}[{key}]": entry for key, entry in value.items()}
        elif isinstance(value, tuple) and value and isinstance(value[0], Artifact):
            nested = {f"{item.name}[{index}]": entry for index, entry in enumerate(value)}
        if not nested:
            lines.append(f"{indent}{item.name}: {_plain_text(value)}")
        for name, entry in nested.items():
            lines += [f"{indent}{name}: {type(entry).__name__}", *field_lines(entry, indent + "  ")]
    return lines


def _array_text(value: Any, metadata: Any) -> str:
    if value is None:
        return "absent"
    axes = " x ".join(f"{length} {name}" for name, length in zip(metadata["axes"], value.shape, strict=True))
    unit = f" {metadata['unit']}" if metadata["unit"] else ""
    if value.size == 0:
        return f"{axes}, empty"
    if value.dtype == bool:
        return f"{axes}, {int(value.sum())} of {value.size} true"
    size = np.abs(value) if np.iscomplexobj(value) else value
    finite = size[np.isfinite(size)]
    missing = f", {size.size - finite.size} without a value" if finite.size < size.size else ""
    if not finite.size:
        return f"{axes}{missing}"
    what = "size " if np.iscomplexobj(value) else ""
    return f"{axes}, {what}{finite.min():.4g} to {finite.max():.4g}{unit}{missing}"


def _plain_text(value: Any) -> str:
    if isinstance(value, tuple):
        shown = ", ".join(str(entry) for entry in value[:MOST_NAMES])
        return (shown or "none") + (f", ... ({len(value)})" if len(value) > MOST_NAMES else "")
    if isinstance(value, float):
        return f"{value:.6g}"
    text = "absent" if value is None else " ".join(str(value).split())
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 3] + "..."
