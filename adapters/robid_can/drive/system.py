"""A drive system: all virtual drives on one bus object, over one plant, in lock-step simulated time.

Nothing here waits and nothing runs by itself: `process` answers what has arrived, `advance` lets simulated
time pass. Frames take the time that they would occupy the bus; armed drives start together at a SYNC.
"""

from __future__ import annotations

from collections.abc import Sequence

import can
import numpy as np

from robid_can.dictionary import TraceState
from robid_can.drive.motion import MotorAxis, Motors
from robid_can.drive.node import REFERENCES_DIFFER, DriveNode, Nameplate
from robid_can.frame import Burst, receive, send, worst_case_bits
from robid_core import Plant

NMT, SYNC, SDO_REQUEST, HEARTBEAT = 0x000, 0x080, 0x600, 0x700  # CiA 301: predefined connection set
BITS = tuple(worst_case_bits(n) for n in range(9))


class DriveSystem:
    """Virtual drives that answer on a bus.

    `seed` is the noise of the next run: chance belongs to the simulated world and does not cross the bus.
    """

    def __init__(
        self,
        bus: can.BusABC,
        plant: Plant,
        nameplates: Sequence[Nameplate],
        node_ids: Sequence[int],
        *,
        bitrate: int = 1_000_000,
        sample_time_s: float = 1e-3,
    ) -> None:
        self.bus = bus
        self.motors = Motors(plant, sample_time_s)
        self.now_ns = 0
        self.seed = 0
        self._ns_per_bit = 1e9 / bitrate
        self.nodes = [
            DriveNode(node_id, nameplate, MotorAxis(self, axis), sample_time_s, self._transmit)
            for axis, (node_id, nameplate) in enumerate(zip(node_ids, nameplates, strict=True))
        ]

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return self.now_ns * 1e-9

    def _transmit(self, identifier: int, payloads: Sequence[bytes]) -> None:
        send(self.bus, Burst(identifier, payloads, self.time_s))
        self._occupy([len(payload) for payload in payloads])

    def _occupy(self, lengths: Sequence[int]) -> None:
        """Let the time pass that frames of these lengths occupy the bus."""
        n_bit = len(lengths) * BITS[8] if set(lengths) == {8} else sum(BITS[n] for n in lengths)
        self.now_ns += round(n_bit * self._ns_per_bit)

    def process(self) -> None:
        """Answer everything that has arrived, then do what is due."""
        while received := self._drain():
            for identifier, payloads in received:
                self._occupy([min(len(payload), 8) for payload in payloads])
                self._dispatch(identifier, payloads)
        self._do_until(self.now_ns)

    def _drain(self) -> list[tuple[int, list[bytes]]]:
        """Take all frames from the bus, runs of one identifier together."""
        runs: list[tuple[int, list[bytes]]] = []
        while (got := receive(self.bus)) is not None:
            if isinstance(got, Burst):
                identifier, payloads = got.identifier, list(got.payloads)
            elif got.is_error_frame or got.is_remote_frame or got.is_extended_id:
                continue
            else:
                identifier, payloads = got.arbitration_id, [bytes(got.data)]
            if runs and runs[-1][0] == identifier:
                runs[-1][1].extend(payloads)
            else:
                runs.append((identifier, payloads))
        return runs

    def _dispatch(self, identifier: int, payloads: list[bytes]) -> None:
        service, node_id = identifier & 0x780, identifier & 0x7F
        if identifier == SYNC:
            self._start()
        elif identifier == NMT:
            for payload in payloads:
                for node in self.nodes:
                    node.command(payload, self.now_ns // 1000)
        elif service == SDO_REQUEST:
            for node in self.nodes:
                if node.node_id == node_id:
                    node.request(payloads)
        elif service == HEARTBEAT:
            for node in self.nodes:
                node.hear_heartbeat(node_id, self.now_ns // 1000)

    # Time

    def advance(self, seconds: float) -> None:
        """Let simulated time pass."""
        self.process()
        target = self.now_ns + round(seconds * 1e9)
        self._do_until(target)
        self.now_ns = max(self.now_ns, target)

    def _do_until(self, target_ns: int) -> None:
        """Do everything that is due up to a time, in order."""
        while (due := self._next_event_ns()) is not None and due <= target_ns:
            self.now_ns = max(self.now_ns, due)
            run = self.motors.run
            if run is not None and self.now_ns >= run.end_ns:
                self._end()
            for node in self.nodes:
                node.act(self.now_ns // 1000)

    def _next_event_ns(self) -> int | None:
        times = [us * 1000 for node in self.nodes if (us := node.next_event_us()) is not None]
        if self.motors.run is not None:
            times.append(self.motors.run.end_ns)
        return min(times, default=None)

    # Motion

    def _start(self) -> None:
        """Start what is armed; references that do not fit together are a fault of all of them."""
        armed = [(a, node) for a, node in enumerate(self.nodes) if node.trace.state is TraceState.ARMED]
        if not armed:
            return
        programmes = {node.trace.programme for _, node in armed}
        if len(programmes) > 1:
            for _, node in armed:
                node.trace.finish(np.zeros(0), np.zeros(0), self.now_ns // 1000, complete=False)
                node.fault(REFERENCES_DIFFER)
            return
        n_sample, periods, kept = programmes.pop()
        reference = np.zeros((n_sample, len(self.nodes)))
        for axis, node in armed:
            reference[:, axis] = node.trace.reference
            node.trace.start()
        self.motors.track(reference, periods, kept, self.seed, self.now_ns)

    def _end(self) -> None:
        """End the run: each drive that is still in it keeps its trace."""
        for axis in range(len(self.nodes)):
            self._keep_trace(axis, complete=True)
        self.motors.settle(self.now_ns)

    def _keep_trace(self, axis: int, complete: bool) -> None:
        """Hand a drive that is in the run what it traced so far."""
        run, trace = self.motors.run, self.nodes[axis].trace
        if run is None or trace.state is not TraceState.RUNNING:
            return
        first, last = run.first_kept, run.taken(self.now_ns)
        clock_us = (run.began_ns + first * run.sample_ns) // 1000
        trace.finish(run.position[first:last, axis], run.torque[first:last, axis], clock_us, complete)

    def slow_down(self, axis: int, deceleration: float) -> int:
        """Let a motor ramp down to rest (rad/s^2) and leave the run; the others go on. Return when it rests, ns."""
        if self.motors.run is not None:
            self._keep_trace(axis, complete=False)
        return self.motors.slow_down(axis, deceleration, self.now_ns).end_ns
