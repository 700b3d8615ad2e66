"""The host's end of the bus: sending, collecting, and the watch over every node.

Each frame that comes in passes the watch first (own heartbeat consumer, EMCY, foreign or malformed frames);
canopen sees it afterwards. Nothing is raised while frames come in: `check` raises in the caller's thread.
Time is what the `Clock` says: simulated in lock-step, or a wall clock.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

import can
import canopen

from robid_can.frame import Burst, receive, send
from robid_can.host.watch import HEARTBEAT, HEARTBEAT_S, HOST_NODE_ID, OPERATIONAL, SILENCE_S, Watch
from robid_core import MotionAborted, MotionRefused, RobidError, heed

# What canopen logs of its own ("transfer aborted by client") is raised by us with its place, not printed.
logging.getLogger("canopen").addHandler(logging.NullHandler())

SDO_ANSWER = 0x580  # CiA 301: predefined connection set
SEND_TIMEOUT_S = 1.0
STOPPING_SEND_TIMEOUT_S = 0.05  # a bus that takes no frame must not keep the other drives waiting


class Clock(Protocol):
    """The time of the bus."""

    def now(self) -> float:
        """Seconds since some beginning, never backwards."""

    def let_pass(self, seconds: float) -> None:
        """Wait; a simulated drive system moves on, with 0 it answers what it was sent."""


class FrameLog(Protocol):
    """Where frames are kept."""

    def frame(self, time_s: float, identifier: int, data: bytes) -> None:
        """Keep one frame."""

    def bulk(self, time_s: float, note: str, n_frame: int, n_byte: int) -> None:
        """Count the frames of a block transfer, which are not kept."""


class Link(canopen.Network):
    """A canopen network without threads: what is sent is answered when `collect` or `wait` is called."""

    def __init__(
        self, bus: can.BusABC, clock: Clock, node_names: dict[int, str], log: FrameLog | None = None
    ) -> None:
        super().__init__(bus)
        self._can = bus
        self.clock = clock
        self.watch = Watch(node_names)
        self.moving = False
        self.stopping = False  # from then on nothing is waited for long
        self.log = log
        self._heartbeat_due: float | None = None
        self._bulk_identifier: int | None = None
        self._bulk_frames: list[bytes] = []

    def failure(self, message: str) -> RobidError:
        """Return the error that a fault is now: refused before anything moved, aborted afterwards."""
        if self.moving:
            return MotionAborted(f"{message}; all axes get a quick stop and are switched off")
        return MotionRefused(f"{message}; nothing has moved")

    def send_message(self, can_id: int, data: bytes | Sequence[int], remote: bool = False) -> None:
        """Send a frame and take in the answers that are there at once (canopen's hook)."""
        del remote  # nothing here asks by remote frames
        payload = bytes(data)
        self._keep(can_id, payload)
        self.send_burst(can_id, [payload])
        self.clock.let_pass(0)
        self.collect()

    def send_burst(self, identifier: int, payloads: Sequence[bytes]) -> None:
        """Send frames of one identifier one behind the other."""
        burst = Burst(identifier, payloads, self.clock.now())
        try:
            send(self._can, burst, STOPPING_SEND_TIMEOUT_S if self.stopping else SEND_TIMEOUT_S)
        except can.CanError as error:
            raise self.failure(f"B11: the bus does not take frames ({error})") from error

    @contextlib.contextmanager
    def bulk(self, identifier: int) -> Iterator[None]:
        """Set frames of one identifier aside for `receive_burst` while a block transfer runs."""
        self.collect()
        self._bulk_identifier, self._bulk_frames = identifier, []
        try:
            yield
        finally:
            self._bulk_identifier = None

    def receive_burst(self) -> list[bytes]:
        """Return the frames of the block transfer that have come in; all others take the usual way."""
        self.clock.let_pass(0)
        self.collect()
        frames, self._bulk_frames = self._bulk_frames, []
        return frames

    def collect(self) -> None:
        """Take in every frame that has come."""
        while (got := receive(self._can)) is not None:
            if not isinstance(got, Burst):
                self._take(got)
            elif got.identifier == self._bulk_identifier:
                self._bulk_frames.extend(got.payloads)
            else:
                for frame in got.frames():
                    self._take(frame)

    def _take(self, message: can.Message) -> None:
        if message.is_error_frame:
            self.watch.complaints.append("B06: the CAN controller reports an error frame")
        elif not (message.is_remote_frame or message.is_extended_id):
            identifier, data = message.arbitration_id, bytes(message.data)
            if identifier == self._bulk_identifier:
                self._bulk_frames.append(data)
                return
            self._keep(identifier, data)
            self.watch.observe(identifier, data, self.clock.now())
            if identifier & 0x780 == SDO_ANSWER:
                self.notify(identifier, bytearray(data), message.timestamp)

    def _keep(self, identifier: int, data: bytes) -> None:
        if self.log is not None:
            self.log.frame(self.clock.now(), identifier, data)

    # Supervision

    def start_heartbeat(self) -> None:
        """Send the host's heartbeat from now on, whenever time passes."""
        self._heartbeat_due = self.clock.now()
        self.keep_alive()

    def stop_heartbeat(self) -> None:
        """Fall silent."""
        self._heartbeat_due = None

    def keep_alive(self) -> None:
        """Send the host's heartbeat if it is due; one that comes too late for the drives is a complaint."""
        now = self.clock.now()
        if self._heartbeat_due is not None and now >= self._heartbeat_due:
            silent_s = now - self._heartbeat_due + HEARTBEAT_S
            if silent_s >= SILENCE_S:
                stood = f"D10: this computer stood still for {silent_s:.2f} s"
                self.watch.complaints.insert(0, f"{stood}, and the drives have stopped by themselves")
            self._heartbeat_due = now + HEARTBEAT_S
            self.send_message(HEARTBEAT + HOST_NODE_ID, bytes([OPERATIONAL]))

    def supervise(self) -> None:
        """Before a request: keep the drives' watchdogs quiet, and ask nothing of drives that have stopped (raises)."""
        self.keep_alive()
        self.check()

    def attend(self, seconds: float) -> None:
        """Let time pass and take in what comes, without judging it."""
        self.keep_alive()
        self.clock.let_pass(seconds)
        self.collect()

    def wait(self, seconds: float = HEARTBEAT_S) -> None:
        """Let time pass under supervision; raises what the watch has to complain of."""
        self.attend(seconds)
        self.check()

    def check(self) -> None:
        """Raise KeyboardInterrupt where the run was told to stop, then the first complaint, and that only once."""
        heed()
        if self.watch.expected_state is not None:
            self.watch.complaints += [
                f"B07: {self.watch.names[node]} has been silent for {SILENCE_S * 1e3:.0f} ms"
                for node in self.watch.silent(self.clock.now())
            ]
        if self.watch.complaints:
            complaints, self.watch.complaints = self.watch.complaints, []
            more = f" (and {len(complaints) - 1} more)" if len(complaints) > 1 else ""
            raise self.failure(complaints[0] + more)

    def until(self, true: Callable[[], bool], limit_s: float, every_s: float = HEARTBEAT_S) -> bool:
        """Wait until something is true; False where it is not within the limit."""
        end = self.clock.now() + limit_s
        while not true():
            if self.clock.now() >= end:
                return False
            self.wait(every_s)
        return True
