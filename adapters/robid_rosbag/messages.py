"""Messages of one topic as columns: joint states by the names of their joints, other messages by their fields."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from robid_core import DataRejected, FloatArray

MOST_VALUES = 64  # of one array in a message: images and clouds are no signals
JOINT_STATE = "sensor_msgs/msg/JointState"
OF_JOINTS = ("position", "velocity", "effort")


class Topic:
    """Columns of one topic under construction, message by message."""

    def __init__(self, name: str, kind: str) -> None:
        self.name, self.kind = name, kind
        self.remarks: list[str] = []
        self._log_time_s: list[float] = []
        self._stamp_s: list[float | None] = []
        self._values: dict[str, dict[int, Any]] = {}

    @property
    def n_message(self) -> int:
        """Messages so far."""
        return len(self._log_time_s)

    def take(self, message: Any, log_time_ns: int) -> None:
        """Enter a message; DataRejected where a joint state does not fit its own names."""
        row = self.n_message
        self._log_time_s.append(log_time_ns * 1e-9)
        header = getattr(message, "header", None)
        self._stamp_s.append(_stamp(header) if header is not None else None)
        numbers = self._joints(message) if self.kind == JOINT_STATE else _numbers(message, "")
        for name, value in numbers:
            self._values.setdefault(name, {})[row] = value

    def _joints(self, message: Any) -> Iterator[tuple[str, float]]:
        for quantity in OF_JOINTS:
            values = getattr(message, quantity)
            if len(values) not in (0, len(message.name)):
                raise DataRejected(
                    f"{self.name}: message {self.n_message} has {len(message.name)} names and {len(values)} values of "
                    f"{quantity}; cut the bag around it"
                )
            for joint, value in zip(message.name, values, strict=False):
                yield f"{quantity}[{joint}]", float(value)

    def columns(self) -> dict[str, FloatArray]:
        """Return the columns by name, each of the length of its own time column.

        `topic.time_s` is the stamp in the headers, or the time of recording where messages have none. Where joints
        come in different messages, each joint has a time of its own, `topic.time_s[joint]`.
        """
        n = self.n_message
        log_time = np.array(self._log_time_s)
        stamped = None not in self._stamp_s and any(self._stamp_s)  # simulated time begins at 0
        time = np.array(self._stamp_s, dtype=np.float64) if stamped else log_time
        if not stamped and any(stamp is not None for stamp in self._stamp_s):
            self.remarks.append(f"{self.name}: headers have no stamps; times are those of recording")
        found: dict[str, FloatArray] = {f"{self.name}.time_s": time}
        if stamped:
            found[f"{self.name}.log_time_s"] = log_time
        for field, by_row in self._values.items():
            rows = list(by_row)
            shapes = {np.shape(value) for value in by_row.values()}
            if len(shapes) > 1:
                self.remarks.append(f"{self.name}.{field}: arrays of different lengths, left out")
                continue
            values = np.array(list(by_row.values()), dtype=np.float64)
            if len(rows) < n:
                joint = field[field.index("[") :] if "[" in field else f"[{field}]"
                found[f"{self.name}.time_s{joint}"] = time[rows]
                self.remarks.append(
                    f"{self.name}.{field}: in {len(rows)} of {n} messages, at times of its own"
                )
            found[f"{self.name}.{field}"] = values
        return found


def _stamp(header: Any) -> float:
    """Seconds of a header; 0 where nobody filled it in."""
    return float(header.stamp.sec + header.stamp.nanosec * 1e-9)


def _numbers(message: Any, prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield the numbers in the fields of a message; short arrays as they are, headers and texts not."""
    for field in fields(message):
        value = getattr(message, field.name)
        name = prefix + field.name
        if field.name == "header" or isinstance(value, str):
            continue
        if isinstance(value, bool | int | float | np.number):
            yield name, float(value)
        elif isinstance(value, np.ndarray):
            if value.dtype.kind in "fiub" and 0 < value.size <= MOST_VALUES:
                yield name, value.astype(np.float64)
        elif is_dataclass(value):
            yield from _numbers(value, name + ".")
        elif isinstance(value, Sequence) and all(is_dataclass(entry) for entry in value):
            for index, entry in enumerate(value[:MOST_VALUES]):
                yield from _numbers(entry, f"{name}.{index}.")
