"""A CAN bus over UDP on loopback: the host in one process, the drives in another, both on the wall clock."""

from __future__ import annotations

import contextlib
import select
import socket
import struct
import time
from typing import Any

import can

from robid_can import dictionary
from robid_can.drives import CanDrives, OpenCanDrives
from robid_can.frame import Frame
from robid_can.host import Host, Link
from robid_core import Session

IDENTIFIER = struct.Struct("<H")
ANSWER_S = 0.002  # what the other process may take for an answer that is asked for at once
QUEUE_BYTES = 2**20  # a whole block transfer


class UdpEnd(can.BusABC):
    """One end of the bus; `there` is the other end's port, which the first frame that comes tells where absent."""

    def __init__(self, there: int | None = None) -> None:
        super().__init__(channel="udp")
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, QUEUE_BYTES)
        self.port: int = self.socket.getsockname()[1]
        self.there = there
        self.received = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; nobody need be there."""
        if self.there is not None:
            with contextlib.suppress(OSError):  # a port where nobody listens
                frame = IDENTIFIER.pack(msg.arbitration_id) + bytes(msg.data)
                self.socket.sendto(frame, ("127.0.0.1", self.there))

    def recv(self, timeout: float | None = 0) -> can.Message | None:
        """Return the next frame, None where there is none at once."""
        try:
            data, (_, self.there) = self.socket.recvfrom(64)
        except OSError:
            return None
        self.received += 1
        return Frame(*IDENTIFIER.unpack_from(data), data[IDENTIFIER.size :], time.monotonic())

    def wait(self, seconds: float) -> None:
        """Wait for a frame, no longer than that."""
        select.select([self.socket], [], [], max(seconds, 0.0))

    def shutdown(self) -> None:
        """Leave the bus."""
        super().shutdown()
        self.socket.close()


class WallClock:
    """The host's time; waiting ends with the first frame that comes."""

    def __init__(self, bus: UdpEnd) -> None:
        self._bus = bus

    def now(self) -> float:
        """Seconds of the monotonic clock."""
        return time.monotonic()

    def let_pass(self, seconds: float) -> None:
        """Wait."""
        self._bus.wait(max(seconds, ANSWER_S))


class UdpDrives(CanDrives):
    """Drives in another process, which count as hardware: nothing moves again by itself."""

    port: int
    """Where the drives listen."""

    @property
    def moves_hardware(self) -> bool:
        """True: what these drives did is not undone with this process."""
        return True

    def open(self, session: Session) -> OpenUdpDrives:
        """Build the host's side."""
        local: Any = super().open(session)
        return OpenUdpDrives(self, session, local._plant, local._expected)


class OpenUdpDrives(OpenCanDrives):
    """The host's side alone."""

    def _connect(self) -> Host:
        bus = UdpEnd(self._settings.port)  # type: ignore[attr-defined]
        self._buses, self._system = [bus], _Elsewhere()  # type: ignore[assignment]
        names = {drive.node_id: f"{drive.axis_name} (node {drive.node_id})" for drive in self._expected}
        link = Link(bus, WallClock(bus), names, self._session.raw_log)
        return Host(link, self._expected, dictionary.virtual_drive_dictionary())


class _Elsewhere:
    """The drive system as far as the host's process has one."""

    seed = 0

    @property
    def time_s(self) -> float:
        """Seconds of the monotonic clock."""
        return time.monotonic()
