"""What a file that cannot be read is in truth: a page, a pointer, an archive, a text under another suffix."""

from __future__ import annotations

from pathlib import Path

HEAD = 512
TEXTS = ("csv", "json")
ARCHIVES = ("npz",)
BINARY = ("hdf5", "mat", "mcap", "npz", "parquet", "rosbag")


def disguise(path: Path, reader: str) -> str:
    """Say what a file is by its first bytes, and what to do; empty where they are what its reader may expect.

    Parameters
    ----------
    path
        The file.
    reader
        Name of the reader that could not read it.
    """
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError:
        return ""
    begin = head.removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    if begin.startswith(b"version https://git-lfs"):
        return "a pointer of git LFS, and not the recording itself; run `git lfs pull` where it comes from"
    if begin.startswith((b"<!doctype html", b"<html")):
        return "an HTML page, and no recording; was a page to sign in saved in its place?"
    if head.startswith(b"PK\x03\x04") and reader in (*TEXTS, *BINARY) and reader not in ARCHIVES:
        return "a ZIP archive, as Excel workbooks and .npz files are; save its table as CSV, or unpack it"
    if reader in BINARY and _is_text(head):
        return "a text; is it a table? Call it .csv, or give its format: csv"
    return ""


def _is_text(head: bytes) -> bool:
    try:
        text = head.decode("utf-8", errors="strict" if len(head) < HEAD else "ignore")
    except UnicodeDecodeError:
        return False
    return "\n" in text and all(character.isprintable() or character in "\t\r\n" for character in text)
