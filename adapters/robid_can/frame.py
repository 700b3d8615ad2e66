"""A classic CAN frame that is cheap to carry on python-can's virtual bus, bursts of them, and an end of that bus.

The virtual bus deep-copies each frame for each receiver: most of the 9 us that a plain `can.Message` takes
from sender to receiver (measured; 2 us this way). A `Frame` holds `bytes`, which nobody can change, and is
therefore its own copy. An end of the bus opened here queues in C, has no filters, and leaves on frames the
simulated time that their sender gave them. Frames of one identifier that are sent one behind the other go as
one `Burst`. Other ends on the same channel may be python-can's own; they get each frame by itself.
"""

from __future__ import annotations

import queue
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import can
from can.interfaces.virtual import VirtualBus, channels_lock


class Frame(can.Message):
    """A data frame with an 11-bit identifier; the payload is immutable."""

    __slots__ = ()

    is_extended_id = False
    is_remote_frame = False
    is_error_frame = False
    is_fd = False
    bitrate_switch = False
    error_state_indicator = False

    def __init__(self, identifier: int, data: bytes, time_s: float) -> None:
        self.arbitration_id = identifier
        self.data = data  # type: ignore[assignment]  # bytes, so that nobody can change a frame under way
        self.dlc = len(data)
        self.timestamp = time_s
        self.channel = None
        self.is_rx = True

    def __deepcopy__(self, memo: dict[int, Any] | None) -> Frame:
        return self


class Burst(NamedTuple):
    """Data frames of one 11-bit identifier, one behind the other."""

    identifier: int
    payloads: Sequence[bytes]
    time_s: float

    def frames(self) -> list[Frame]:
        """Return each by itself."""
        return [Frame(self.identifier, payload, self.time_s) for payload in self.payloads]


class VirtualEnd(VirtualBus):
    """One end of the virtual bus called `channel`, for a single thread that never blocks."""

    def __init__(self, channel: str) -> None:
        super().__init__(channel=channel, preserve_timestamps=True)
        with channels_lock:
            self.channel.remove(self.queue)
            self.queue = queue.SimpleQueue()  # type: ignore[assignment]  # the part of Queue that is used here
            self.channel.append(self.queue)
        self._opened: deque[Frame] = deque()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Put a frame into the queue of every other end; what is no `Frame` goes python-can's way."""
        if type(msg) is not Frame:
            super().send(msg, timeout)
            return
        self._check_if_open()
        for end in self.channel:
            if end is not self.queue:
                end.put(msg, timeout=timeout)

    def send_burst(self, burst: Burst) -> None:
        """Put frames into the queue of every other end, whole where it is one of ours."""
        self._check_if_open()
        for end in self.channel:
            if isinstance(end, queue.SimpleQueue):
                if end is not self.queue:
                    end.put(burst)  # type: ignore[arg-type]  # to an end that opens it
            else:
                for frame in burst.frames():
                    end.put(frame)

    def recv(self, timeout: float | None = 0) -> can.Message | None:
        """Return the next frame, None where there is none within the time."""
        got = self.receive(timeout)
        if not isinstance(got, Burst):
            return got
        self._opened.extend(got.frames())
        return self._opened.popleft()

    def receive(self, timeout: float | None = 0) -> can.Message | Burst | None:
        """Return what comes next as it was sent, None where there is nothing within the time."""
        if self._opened:
            return self._opened.popleft()
        try:
            got: can.Message | Burst = self.queue.get(timeout=timeout) if timeout else self.queue.get_nowait()
        except queue.Empty:
            return None
        return got


def send(bus: can.BusABC, burst: Burst, timeout_s: float | None = None) -> None:
    """Send frames on any bus; raises can.CanError as the bus does."""
    if isinstance(bus, VirtualEnd) and len(burst.payloads) > 1:
        bus.send_burst(burst)
        return
    for frame in burst.frames():
        bus.send(frame, timeout_s)


def receive(bus: can.BusABC) -> can.Message | Burst | None:
    """Return what comes next on any bus, None where there is nothing at once."""
    return bus.receive() if isinstance(bus, VirtualEnd) else bus.recv(0)


def worst_case_bits(n_byte: int) -> int:
    """Bits of a classic frame with an 11-bit identifier, all stuff bits and the gap behind it included.

    47 bits of frame and gap, 8 per byte; the 34 bits from start to the end of the checksum that are not data
    and the data can be stuffed, one in four after the first (8 bytes: 135, 4 bytes: 95, none: 55).
    """
    return 47 + 8 * n_byte + (33 + 8 * n_byte) // 4
