"""The variables of a MATLAB file (v5 to v7) as pieces of bytes, checked before a library parses them.

Behind a header of 128 bytes stand elements: a type, a length, content. A packed one ends with the checksum (Adler-32)
of its content, which scipy looks at only where it happens to read that far, and its content begins with its own type
and length. Layout: "MAT-File Format", The MathWorks.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import BinaryIO, Literal

from robid_core import DataRejected

HEADER, TAG = 128, 8
MATRIX, PACKED = 14, 15
BLOCK = 1 << 20
Order = Literal["little", "big"]
ORDERS: dict[bytes, Order] = {b"IM": "little", b"MI": "big"}


def check_elements(path: Path) -> None:
    """Raise DataRejected with the byte where an element is cut, of a wrong type, or does not fit its checksum.

    Files of version 4, which have zeros in their first four bytes and no checksums, pass.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        header = file.read(HEADER)
        if 0 in header[:4]:
            return
        order = ORDERS.get(header[126:128])
        if order is None:
            raise DataRejected(
                f"{path}: cannot be read as a MATLAB file: bytes 126 and 127 say no order of bytes; export it anew"
            )
        place = HEADER
        while place < size:
            tag = file.read(TAG)
            kind = int.from_bytes(tag[:4], order)
            length = int.from_bytes(tag[4:], order)
            if len(tag) < TAG or place + TAG + length > size:
                raise DataRejected(
                    f"A01: {path}: cannot be read as a MATLAB file: the variable at byte {place} is cut; copy it again"
                )
            if kind not in (MATRIX, PACKED):
                raise DataRejected(
                    f"A02: {path}: no variable begins at byte {place}, it is damaged; copy it again"
                )
            if kind == PACKED:
                _check_packed(path, file, place, length, order)
            else:
                file.seek(length, 1)
            place += TAG + length


def _check_packed(path: Path, file: BinaryIO, place: int, length: int, order: Order) -> None:
    """Unpack an element block by block, keep nothing, and compare checksum and length."""
    packed, unpacked, inner = zlib.decompressobj(), 0, b""
    left = length
    try:
        while left and not packed.eof:
            block = file.read(min(left, BLOCK))
            left -= len(block)
            while block:
                content = packed.decompress(block, BLOCK)
                inner = (inner + content)[:TAG]
                unpacked += len(content)
                block = packed.unconsumed_tail
                if not content and not block:
                    break
        while not packed.eof and (content := packed.decompress(b"", BLOCK)):
            unpacked += len(content)
    except zlib.error as error:
        raise DataRejected(
            f"A02: {path}: the variable at byte {place} is damaged ({error}); copy it again"
        ) from error
    stated = int.from_bytes(inner[4:], order)
    if not packed.eof or left or packed.unused_data or unpacked != stated + TAG:
        raise DataRejected(
            f"A02: {path}: the variable at byte {place} is damaged: {unpacked} bytes are packed in it where "
            f"{stated + TAG} should be; copy it again"
        )
