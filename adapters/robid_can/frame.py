"""A classic CAN frame that is cheap to carry on python-can's virtual bus, and an end of that bus.

The virtual bus deep-copies each frame for each receiver: most of the 9 us that a plain `can.Message` takes
from sender to receiver (measured; 2 us this way). A `Frame` holds `bytes`, which nobody can change, and is
therefore its own copy. An end of the bus opened here queues in C, has no filters, and leaves on frames the
simulated time that their sender gave them. Other ends on the same channel may be python-can's own.
"""

from __future__ import annotations

import queue
from typing import Any

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


class VirtualEnd(VirtualBus):
    """One end of the virtual bus called `channel`, for a single thread that never blocks."""

    def __init__(self, channel: str) -> None:
        super().__init__(channel=channel, preserve_timestamps=True)
        with channels_lock:
            self.channel.remove(self.queue)
            self.queue = queue.SimpleQueue()  # type: ignore[assignment]  # the part of Queue that is used here
            self.channel.append(self.queue)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Put a frame into the queue of every other end; what is no `Frame` goes python-can's way."""
        if type(msg) is not Frame:
            super().send(msg, timeout)
            return
        self._check_if_open()
        for end in self.channel:
            if end is not self.queue:
                end.put(msg, timeout=timeout)

    def recv(self, timeout: float | None = 0) -> can.Message | None:
        """Return the next frame, None where there is none at once."""
        if timeout:
            return super().recv(timeout)
        try:
            return self.queue.get_nowait()
        except queue.Empty:
            return None


def worst_case_bits(n_byte: int) -> int:
    """Bits of a classic frame with an 11-bit identifier, all stuff bits and the gap behind it included.

    47 bits of frame and gap, 8 per byte; the 34 bits from start to the end of the checksum that are not data
    and the data can be stuffed, one in four after the first (8 bytes: 135, 4 bytes: 95, none: 55).
    """
    return 47 + 8 * n_byte + (33 + 8 * n_byte) // 4
