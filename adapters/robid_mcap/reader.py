"""Records of an MCAP file in the order of the file, as far as they are whole.

A cut or damaged file gives everything that can be trusted, and a list of what is missing; nothing is taken
without its checksum having been looked at, and no length in the file makes the reader ask for more memory
than a limit. (`mcap` has readers too: its seeking one returns nothing from a cut file.)
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, McapRecord, Message, Metadata, Schema

from robid_core import DataRejected

MAGIC = b"\x89MCAP0\r\n"
PACKED = b"\x1f\x8b"
MOST_BYTES = 64 * 2**20  # of one record, packed or unpacked
FOOTER_BYTES = 9 + 8 + 8 + 4 + len(MAGIC)  # opcode, length, two offsets, checksum, and the mark at the end
_PLAIN: dict[int, Any] = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel, Opcode.METADATA: Metadata}
_DAMAGE = (McapError, ValueError, OverflowError, MemoryError, KeyError, zstandard.ZstdError, RuntimeError)


def scan(path: Path, problems: list[str]) -> Iterator[McapRecord]:
    """Yield schemas, channels, messages, metadata and attachments; what is wrong is appended to `problems`.

    Raises DataRejected where the file is no MCAP at all.
    """
    with path.open("rb") as file:
        first = file.read(len(MAGIC))
        if first.startswith(PACKED):
            raise DataRejected(f"A01: {path}: packed with gzip; unpack it first (gunzip)")
        if first != MAGIC:
            raise DataRejected(f"A01: {path}: no MCAP file, or cut within its first {len(MAGIC)} bytes")
        crc, complete, n_chunk = zlib.crc32(MAGIC), False, 0
        while (head := file.read(9)) and head != MAGIC:
            opcode, length = head[0], int.from_bytes(head[1:], "little")
            place = file.tell() - len(head)
            if length > MOST_BYTES and len(head) == 9:
                problems.append(_too_large(place, length))
                return
            content = file.read(length) if len(head) == 9 else b""
            if len(head) < 9 or len(content) < length:
                problems.append(f"A01: the file is cut at byte {place + len(head) + len(content)}")
                return
            try:
                if opcode == Opcode.CHUNK:
                    n_chunk += 1
                    yield from _chunk(content, n_chunk, problems)
                elif opcode == Opcode.DATA_END:
                    complete = True
                    _check_data(DataEnd.read(_stream(content)), crc, problems)
                    _check_summary(file.read(MOST_BYTES), problems)
                    break  # what follows only repeats
                else:
                    yield from _record(opcode, content)
            except _DAMAGE as error:
                problems.append(f"A02: the record at byte {place} is damaged ({error})")
            crc = zlib.crc32(content, zlib.crc32(head, crc))
        if not complete:
            problems.append("A01: the file ends before its end mark; it was not closed")


def _too_large(place: int, size: int) -> str:
    return (
        f"A04: the record at byte {place} would need {size / 1e6:.0f} MB, the limit is {MOST_BYTES / 1e6:.0f} MB; "
        "nothing behind it is read"
    )


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


def _record(opcode: int, content: bytes) -> Iterator[McapRecord]:
    if opcode in _PLAIN:
        yield _PLAIN[opcode].read(_stream(content))
    elif opcode == Opcode.MESSAGE:
        yield Message.read(_stream(content), len(content))
    elif opcode == Opcode.ATTACHMENT:
        if zlib.crc32(content[:-4]) != int.from_bytes(content[-4:], "little"):
            raise ValueError("the attachment's checksum does not fit")
        yield Attachment.read(_stream(content))


def _check_data(end: DataEnd, crc: int, problems: list[str]) -> None:
    if not end.data_section_crc:
        problems.append("A03: the file has no checksum over its data")
    elif end.data_section_crc != crc and not any(problem.startswith("A02") for problem in problems):
        problems.append(
            "A02: the checksum over the data does not fit: something outside the chunks is damaged"
        )


def _check_summary(content: bytes, problems: list[str]) -> None:
    """Look at the summary and the footer behind it; nothing is taken from them, and damage to them is told."""
    if content[-len(MAGIC) :] != MAGIC or len(content) < FOOTER_BYTES:
        problems.append("A01: the file is cut, or damaged, behind its data")
        return
    footer = Footer.read(_stream(content[9 - FOOTER_BYTES : -len(MAGIC)]))
    if footer.summary_crc and footer.summary_crc != zlib.crc32(content[: -len(MAGIC) - 4]):
        problems.append("A02: the checksum over the summary does not fit; nothing is taken from it")


def _chunk(content: bytes, number: int, problems: list[str]) -> Iterator[McapRecord]:
    chunk = Chunk.read(_stream(content))
    span = f"{chunk.message_start_time * 1e-9:.3f} s to {chunk.message_end_time * 1e-9:.3f} s"
    try:
        data = unpack(chunk)
    except _DAMAGE as error:
        problems.append(f"A02: chunk {number} ({span}) is rejected: {error}")
        return
    if not chunk.uncompressed_crc:
        problems.append(f"A03: chunk {number} ({span}) has no checksum and was not checked")
    elif zlib.crc32(data) != chunk.uncompressed_crc:
        problems.append(f"A02: chunk {number} ({span}) is rejected: its checksum does not fit")
        return
    position = 0
    while position < len(data):
        opcode, length = data[position], int.from_bytes(data[position + 1 : position + 9], "little")
        inside = data[position + 9 : position + 9 + length]
        if len(inside) < length:
            raise ValueError(f"chunk {number} ends within a record")
        yield from _record(opcode, inside)
        position += 9 + length


def unpack(chunk: Chunk) -> bytes:
    """Decompress a chunk to the size that it states; raises ValueError above the limit or where it differs."""
    size = chunk.uncompressed_size
    if size > MOST_BYTES:
        raise ValueError(f"A04: it would need {size / 1e6:.0f} MB, the limit is {MOST_BYTES / 1e6:.0f} MB")
    data: bytes
    if chunk.compression == "zstd":
        frame = zstandard.get_frame_parameters(chunk.data)
        if frame.content_size not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise ValueError(f"its content has {frame.content_size} bytes, it states {size}")
        limited = zstandard.ZstdDecompressor(max_window_size=MOST_BYTES)
        data = limited.decompress(chunk.data, max_output_size=size)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif not chunk.compression:
        data = chunk.data
    else:
        raise ValueError(f"unknown compression '{chunk.compression}'")
    if len(data) != size:
        raise ValueError(f"its content has {len(data)} bytes, it states {size}")
    return data


class Log:
    """A scanned file: schemas and channels by their numbers, then messages one by one."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems: list[str] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.counts: dict[int, int] = {}
        self.span_ns: dict[int, tuple[int, int]] = {}
        self.attachments: list[Attachment] = []
        for record in scan(path, self.problems):
            self._note(record)

    def _note(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record
        elif isinstance(record, Metadata):
            self.metadata[record.name] = record.metadata
        elif isinstance(record, Attachment):
            self.attachments.append(record)
        elif isinstance(record, Message):
            time, number = record.log_time, record.channel_id
            first, last = self.span_ns.get(number, (time, time))
            self.span_ns[number] = min(first, time), max(last, time)
            self.counts[number] = self.counts.get(number, 0) + 1

    def messages(self) -> Iterator[tuple[Channel, Schema | None, Message]]:
        """Yield the messages of known channels, in the order of the file."""
        ignored: list[str] = []  # told already
        for record in scan(self.path, ignored):
            if isinstance(record, Message) and record.channel_id in self.channels:
                channel = self.channels[record.channel_id]
                yield channel, self.schemas.get(channel.schema_id), record
