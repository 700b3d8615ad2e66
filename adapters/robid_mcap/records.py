"""MCAP as a format of records: raw logs made here, and logs of others.

`read_record` gives the record that the acquisition made, bit for bit; of a cut file what is left of it, the
rest marked as not measured. `read` gives every plain number of every channel, of foreign files too.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from google.protobuf.message import DecodeError  # type: ignore[import-untyped]
from mcap.records import Channel, Schema

from robid_core import (
    DataRejected,
    ExperimentIndex,
    FloatArray,
    Record,
    RecordPlan,
    StoreError,
    Trace,
    assemble_record,
)
from robid_mcap.arrays import Packed, unpack
from robid_mcap.reader import Log
from robid_mcap.schema import message_class, message_class_of
from robid_mcap.values import Value, of_json, of_protobuf, stacked
from robid_mcap.writer import PLAN, McapLog

_log = logging.getLogger("robid.mcap")
Decoder = Callable[[bytes], Iterator[tuple[str, Value]]]


class McapRecords:
    """Reader of MCAP logs, registered as `mcap` in the group `robid.records`."""

    @staticmethod
    def create(path: Path) -> McapLog:
        """Begin a raw log."""
        return McapLog(path)

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return lines for people: channels with messages and span, attachments, and what is wrong."""
        log = _open(path)
        lines = []
        for number, channel in sorted(log.channels.items(), key=lambda item: item[1].topic):
            schema = log.schemas.get(channel.schema_id)
            first, last = log.span_ns.get(number, (0, 0))
            lines.append(
                f"{channel.topic}: {log.counts.get(number, 0)} messages, {first * 1e-9:.3f} s to {last * 1e-9:.3f} s "
                f"({schema.name if schema else 'no schema'}, {channel.message_encoding or 'no encoding'})"
            )
        lines += [f"attachment {a.name}: {len(a.data)} bytes, {a.media_type}" for a in log.attachments]
        if PLAN not in log.metadata:  # of others: what of their messages is left out
            _columns(log)
        return lines + list(dict.fromkeys(log.problems))

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return plain numbers by channel: `/axis_1.position_rad`, and `/axis_1.log_time_s` for when.

        Arrays that are equally long in all messages are tables (n_message, n_value), whose columns are `/joints.q[0]`
        and so on in a channel map. Raises DataRejected where nothing can be decoded; what is missing is logged.
        """
        log = _open(path)
        found = _columns(log)
        _tell(path, log.problems)
        if not found:
            why = f"; {log.problems[-1]}" if log.problems else ""
            raise DataRejected(f"{path}: no channel has numbers that can be decoded (protobuf or JSON){why}")
        return found

    @staticmethod
    def read_record(path: Path) -> Record:
        """Return the record that the acquisition made of these traces.

        Raises DataRejected where the file does not hold the plan of one; what is missing is logged.
        """
        log = _open(path)
        if PLAN not in log.metadata:
            raise DataRejected(
                f"A01: {path}: the plan of a record is not in the file: no raw log of an acquisition, or cut too early"
            )
        plan = _plan(path, log.metadata[PLAN])
        traces = Slices(plan)
        for _, schema, message in log.messages():
            name = schema.name if schema is not None else ""
            if name in ("robid.Trace", "robid.Reference"):
                try:
                    traces.take(name, message_class(name).FromString(message.data))
                except (DecodeError, ValueError, IndexError) as error:
                    log.problems.append(
                        f"A02: a slice of a trace at {message.log_time * 1e-9:.3f} s: {error}"
                    )
        record = assemble_record(plan, traces.complete())
        valid = record.run.valid
        if not valid.all():
            log.problems.append(f"A01: recovered {int(valid.sum())} of {valid.size} samples of each axis")
        _tell(path, log.problems)
        return record


def _open(path: Path) -> Log:
    try:
        return Log(path)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read ({error.strerror or error})") from error


def _columns(log: Log) -> dict[str, FloatArray]:
    """Return what the messages hold by channel and field; what cannot be decoded becomes a problem of the log."""
    decoders = {number: _decoder(channel, log) for number, channel in log.channels.items()}
    found: dict[str, list[Value]] = {}
    for channel, _, message in log.messages():
        try:
            numbers = list(decoders[channel.id](message.data))
        except (DecodeError, ValueError, TypeError) as error:
            log.problems.append(f"{channel.topic}: a message cannot be decoded ({error})")
            continue
        if numbers:
            found.setdefault(f"{channel.topic}.log_time_s", []).append(message.log_time * 1e-9)
        for name, value in numbers:
            found.setdefault(f"{channel.topic}{name}", []).append(value)
    return stacked(found, log.problems)


def _tell(path: Path, problems: list[str]) -> None:
    for problem in dict.fromkeys(problems):
        _log.warning("%s: %s", path, problem)


def _plan(path: Path, metadata: dict[str, str]) -> RecordPlan:
    """Return the plan of a log; DataRejected where it is not the one that was written (older logs have no hash)."""
    try:
        text = metadata["json"]
        if metadata.get("sha256", digest := hashlib.sha256(text.encode()).hexdigest()) != digest:
            raise ValueError("it does not fit its hash")
        content = json.loads(text)
        content["axis_names"] = tuple(content["axis_names"])
        content["angle"] = np.array(content["angle"], dtype=float).reshape(-1, len(content["axis_names"]))
        content["line"] = np.array(content["line"], dtype=np.int64)
        return RecordPlan(**content)
    except (KeyError, TypeError, ValueError) as error:
        raise DataRejected(
            f"A02: {path}: the plan of the record is damaged ({error}): what was measured cannot be put in its place; "
            "bring the file back from a copy"
        ) from error


class Slices:
    """Traces under construction from slices of their rows."""

    def __init__(self, plan: RecordPlan) -> None:
        self._n_axis = len(plan.axis_names)
        self._shape = (plan.n_period, plan.n_sample, self._n_axis)
        self._limits = (len(plan.angle), plan.n_block, plan.n_exp)
        self._traces: dict[ExperimentIndex, Trace] = {}

    def take(self, name: str, slice_: Any) -> None:
        """Enter a slice; raises ValueError where it does not fit the plan."""
        place = (slice_.configuration, slice_.block, slice_.experiment)
        if any(number >= limit for number, limit in zip(place, self._limits, strict=True)):
            raise ValueError(f"experiment {place} is not in the plan")
        trace = self._traces.setdefault(place, self._empty())
        if name == "robid.Reference":
            self._enter(
                trace.reference, slice_, slice_.reference_type, slice_.reference, slice_.reference_unit
            )
            return
        rows = slice(slice_.first_row, slice_.first_row + slice_.n_row)
        for values, kind, content, unit in (
            (trace.position, slice_.position_type, slice_.position, slice_.position_unit),
            (trace.torque, slice_.torque_type, slice_.torque, slice_.torque_unit),
        ):
            self._enter(values.reshape(-1, self._n_axis), slice_, kind, content, unit)
        trace.valid.reshape(-1)[rows] = np.frombuffer(slice_.valid, dtype=bool)

    def _enter(self, values: FloatArray, slice_: Any, kind: str, content: bytes, unit: Any) -> None:
        part = unpack(Packed(kind, content, tuple(unit)), self._n_axis)
        rows = slice(slice_.first_row, slice_.first_row + slice_.n_row)
        if len(part) != slice_.n_row or rows.stop > len(values):
            raise ValueError(f"{len(part)} rows from {rows.start} on do not fit {len(values)} rows")
        values[rows] = part

    def _empty(self) -> Trace:
        nan = np.full(self._shape, np.nan)
        valid: npt.NDArray[np.bool_] = np.zeros(self._shape[:2], dtype=bool)
        return Trace(nan, nan.copy(), valid, np.full(self._n_axis, np.nan), nan[0].copy(), 0.0)

    def complete(self) -> dict[ExperimentIndex, Trace]:
        """Return the traces as far as they came; a sample whose reference is not known is not valid."""
        for trace in self._traces.values():
            trace.valid[:] &= np.isfinite(trace.reference).all(axis=1)
        return self._traces


def _decoder(channel: Channel, log: Log) -> Decoder:
    """Return what turns a message of a channel into numbers; nothing for encodings that are not known."""
    schema = log.schemas.get(channel.schema_id)
    if channel.message_encoding == "json":
        return lambda data: of_json(json.loads(data), "")
    if channel.message_encoding == "protobuf" and isinstance(schema, Schema):
        try:
            cls = message_class_of(schema.data, schema.name)
        except (DecodeError, ValueError, TypeError) as error:
            log.problems.append(f"{channel.topic}: its schema cannot be used ({error})")
            return lambda data: iter(())
        return lambda data: of_protobuf(cls.FromString(data), "")
    other = "; --format rosbag, or format: rosbag, reads it" if channel.message_encoding == "cdr" else ""
    log.problems.append(f"{channel.topic}: encoding '{channel.message_encoding}' is not decoded{other}")
    return lambda data: iter(())
