"""Text of a file and the encoding it is in, found from its bytes."""

from __future__ import annotations

import codecs
from pathlib import Path

from robid_core import DataRejected, StoreError

# UTF-32 first: its mark begins with that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32", "UTF-32"),
    (codecs.BOM_UTF32_BE, "utf-32", "UTF-32"),
    (codecs.BOM_UTF8, "utf-8-sig", "UTF-8 with byte order mark"),
    (codecs.BOM_UTF16_LE, "utf-16", "UTF-16"),
    (codecs.BOM_UTF16_BE, "utf-16", "UTF-16"),
)
# What is no UTF-8 has one byte for each character; Windows leaves five bytes of cp1252 undefined.
_WITHOUT_MARK = (("utf-8", "UTF-8"), ("cp1252", "Windows-1252"), ("latin-1", "Latin-1"))


def read_text(path: Path) -> tuple[str, str]:
    r"""Return the text of a file, lines ended by ``\n``, and the name of its encoding.

    A byte order mark decides; without one UTF-8 where that fits, else one byte for each character.

    Raises
    ------
    DataRejected
        If the file holds zero bytes, or is cut within a character.
    StoreError
        If it cannot be read.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise StoreError(f"{path}: cannot be read ({error.strerror or error})") from error
    text, name = _decoded(path, content)
    if "\0" in text:
        raise DataRejected(
            f"{path}: holds zero bytes, so it is no text, or UTF-16 without its byte order mark; save it as UTF-8"
        )
    return (text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text), name


def _decoded(path: Path, content: bytes) -> tuple[str, str]:
    for mark, codec, name in _MARKS:
        if content.startswith(mark):
            try:
                return content.decode(codec), name
            except UnicodeDecodeError as error:
                raise DataRejected(
                    f"{path}: not {name} text at byte {error.start}, though it begins as such; the file looks cut"
                ) from error
    for codec, name in _WITHOUT_MARK[:-1]:
        try:
            return content.decode(codec), name
        except UnicodeDecodeError:
            continue
    codec, name = _WITHOUT_MARK[-1]
    return content.decode(codec), name
