"""The SDO server of CiA 301: expedited, segmented and block transfer, one transfer at a time.

Frames come and go as 8 bytes of payload. Segments of a block download arrive in bursts and are checked as
one array.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Callable, Sequence

import numpy as np

from robid_can.drive.objects import WRITE_OF_READ_ONLY, Key, ObjectStore, SdoAbort

MEMORY = 64 * 2**20  # bytes that one transfer may bring
BLOCK_SIZE = 127  # segments in a block, the most that CiA 301 allows
MULTIPLEXER = struct.Struct("<HB")
UNSIGNED32 = struct.Struct("<L")

TOGGLE_NOT_ALTERNATED = 0x0503_0000
UNKNOWN_COMMAND = 0x0504_0001
INVALID_BLOCK_SIZE = 0x0504_0002
INVALID_SEQUENCE = 0x0504_0003
CRC_ERROR = 0x0504_0004
OUT_OF_MEMORY = 0x0504_0005
LENGTH_MISMATCH = 0x0607_0010


class SdoServer:
    """Answers the requests of one client; `send` gets the answers, several at once for a block."""

    def __init__(self, objects: ObjectStore, send: Callable[[Sequence[bytes]], None]) -> None:
        self._objects = objects
        self._send = send
        self._answer: Callable[[bytes], None] = self._initiate
        self._in_block = False  # segments of a block download are awaited
        self._key: Key = (0, 0)
        self._data = b""
        self._parts: list[bytes] = []
        self._size: int | None = None
        self._received = 0
        self._toggle = 0
        self._position = 0
        self._sent = 0  # segments of the block under way
        self._block_size = BLOCK_SIZE
        self._crc = False

    def receive(self, requests: Sequence[bytes]) -> None:
        """Take consecutive requests of the client."""
        pending = list(requests)
        while pending:
            try:
                if self._in_block:
                    pending = pending[self._block_segments(pending) :]
                    continue
                request = pending.pop(0)
                if len(request) != 8:
                    continue  # no SDO: not answered
                if request[0] == 0x80:  # the client gives up
                    self._idle()
                else:
                    self._answer(request)
            except SdoAbort as abort:
                if self._in_block:
                    pending = []  # what is left of the burst are segments, not requests
                self._abort(abort.code)

    def _idle(self) -> None:
        self._answer = self._initiate
        self._in_block = False
        self._parts = []
        self._data = b""

    def _abort(self, code: int) -> None:
        self._idle()
        self._send([b"\x80" + MULTIPLEXER.pack(*self._key) + UNSIGNED32.pack(code)])

    def _reply(self, command: int, content: bytes = b"") -> None:
        self._send([(bytes([command]) + content).ljust(8, b"\0")])

    def _initiate(self, request: bytes) -> None:
        self._key = MULTIPLEXER.unpack_from(request, 1)
        command = request[0] >> 5
        if command == 1:
            self._initiate_download(request)
        elif command == 2:
            self._initiate_upload()
        elif command == 5 and not request[0] & 0x03:
            self._initiate_block_upload(request)
        elif command == 6 and not request[0] & 0x01:
            self._initiate_block_download(request)
        else:
            raise SdoAbort(UNKNOWN_COMMAND)

    # Download: the client writes

    def _initiate_download(self, request: bytes) -> None:
        expedited, sized = request[0] & 0x02, request[0] & 0x01
        if expedited:
            length = 4 - (request[0] >> 2 & 0x03) if sized else len(self._objects.variable(self._key)) // 8
            self._objects.download(self._key, request[4 : 4 + length])
        else:
            self._expect_download(UNSIGNED32.unpack_from(request, 4)[0] if sized else None)
            self._answer = self._download_segment
        self._reply(0x60, MULTIPLEXER.pack(*self._key))

    def _expect_download(self, size: int | None) -> None:
        if not self._objects.variable(self._key).writable:
            raise SdoAbort(WRITE_OF_READ_ONLY)
        if size is not None and size > MEMORY:
            raise SdoAbort(OUT_OF_MEMORY)
        self._size, self._parts, self._received, self._toggle = size, [], 0, 0

    def _take(self, part: bytes) -> None:
        self._received += len(part)
        if self._received > MEMORY:
            raise SdoAbort(OUT_OF_MEMORY)
        self._parts.append(part)

    def _download_segment(self, request: bytes) -> None:
        if request[0] >> 5:
            raise SdoAbort(UNKNOWN_COMMAND)
        if request[0] & 0x10 != self._toggle:
            raise SdoAbort(TOGGLE_NOT_ALTERNATED)
        self._take(request[1 : 8 - (request[0] >> 1 & 0x07)])
        if request[0] & 0x01:
            self._store(b"".join(self._parts))
            self._idle()
        self._reply(0x20 | self._toggle)
        self._toggle ^= 0x10

    def _store(self, data: bytes) -> None:
        if self._size is not None and len(data) != self._size:
            raise SdoAbort(LENGTH_MISMATCH)
        self._objects.download(self._key, data)

    def _initiate_block_download(self, request: bytes) -> None:
        self._crc = bool(request[0] & 0x04)
        self._expect_download(UNSIGNED32.unpack_from(request, 4)[0] if request[0] & 0x02 else None)
        self._sent = 0
        self._in_block = True
        self._reply(0xA4, MULTIPLEXER.pack(*self._key) + bytes([BLOCK_SIZE]))

    def _block_segments(self, requests: list[bytes]) -> int:
        """Take the segments at the head of a burst and return how many were taken."""
        burst = requests[: BLOCK_SIZE - self._sent]
        if burst[0][:1] == b"\x80":  # last segment, but number 0: the client gives up
            self._idle()
            return 1
        if any(len(request) != 8 for request in burst) or not burst[0][0]:
            raise SdoAbort(INVALID_SEQUENCE)
        rows = np.frombuffer(b"".join(burst), dtype=np.uint8).reshape(-1, 8)
        numbers = rows[:, 0] & 0x7F
        if not numbers.all():  # an abort behind the segments is taken in the next turn
            rows, numbers = rows[: np.argmin(numbers)], numbers[: np.argmin(numbers)]
        in_order = numbers == self._sent + 1 + np.arange(len(rows))
        last = np.flatnonzero(rows[:, 0] >= 0x80)
        taken = int(last[0]) + 1 if len(last) else len(rows)
        good = taken if in_order[:taken].all() else int(np.argmin(in_order[:taken]))
        self._take(rows[:good, 1:].tobytes())
        self._sent += good
        complete = len(last) > 0 and good == taken
        if len(last) or int(numbers[taken - 1]) == BLOCK_SIZE:
            self._reply(0xA2, bytes([self._sent, BLOCK_SIZE]))
            self._sent = 0
        if complete:
            self._in_block, self._answer = False, self._end_block_download
        return taken

    def _end_block_download(self, request: bytes) -> None:
        if request[0] & 0xE3 != 0xC1:
            raise SdoAbort(UNKNOWN_COMMAND)
        data = b"".join(self._parts)
        data = data[: len(data) - (request[0] >> 2 & 0x07)]
        if self._crc and binascii.crc_hqx(data, 0) != int.from_bytes(request[1:3], "little"):
            raise SdoAbort(CRC_ERROR)
        self._store(data)
        self._idle()
        self._reply(0xA1)

    # Upload: the client reads

    def _initiate_upload(self) -> None:
        data = self._objects.upload(self._key)
        if 0 < len(data) <= 4:
            self._reply(0x43 | (4 - len(data)) << 2, MULTIPLEXER.pack(*self._key) + data)
            return
        self._data, self._position, self._toggle = data, 0, 0
        self._answer = self._upload_segment
        self._reply(0x41, MULTIPLEXER.pack(*self._key) + UNSIGNED32.pack(len(data)))

    def _upload_segment(self, request: bytes) -> None:
        if request[0] >> 5 != 3:
            raise SdoAbort(UNKNOWN_COMMAND)
        if request[0] & 0x10 != self._toggle:
            raise SdoAbort(TOGGLE_NOT_ALTERNATED)
        part = self._data[self._position : self._position + 7]
        self._position += len(part)
        last = self._position >= len(self._data)
        self._reply(self._toggle | (7 - len(part)) << 1 | last, part)
        self._toggle ^= 0x10
        if last:
            self._idle()

    def _initiate_block_upload(self, request: bytes) -> None:
        self._crc = bool(request[0] & 0x04)
        self._set_block_size(request[4])
        self._data, self._position, self._sent = self._objects.upload(self._key), 0, 0
        self._answer = self._start_block_upload
        self._reply(0xC6, MULTIPLEXER.pack(*self._key) + UNSIGNED32.pack(len(self._data)))

    def _set_block_size(self, size: int) -> None:
        if not 1 <= size <= BLOCK_SIZE:
            raise SdoAbort(INVALID_BLOCK_SIZE)
        self._block_size = size

    def _start_block_upload(self, request: bytes) -> None:
        if request[0] != 0xA3:
            raise SdoAbort(UNKNOWN_COMMAND)
        self._answer = self._acknowledge_block
        self._send_block()

    def _send_block(self) -> None:
        block = self._data[self._position : self._position + 7 * self._block_size]
        n_segment = max(-(-len(block) // 7), 1)
        rows = np.zeros((n_segment, 8), dtype=np.uint8)
        rows[:, 0] = np.arange(1, n_segment + 1)
        rows[:, 1:] = np.frombuffer(block.ljust(7 * n_segment, b"\0"), dtype=np.uint8).reshape(-1, 7)
        if self._position + len(block) >= len(self._data):
            rows[-1, 0] |= 0x80
        self._sent = n_segment
        frames = rows.tobytes()
        self._send([frames[i : i + 8] for i in range(0, len(frames), 8)])

    def _acknowledge_block(self, request: bytes) -> None:
        if request[0] != 0xA2:
            raise SdoAbort(UNKNOWN_COMMAND)
        if request[1] > self._sent:
            raise SdoAbort(INVALID_SEQUENCE)
        self._set_block_size(request[2])
        self._position += 7 * request[1]
        if self._position < len(self._data) or not request[1]:
            self._send_block()  # the next block, or what was lost of this one
            return
        unused = self._position - len(self._data)
        crc = binascii.crc_hqx(self._data, 0) if self._crc else 0
        self._answer = self._end_block_upload
        self._reply(0xC1 | unused << 2, crc.to_bytes(2, "little"))

    def _end_block_upload(self, request: bytes) -> None:
        if request[0] != 0xA1:
            raise SdoAbort(UNKNOWN_COMMAND)
        self._idle()
