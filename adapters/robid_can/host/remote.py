"""One drive as the host sees it: its objects, read and written through canopen's SDO client."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import canopen
from canopen.objectdictionary import ObjectDictionaryError
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from robid_can import dictionary as od
from robid_can.host import state
from robid_can.host.block import ANSWER_S, PATIENCE, SDO_REQUEST, BlockClient
from robid_can.host.link import Link

Key = tuple[int, int]


class PolledSdoClient(SdoClient):
    """canopen's client without its thread: waiting for an answer lets the bus go on, under the watch."""

    RESPONSE_TIMEOUT = 0.0

    def __init__(self, link: Link, node_id: int, dictionary: canopen.ObjectDictionary) -> None:
        super().__init__(0x600 + node_id, 0x580 + node_id, dictionary)  # type: ignore[no-untyped-call]
        self.network = link
        self._link = link
        link.subscribe(self.tx_cobid, self.on_response)

    def read_response(self) -> bytes:
        """Wait for the answer; canopen raises where there is none or an abort."""
        for _ in range(PATIENCE):
            if not self.responses.empty():
                break
            self._link.wait(ANSWER_S)
        return bytes(super().read_response())  # type: ignore[no-untyped-call]


@dataclass(frozen=True)
class ExpectedDrive:
    """Which drive stands where: what the robot's file says, and the preflight compares."""

    axis_name: str
    node_id: int
    serial_number: int | None  # None: any drive of the right maker, product and revision
    speed_limit: float  # rad/s, motor side


class RemoteDrive:
    """Object access by key, with errors that name the axis."""

    def __init__(self, link: Link, expected: ExpectedDrive, dictionary: canopen.ObjectDictionary) -> None:
        self.expected = expected
        self.name = f"{expected.axis_name} (node {expected.node_id})"
        self._link = link
        self._dictionary = dictionary
        self._sdo = PolledSdoClient(link, expected.node_id, dictionary)
        self.block = BlockClient(link, expected.node_id)
        self.scale = od.Scale(0.0, 0.0, 0.0)  # read at bring-up

    def read(self, key: Key) -> int:
        """Read a number."""
        variable = od.variable(self._dictionary, key)
        self._link.supervise()
        try:
            value = variable.decode_raw(self._sdo.upload(*key))
        except (SdoAbortedError, SdoCommunicationError, ObjectDictionaryError, struct.error) as error:
            raise self._link.failure(self._tell("reading", key, error)) from error
        assert isinstance(value, int)
        return value

    def write(self, key: Key, value: int) -> None:
        """Write a number."""
        data = bytes(od.variable(self._dictionary, key).encode_raw(value))
        self._link.supervise()
        try:
            self._sdo.download(*key, data)
        except (SdoAbortedError, SdoCommunicationError, struct.error) as error:
            raise self._link.failure(self._tell("writing", key, error)) from error

    # Without waiting, for a stop: nobody's silence delays what the others are told and asked

    def send_write(self, key: Key, value: int) -> None:
        """Send the request to write a number of at most 4 bytes; the answer is not waited for."""
        data = bytes(od.variable(self._dictionary, key).encode_raw(value))
        command = 0x23 | (4 - len(data)) << 2  # CiA 301: initiate download, expedited, size indicated
        self._send(struct.pack("<BHB4s", command, *key, data))

    def send_read(self, key: Key) -> None:
        """Send the request to read a number; `last_answer` gives what came."""
        self._send(struct.pack("<BHB4x", 0x40, *key))  # initiate upload

    def _send(self, request: bytes) -> None:
        self._link.send_burst(SDO_REQUEST + self.expected.node_id, [request])

    def last_answer(self, key: Key) -> int | None:
        """Return the last number that came for this object since this was asked, None where none did."""
        value, responses = None, self._sdo.responses
        while not responses.empty():
            answer = responses.get_nowait()
            command, *place = struct.unpack_from("<BHB", answer.ljust(8, b"\0"))
            if command & 0xE2 == 0x42 and tuple(place) == key:  # an expedited upload of this object
                size = 4 - (command >> 2 & 0x03) if command & 0x01 else 4
                number = od.variable(self._dictionary, key).decode_raw(answer[4 : 4 + size])
                assert isinstance(number, int)
                value = number
        return value

    def _tell(self, what: str, key: Key, error: Exception) -> str:
        place = f"{what} 0x{key[0]:04X}:{key[1]:02X}"
        if isinstance(error, SdoAbortedError):
            return f"{self.name} refused {place} ({error})"
        if isinstance(error, SdoCommunicationError):
            return f"B07: {self.name} does not answer ({place}); is it powered and on this bus?"
        return f"B09: {self.name} answered {place} with something else ({error})"

    def state(self) -> tuple[str, int]:
        """Return (state, statusword); a statusword without a state is a failure."""
        word = self.read(od.STATUSWORD)
        shown = state.state_of(word)
        if shown is None:
            raise self._link.failure(f"D07: {self.name} shows the statusword 0x{word:04X}, which is no state")
        return shown, word
