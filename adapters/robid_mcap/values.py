"""Numbers within messages, by dotted names: single ones, and arrays, which are tables where they are equally long.

As in bags of ROS: an array of numbers keeps its name, records in an array are told apart by their number
(`joints.0.torque`), and what is longer than a signal has values (images, clouds) is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from google.protobuf.message import Message  # type: ignore[import-untyped]

from robid_core import FloatArray

MOST_VALUES = 64  # of one array in a message: images and clouds are no signals
ONLY_TIME = ".log_time_s"  # ends the name of what every channel has
Value = float | FloatArray


def of_json(value: Any, name: str) -> Iterator[tuple[str, Value]]:
    """Yield the numbers within a decoded JSON value; null within an array is NaN."""
    if isinstance(value, bool | int | float):
        yield name, float(value)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from of_json(inner, f"{name}.{key}")
    elif isinstance(value, list) and 0 < len(value) <= MOST_VALUES:
        if all(entry is None or isinstance(entry, bool | int | float) for entry in value):
            yield name, np.array(value, dtype=np.float64)
        else:
            for index, entry in enumerate(value):
                yield from of_json(entry, f"{name}.{index}")


def of_protobuf(message: Any, name: str) -> Iterator[tuple[str, Value]]:
    """Yield the numbers within a protobuf message; an array without values is as absent as protobuf has it."""
    for field in message.DESCRIPTOR.fields:
        value, inner = getattr(message, field.name), f"{name}.{field.name}"
        if isinstance(value, Message):
            if message.HasField(field.name):
                yield from of_protobuf(value, inner)
        elif isinstance(value, bool | int | float):
            yield inner, float(value)
        elif isinstance(value, str | bytes | Mapping) or not isinstance(value, Sequence):
            continue
        elif 0 < len(value) <= MOST_VALUES:
            if all(isinstance(entry, bool | int | float) for entry in value):
                yield inner, np.array(value, dtype=np.float64)
            else:
                for index, entry in enumerate(value):
                    if isinstance(entry, Message):
                        yield from of_protobuf(entry, f"{inner}.{index}")


def stacked(found: Mapping[str, list[Value]], problems: list[str]) -> dict[str, FloatArray]:
    """Return values of messages as columns, (n_message,) or (n_message, n_value).

    Arrays whose length changes are left out, which is appended to `problems`, and so is the time of a channel of which
    nothing else is left.
    """
    columns: dict[str, FloatArray] = {}
    for name, values in found.items():
        shapes = sorted({np.shape(value) for value in values})
        if len(shapes) > 1:
            lengths = ", ".join(str(shape[0]) if shape else "one" for shape in shapes)
            problems.append(f"{name}: the length of this array changes ({lengths} values), left out")
            continue
        columns[name] = np.array(values, dtype=np.float64)
    topics = {name.removesuffix(ONLY_TIME) for name in columns if name.endswith(ONLY_TIME)}
    for topic in topics:
        if not any(name.startswith(f"{topic}.") and name != topic + ONLY_TIME for name in columns):
            del columns[topic + ONLY_TIME]
    return columns
