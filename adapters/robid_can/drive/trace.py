"""The reference and trace memories of a drive: what is loaded, what is kept, in increments."""

from __future__ import annotations

import numpy as np

from robid_can import dictionary as od
from robid_can.drive.objects import LENGTH_TOO_LOW, VALUE_TOO_HIGH, WRONG_STATE, ObjectStore, SdoAbort
from robid_core import FloatArray


def pack_trace(position: FloatArray, torque: FloatArray, scale: od.Scale) -> bytes:
    """Rows of object 0x2103 from angles (rad) and torques (N m), each of shape (n_sample,)."""
    rows = np.empty(len(position), dtype=od.TRACE_ROW)
    rows["position"] = od.increments(position, scale.position, np.int32)
    rows["torque"] = od.increments(torque, scale.torque, np.int16)
    return rows.tobytes()


class TraceMemory:
    """Objects 0x2100 to 0x2103 of one drive."""

    def __init__(self, objects: ObjectStore, scale: od.Scale, saturated_torque_nm: float) -> None:
        self._objects = objects
        self._scale = scale
        self._saturated_torque = saturated_torque_nm
        self._reference = np.zeros(0, dtype=od.REFERENCE_SAMPLE)
        self._rows = b""
        self.state = od.TraceState.EMPTY
        objects.on_domain[od.REFERENCE_MEMORY] = self._load
        objects.on_read[od.TRACE_STATE] = lambda: int(self.state)
        objects.on_read[od.TRACE_SAMPLES] = lambda: len(self._rows) // od.TRACE_ROW.itemsize
        objects.on_read[od.TRACE_MEMORY] = lambda: self._rows

    @property
    def programme(self) -> tuple[int, int, int]:
        """Samples of the reference, how often it runs, and how many of the last periods are kept."""
        number = self._objects.number
        return len(self._reference), number(od.TRACE_PERIODS), number(od.TRACE_KEPT)

    @property
    def reference(self) -> FloatArray:
        """The loaded reference as the drive applies it, rad/s, shape (n_sample,)."""
        return self._reference.astype(float) * self._scale.velocity

    def _load(self, data: bytes) -> None:
        if self.state in (od.TraceState.ARMED, od.TraceState.RUNNING):
            raise SdoAbort(WRONG_STATE)
        if not data or len(data) % od.REFERENCE_SAMPLE.itemsize:
            raise SdoAbort(LENGTH_TOO_LOW)
        reference = np.frombuffer(data, dtype=od.REFERENCE_SAMPLE)
        if np.abs(reference.astype(np.int64)).max() > self._objects.number(od.MAX_PROFILE_VELOCITY):
            raise SdoAbort(VALUE_TOO_HIGH)
        self._reference = reference

    def arm(self, armed: bool) -> None:
        """Get ready for the next SYNC, or drop that."""
        n_sample, periods, kept = self.programme
        if self.state is od.TraceState.RUNNING or (armed and not (n_sample and 0 < kept <= periods)):
            raise SdoAbort(WRONG_STATE)
        self._rows = b""
        self.state = od.TraceState.ARMED if armed else od.TraceState.EMPTY

    def disarm(self) -> None:
        """Forget that a SYNC was to start a run: operation has ended, and a host must arm anew."""
        if self.state is od.TraceState.ARMED:
            self.state = od.TraceState.EMPTY

    def start(self) -> None:
        """Begin to trace."""
        self.state = od.TraceState.RUNNING

    def finish(self, position: FloatArray, torque: FloatArray, clock_us: int, complete: bool) -> None:
        """Keep what was sampled from `clock_us` on, in rad and N m, each of shape (n_sample,)."""
        self._rows = pack_trace(position, torque, self._scale)
        self._objects.values[od.TRACE_SATURATED] = int((np.abs(torque) >= self._saturated_torque).sum())
        self._objects.values[od.TRACE_CLOCK] = clock_us
        self.state = od.TraceState.COMPLETE if complete else od.TraceState.ABORTED
