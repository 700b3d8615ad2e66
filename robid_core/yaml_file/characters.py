"""From bytes to text: what a file may be made of (faults Y08 and Y09).

UTF-8 without byte order mark, not too large, no control characters and none that change the direction of
writing: a reader must see what the program reads.
"""

from __future__ import annotations

import re

from robid_core.yaml_file.kind import FileKind
from robid_core.yaml_file.problems import Mark, ProblemList

_BYTE_ORDER_MARKS = (
    (b"\xef\xbb\xbf", "a byte order mark"),
    (b"\xff\xfe", "UTF-16 or UTF-32"),
    (b"\xfe\xff", "UTF-16"),
    (b"\x00\x00\xfe\xff", "UTF-32"),
)
# C0 and C1 controls but tab, line feed, carriage return; line separators that editors show and YAML 1.2 does
# not break at; bidirectional controls (UAX #9, CVE-2021-42574); a byte order mark in mid-text; noncharacters.
_FORBIDDEN = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\ufeff\ufffe\uffff]"
)


def decode(data: bytes, kind: FileKind, problems: ProblemList) -> str | None:
    """Return the text of a file, or None where problems were found.

    Each problem names the offset of the byte and its value.
    """
    if len(data) > kind.maximum_bytes:
        refuse_size(len(data), kind, problems)
        return None
    for mark, name in _BYTE_ORDER_MARKS:
        if data.startswith(mark):
            problems.add(
                Mark(1, 1),
                (),
                f"byte 0 is 0x{data[0]:02x}: {name}; save the file as UTF-8 without byte order mark",
            )
            return None
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8")
        problems.add(
            _mark(before),
            (),
            f"byte {error.start} is 0x{data[error.start]:02x}: not UTF-8; save the file as UTF-8",
        )
        return None
    found = [(match.start(), match.group()) for match in _FORBIDDEN.finditer(text)]
    for position, character in found[:20]:
        offset = len(text[:position].encode("utf-8"))
        what = "a control character" if ord(character) < 0xA0 else "an invisible character"
        problems.add(
            _mark(text[:position]),
            (),
            f"byte {offset} is 0x{data[offset]:02x}: {what} (U+{ord(character):04X}); delete it",
        )
    return None if found else text


def refuse_size(n_byte: int, kind: FileKind, problems: ProblemList) -> None:
    """Report that a file is too large."""
    most = kind.maximum_bytes // 1024
    problems.add(Mark(1, 1), (), f"{n_byte} bytes; {kind.noun} has at most {most} KiB")


def _mark(before: str) -> Mark:
    lines = re.split("\r\n|\r|\n", before)
    return Mark(len(lines), len(lines[-1]) + 1)
