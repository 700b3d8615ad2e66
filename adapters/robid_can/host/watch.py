"""The watch over the nodes' lives: own heartbeat consumer, EMCY, foreign and malformed frames.

canopen leaves a node that has fallen silent "operational" for ever; this watch does not. It only takes note;
the link raises its complaints in the caller's thread.
"""

from __future__ import annotations

import struct

HOST_NODE_ID = 0x7F  # of the host's own heartbeat
EMCY, HEARTBEAT = 0x080, 0x700  # CiA 301: predefined connection set
BOOT_UP, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0x00, 0x04, 0x05, 0x7F  # CiA 301: NMT states
HEARTBEAT_S = 0.1  # period, host and drives
SILENCE_S = 0.35  # three heartbeats may be missed


class Watch:
    """What is known of the nodes' lives: last heartbeat, NMT state, and complaints not yet raised."""

    def __init__(self, node_names: dict[int, str]) -> None:
        self.names = node_names
        self.heard: dict[int, float] = {}
        self.nmt_state: dict[int, int] = {}
        self.boot_ups: dict[int, int] = dict.fromkeys(node_names, 0)
        self.complaints: list[str] = []
        self.expected_state: int | None = None

    def observe(self, identifier: int, data: bytes, now_s: float) -> None:
        """Take note of a frame; never raises."""
        service, node_id = identifier & 0x780, identifier & 0x7F
        if service == HEARTBEAT:
            self._heartbeat(node_id, data, now_s)
        elif service == EMCY and node_id:
            self._emergency(node_id, data)

    def _heartbeat(self, node_id: int, data: bytes, now_s: float) -> None:
        if node_id == HOST_NODE_ID or node_id not in self.names:
            self.complaints.append(f"B15: a heartbeat of a foreign node {node_id} is on the bus")
        elif len(data) != 1:
            self.complaints.append(f"B09: {self.names[node_id]} sent a malformed heartbeat ({data.hex(' ')})")
        else:
            state = data[0] & 0x7F
            self.heard[node_id] = now_s
            self.nmt_state[node_id] = state
            if state == BOOT_UP:
                self.boot_ups[node_id] += 1
            if self.expected_state is not None and state != self.expected_state:
                what = "started again" if state == BOOT_UP else f"went to NMT state 0x{state:02X}"
                self.complaints.append(f"B16: {self.names[node_id]} {what} without being asked")

    def _emergency(self, node_id: int, data: bytes) -> None:
        name = self.names.get(node_id, f"foreign node {node_id}")
        if len(data) != 8:
            self.complaints.append(f"B09: {name} sent a malformed EMCY ({data.hex(' ')})")
            return
        code, register = struct.unpack_from("<HB", data)
        if code & 0xFF00:  # 0x00xx: error reset
            self.complaints.append(
                f"B08: {name} sent EMCY 0x{code:04X}, error register 0x{register:02X} ({data.hex(' ')})"
            )

    def silent(self, now_s: float) -> list[int]:
        """Return the nodes that have not been heard for too long."""
        return [node for node in self.names if now_s - self.heard.get(node, -SILENCE_S) >= SILENCE_S]
