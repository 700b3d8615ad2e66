"""The raw log of a motion, written as it happens.

Chunks of at most 64 KiB go to the file as soon as they are full, each with its CRC, so that a killed run
keeps everything up to the last one; the file is called `.part` until it is complete. Time stamps are those of
the drives, so that the same motion gives the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer

from robid_core import FloatArray, MotionAborted, RecordPlan, RobidError, StoreError, Trace
from robid_mcap.arrays import pack
from robid_mcap.schema import descriptor_set, message_class

MESSAGE_BYTES = 16_000  # most in one slice of a trace
CHUNK_BYTES = 64 * 1024 - 2 * MESSAGE_BYTES  # the writer closes a chunk after the message that fills it
PLOT_RATE_HZ = 50.0  # of the scalar channels, which are for eyes only
PLAN = "robid.plan"  # name of the metadata record that holds the plan, as JSON


class Sink:
    """A file without a buffer of ours: what is written is the operating system's at once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = path.open("wb", buffering=0)
        self._position = 0

    def write(self, data: bytes) -> int:
        """Write all of the data."""
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]
        self._position += len(data)
        return len(data)

    def tell(self) -> int:
        """Return the position behind what was written."""
        return self._position

    def flush(self) -> None:
        """Nothing is held back."""

    def close(self) -> None:
        """Bring the file to the disk and close it."""
        try:
            os.fsync(self._file.fileno())
        finally:
            self._file.close()


class McapLog:
    """A raw log (the core's `RawLog`) as an MCAP file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._part = path.with_name(path.name + ".part")
        self._closed = False
        with self._refusing(StoreError):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._sink = Sink(self._part)
            self._writer = Writer(
                self._sink,  # type: ignore[arg-type]  # the part of a stream that the writer uses
                chunk_size=CHUNK_BYTES,
                compression=CompressionType.ZSTD,
                enable_data_crcs=True,
            )
            self._writer.start(profile="", library="robid")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._axis_names: tuple[str, ...] = ()
        self._sample_time_s = 0.0

    def _full(self, error_class: type[RobidError], error: OSError) -> RobidError:
        return error_class(
            f"A14: the raw log {self._part} cannot be written ({error.strerror or error}); what it holds stays "
            "readable; make room and run again"
        )

    @contextmanager
    def _refusing(self, error_class: type[RobidError] = MotionAborted) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._full(error_class, error) from error

    def _channel(self, topic: str, message: str) -> int:
        if topic not in self._channels:
            if message not in self._schemas:
                descriptors = descriptor_set().SerializeToString()
                self._schemas[message] = self._writer.register_schema(message, "protobuf", descriptors)
            schema = self._schemas[message]
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schema)
        return self._channels[topic]

    def _add(self, topic: str, message: str, at_s: float, /, **fields: Any) -> None:
        data = message_class(message)(**fields).SerializeToString()
        time_ns = round(at_s * 1e9)
        try:  # not `_refusing`: this is called a hundred thousand times
            self._writer.add_message(self._channel(topic, message), time_ns, data, time_ns)
        except OSError as error:
            raise self._full(MotionAborted, error) from error

    def attach(self, name: str, media_type: str, content: bytes) -> None:
        """Keep a whole file."""
        with self._refusing():
            self._writer.add_attachment(0, 0, name, media_type, content)

    def plan(self, plan: RecordPlan) -> None:
        """Keep what is going to be measured; floats are written so that they read back the same."""
        self._axis_names, self._sample_time_s = plan.axis_names, plan.sample_time_s
        content = {key: value for key, value in vars(plan).items() if key not in ("angle", "line")}
        content |= {"angle": plan.angle.tolist(), "line": plan.line.tolist()}
        text = json.dumps(content, sort_keys=True)
        with self._refusing():
            self._writer.add_metadata(
                PLAN, {"json": text, "sha256": hashlib.sha256(text.encode()).hexdigest()}
            )

    def event(self, time_s: float, text: str) -> None:
        """Keep what happened."""
        self._add("/events", "robid.Event", time_s, text=text)

    def frame(self, time_s: float, identifier: int, data: bytes) -> None:
        """Keep one frame of a bus."""
        self._add("/can/frames", "robid.CanFrame", time_s, identifier=identifier, data=data)

    def bulk(self, time_s: float, note: str, n_frame: int, n_byte: int) -> None:
        """Count the frames of a bulk transfer."""
        self._add("/can/bulk", "robid.BulkTransfer", time_s, note=note, frames=n_frame, bytes=n_byte)

    def trace(self, place: tuple[int, int, int], label: str, trace: Trace) -> None:
        """Keep an experiment: its reference and its trace exactly, and scalars for plots."""
        n_period, n_sample, n_axis = trace.position.shape
        position, torque = trace.position.reshape(-1, n_axis), trace.torque.reshape(-1, n_axis)
        where = dict(zip(("configuration", "block", "experiment"), place, strict=True))
        n_row = max(MESSAGE_BYTES // (17 * n_axis), 1)  # two doubles and a byte at most
        for first in range(0, n_sample, n_row):
            self._reference(trace, slice(first, first + n_row), where)
        interval_s = self._sample_time_s
        for first in range(0, n_period * n_sample, n_row):
            rows = slice(first, first + n_row)
            q, u = pack(position[rows], trace.position_unit), pack(torque[rows], trace.torque_unit)
            self._add(
                "/trace",
                "robid.Trace",
                trace.time_s + first * interval_s,
                label=label,
                **where,
                first_row=first,
                n_row=len(position[rows]),
                position_type=q.type,
                position=q.content,
                position_unit=q.unit,
                torque_type=u.type,
                torque=u.content,
                torque_unit=u.unit,
                valid=trace.valid.reshape(-1)[rows].tobytes(),
            )
        self._scalars(trace, position, torque, interval_s)

    def _reference(self, trace: Trace, rows: slice, where: dict[str, int]) -> None:
        packed = pack(trace.reference[rows], trace.reference_unit)
        self._add(
            "/reference",
            "robid.Reference",
            trace.time_s,
            **where,
            first_row=rows.start,
            n_row=len(trace.reference[rows]),
            reference_type=packed.type,
            reference=packed.content,
            reference_unit=packed.unit,
            saturated=trace.saturated.tolist(),
        )

    def _scalars(self, trace: Trace, position: FloatArray, torque: FloatArray, interval_s: float) -> None:
        step = max(round(1 / (PLOT_RATE_HZ * interval_s)), 1) if interval_s else 1
        reference = np.tile(trace.reference, (len(trace.position), 1))
        for axis, name in enumerate(self._axis_names):
            rows = zip(
                position[::step, axis].tolist(),
                torque[::step, axis].tolist(),
                reference[::step, axis].tolist(),
                strict=True,
            )
            for number, (q, u, v) in enumerate(rows):
                self._add(
                    f"/{name}",
                    "robid.AxisSample",
                    trace.time_s + number * step * interval_s,
                    position_rad=q,
                    torque_nm=u,
                    speed_reference_rad_s=v,
                )

    def close(self, complete: bool) -> None:
        """Finish the file; only a complete one gets its final name.

        A log that is broken off is finished as well as it can be: what broke it off is the error to tell.
        """
        if self._closed:
            return
        self._closed = True
        with self._refusing(StoreError) if complete else suppress(OSError):
            try:
                self._writer.finish()  # type: ignore[no-untyped-call]
            finally:
                self._sink.close()
            if complete:
                self._part.replace(self.path)
