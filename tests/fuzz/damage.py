"""Damage to bytes as disks, cables and editors do it, the same for the same number.

`damaged(data, number)` is one of nine kinds of damage, at a place and of a size that the number draws. Nothing here
knows a format, except that beginnings and ends, where formats keep their sizes, are drawn more often.
"""

from __future__ import annotations

import numpy as np

EXTREME = (
    b"\x00", b"\xff", b"\x00" * 4, b"\xff" * 4, b"\xff" * 8, b"\x00" * 8, b"\xff\xff\xff\x7f",
    b"\xff\xff\xff\xff\xff\xff\xff\x7f", b"\x00\x00\x00\x80", b"\x01\x00\x00\x00", b"\x00\x00\x00\x00\x00\x00\x00\x40",
)  # fmt: skip
HEAD = 512  # bytes of a beginning or an end


def _place(length: int, generator: np.random.Generator) -> int:
    """Return a place: in a third of cases near the beginning, in a sixth near the end."""
    where = generator.random()
    if where < 1 / 3:
        return int(generator.integers(min(length, HEAD)))
    if where < 1 / 2:
        return length - 1 - int(generator.integers(min(length, HEAD)))
    return int(generator.integers(length))


def damaged(data: bytes, number: int) -> tuple[bytes, str]:
    """Return the damaged bytes, and in words what was done; never the same bytes as before."""
    generator = np.random.default_rng([20_260_101, number])
    while True:
        result, words = _once(data, generator)
        if result != data:
            return result, f"{words} (number {number})"


def _once(data: bytes, generator: np.random.Generator) -> tuple[bytes, str]:
    kind = int(generator.integers(9))
    place = _place(len(data), generator)
    size = int(2 ** generator.uniform(0, 10))
    rest = data[place + size :]
    match kind:
        case 0 | 1:
            flips = 1 if kind == 0 else int(generator.integers(2, 9))
            content = bytearray(data)
            for _ in range(flips):
                content[_place(len(data), generator)] ^= 1 << int(generator.integers(8))
            return bytes(content), f"{flips} bits flipped"
        case 2:
            return data[:place] + generator.bytes(1) + data[place + 1 :], f"byte {place} changed"
        case 3:
            return data[:place], f"cut at byte {place}"
        case 4:
            return data[:place] + bytes(
                len(data[place : place + size])
            ) + rest, f"{size} zeros at byte {place}"
        case 5:
            return data[:place] + generator.bytes(size) + data[
                place:
            ], f"{size} bytes inserted at byte {place}"
        case 6:
            return data[:place] + rest, f"{size} bytes lost at byte {place}"
        case 7:
            other = _place(len(data), generator)
            block = data[other : other + size]
            return data[:place] + block + data[
                place + len(block) :
            ], f"{size} bytes of {other} at byte {place}"
        case _:
            value = EXTREME[int(generator.integers(len(EXTREME)))]
            return data[:place] + value + data[place + len(value) :], f"{value.hex()} at byte {place}"
