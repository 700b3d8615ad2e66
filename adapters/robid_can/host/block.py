"""SDO block transfer for bulk data, as the client (CiA 301): whole blocks of segments at a time.

canopen's own block streams handle one segment per call, too slow for traces, and cannot resume against every
server. Lost segments are asked for again; the CRC is checked when the server has one.
"""

from __future__ import annotations

import binascii
import contextlib
import struct
from collections.abc import Iterator

import numpy as np

from robid_can.host.link import SDO_ANSWER, Link
from robid_core import RobidError

SDO_REQUEST = 0x600
BLOCK_SIZE = 127  # segments, the most that CiA 301 allows
MOST_RETRIES = 20  # blocks that may be repeated in one transfer
ANSWER_S, PATIENCE = 0.05, 10  # an answer may take so long, so often

GENERAL_ERROR = 0x0800_0000  # CiA 301: abort codes
INVALID_SEQUENCE, CRC_ERROR, UNKNOWN_COMMAND = 0x0504_0003, 0x0504_0004, 0x0504_0001
INVALID_BLOCK_SIZE, LENGTH_MISMATCH = 0x0504_0002, 0x0607_0010
INITIATE = struct.Struct("<BHBL")


class BlockClient:
    """Reads and writes large objects of one node."""

    def __init__(self, link: Link, node_id: int) -> None:
        self._link = link
        self._node_id = node_id
        self._key = (0, 0)
        self._place = ""
        self._aborted = False
        self.n_frame = 0

    def _say(self, *payloads: bytes) -> None:
        self._link.send_burst(SDO_REQUEST + self._node_id, payloads)
        self.n_frame += len(payloads)

    def _hear(self) -> list[bytes]:
        """Return the frames that answer, at least one."""
        for _ in range(PATIENCE):
            answers = self._link.receive_burst()
            self._link.keep_alive()
            self._link.check()
            if answers:
                self.n_frame += len(answers)
                return answers
            self._link.wait(ANSWER_S)
        raise self._fail("B07: {} does not answer")

    def _hear_one(self, wanted: int, mask: int) -> bytes:
        """Return the one frame that answers; its command under `mask` is `wanted`."""
        answer = self._hear()[0]
        if len(answer) == 8 and answer[0] == 0x80:
            raise self._fail(f"{{}} aborted with SDO code 0x{int.from_bytes(answer[4:], 'little'):08X}")
        if len(answer) != 8 or answer[0] & mask != wanted:
            raise self._give_up(UNKNOWN_COMMAND, f"{{}} answered {answer.hex(' ')} instead of 0x{wanted:02X}")
        return answer

    def _fail(self, message: str) -> RobidError:
        return self._link.failure(message.format(self._link.watch.names[self._node_id]) + self._place)

    def _give_up(self, code: int, message: str) -> RobidError:
        """Abort the transfer on the bus and return the error."""
        self._aborted = True
        self._say(INITIATE.pack(0x80, *self._key, code))
        return self._fail(message)

    def _hear_block(self) -> list[bytes]:
        """Return the segments of a block; where some are missing, what came until the bus fell silent."""
        segments = self._hear()
        while len(segments) < BLOCK_SIZE and not any(segment[:1] >= b"\x80" for segment in segments):
            self._link.wait(ANSWER_S)
            more = self._link.receive_burst()
            if not more:
                break
            self.n_frame += len(more)
            segments += more
        return segments

    @contextlib.contextmanager
    def _transfer(self, key: tuple[int, int], what: str) -> Iterator[None]:
        self._key = key
        self._place = f" ({what} of 0x{key[0]:04X}:{key[1]:02X} by SDO block transfer)"
        self.n_frame, self._aborted = 0, False
        with self._link.bulk(SDO_ANSWER + self._node_id):
            try:
                yield
            except (
                BaseException
            ):  # Ctrl-C too: the server must not wait for segments when the drive is stopped
                if not self._aborted:
                    self._say(INITIATE.pack(0x80, *key, GENERAL_ERROR))
                self._link.receive_burst()  # nor may its last segments be taken for answers
                raise

    def _note(self, what: str, n_byte: int) -> None:
        if self._link.log is not None:
            note = f"{what} 0x{self._key[0]:04X}:{self._key[1]:02X} of node {self._node_id}"
            self._link.log.bulk(self._link.clock.now(), note, self.n_frame, n_byte)

    def upload(self, key: tuple[int, int]) -> bytes:
        """Read an object.

        Raises MotionRefused or MotionAborted, as the link is, where the node is silent, aborts, breaks the
        protocol or sends data that do not fit their CRC or announced size.
        """
        with self._transfer(key, "upload"):
            content = self._upload()
        self._note("upload", len(content))
        return content

    def _upload(self) -> bytes:
        self._say(struct.pack("<BHBBB2x", 0xA4, *self._key, BLOCK_SIZE, 0))
        answer = self._hear_one(0xC0, 0xE1)
        has_crc, size = bool(answer[0] & 0x04), int.from_bytes(answer[4:], "little")
        self._say(b"\xa3".ljust(8, b"\0"))
        data, unused, crc = self._receive_blocks()
        content = data[: len(data) - unused]
        if has_crc and binascii.crc_hqx(content, 0) != crc:
            raise self._give_up(CRC_ERROR, "B01: data of {} do not fit their CRC")
        if answer[0] & 0x02 and len(content) != size:
            raise self._give_up(LENGTH_MISMATCH, f"{{}} announced {size} bytes and sent {len(content)}")
        self._say(b"\xa1".ljust(8, b"\0"))
        return content

    def _receive_blocks(self) -> tuple[bytes, int, int]:
        """Return all segments' bytes, how many of the last are unused, and the server's CRC."""
        parts: list[bytes] = []
        retries, complete = 0, False
        while not complete:
            segments = self._hear_block()
            if segments[0][:1] == b"\x80":
                raise self._fail(
                    f"{{}} aborted with SDO code 0x{int.from_bytes(segments[0][4:], 'little'):08X}"
                )
            good, complete = sequence(segments)
            parts.append(good.tobytes())
            acknowledged = len(good)
            if not complete and acknowledged < BLOCK_SIZE:
                retries += 1
                if retries > MOST_RETRIES:
                    raise self._give_up(INVALID_SEQUENCE, "B01: segments of {} are lost again and again")
            self._say(bytes([0xA2, acknowledged, BLOCK_SIZE]).ljust(8, b"\0"))
        end = self._hear_one(0xC1, 0xE3)
        return b"".join(parts), end[0] >> 2 & 0x07, int.from_bytes(end[1:3], "little")

    def download(self, key: tuple[int, int], data: bytes) -> None:
        """Write an object; raises as `upload`."""
        with self._transfer(key, "download"):
            self._download(data)
        self._note("download", len(data))

    def _download(self, data: bytes) -> None:
        self._say(INITIATE.pack(0xC6, *self._key, len(data)))
        answer = self._hear_one(0xA0, 0xE3)
        with_crc, block_size = bool(answer[0] & 0x04), answer[4]
        position, retries = 0, 0
        while position < len(data):
            if not 1 <= block_size <= BLOCK_SIZE:
                raise self._give_up(INVALID_BLOCK_SIZE, f"{{}} asks for blocks of {block_size} segments")
            segments = block_of(data, position, block_size)
            self._say(*segments)
            answer = self._hear_one(0xA2, 0xE3)
            position += 7 * answer[1]
            retries += answer[1] < len(segments)
            if answer[1] > len(segments) or retries > MOST_RETRIES:
                raise self._give_up(INVALID_SEQUENCE, "B01: segments to {} are lost again and again")
            block_size = answer[2]
        crc = binascii.crc_hqx(data, 0) if with_crc else 0
        self._say(struct.pack("<BH5x", 0xC1 | -len(data) % 7 << 2, crc))
        self._hear_one(0xA1, 0xE3)


def sequence(segments: list[bytes]) -> tuple[np.ndarray[tuple[int, int], np.dtype[np.uint8]], bool]:
    """Take the segments that follow one another from number 1.

    Returns (payloads, shape (n_segment, 7), whether the last of the transfer is among them).
    """
    n_whole = next((i for i, segment in enumerate(segments) if len(segment) != 8), len(segments))
    rows = np.frombuffer(b"".join(segments[:n_whole]), dtype=np.uint8).reshape(-1, 8)
    in_order = (rows[:, 0] & 0x7F) == np.arange(1, len(rows) + 1)
    good = len(rows) if in_order.all() else int(np.argmin(in_order))
    last = np.flatnonzero(rows[:good, 0] >= 0x80)
    if len(last):
        return rows[: last[0] + 1, 1:], True
    return rows[:good, 1:], False


def block_of(data: bytes, position: int, block_size: int) -> list[bytes]:
    """Return the segments of the block that begins at a byte of the data, numbered from 1."""
    block = data[position : position + 7 * block_size]
    n_segment = -(-len(block) // 7)
    rows = np.zeros((n_segment, 8), dtype=np.uint8)
    rows[:, 0] = np.arange(1, n_segment + 1)
    rows[:, 1:] = np.frombuffer(block.ljust(7 * n_segment, b"\0"), dtype=np.uint8).reshape(-1, 7)
    if position + len(block) == len(data):
        rows[-1, 0] |= 0x80
    frames = rows.tobytes()
    return [frames[i : i + 8] for i in range(0, len(frames), 8)]
