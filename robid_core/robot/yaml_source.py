"""From the bytes of a robot file to a document: data, and the line and column of every key and value.

YAML 1.2: `yes` and `1:30` are text. Data are built from the parser's events, so that what could hurt - depth, tags,
aliases that blow up - is refused where it stands and before anything is made of it (faults Y03, Y06 to Y10).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    MappingEndEvent,
    MappingStartEvent,
    NodeEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from robid_core.robot.document import Document
from robid_core.robot.part import Path
from robid_core.robot.problems import Mark

MAXIMUM_BYTES = 1024 * 1024  # a robot of a hundred axes with its bodies written out needs a tenth
MAXIMUM_DEPTH = 32
MAXIMUM_VALUES = 100_000  # aliases written out

# Plain scalars by the core schema of YAML 1.2 (section 10.3.2).
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")


def read_document(path: FilePath) -> Document:
    """Read a robot file; raises RobotProblems where it cannot be read, is no YAML, or no mapping."""
    document, data = Document(path.name), b""
    try:
        size = path.stat().st_size
        if size > MAXIMUM_BYTES:
            document.add((), f"{size} bytes; a robot file has at most {MAXIMUM_BYTES // 1024} KiB")
        else:
            data = path.read_bytes()
    except OSError as error:
        document.add((), f"cannot be read: {error.strerror}; name a robot.yaml")
    document.raise_if_any()
    return parse_document(data, path.name)


def parse_document(data: bytes, file: str) -> Document:
    """Make a document of what a robot file holds; raises RobotProblems where it is no YAML, or no mapping.

    Repeated keys and tags are left in `problems`, to be told with what else is wrong.
    """
    document = Document(file)
    try:
        root = _Builder(YAML(typ="safe", pure=True).parse(data.decode("utf-8")), document).root()
        if not isinstance(root, dict):
            raise _Hopeless(
                "a robot file holds keys and values; begin with robid_robot: 1 and name: ...", Mark(1, 1)
            )
        document.data = root
    except _Hopeless as error:
        document.add((), error.reason, error.mark)
    except UnicodeDecodeError as error:
        document.add(
            (), f"byte {error.start} is 0x{error.object[error.start]:02x}: not UTF-8; save the file as UTF-8"
        )
    except MarkedYAMLError as error:
        at = error.problem_mark or error.context_mark
        reason = " ".join(" ".join(str(part) for part in (error.problem, error.context) if part).split())
        hint = "check indentation, quotes and brackets before this place"
        document.add((), f"not YAML: {reason}; {hint}", Mark(at.line + 1, at.column + 1) if at else None)
    except YAMLError as error:
        document.add((), f"not YAML: {' '.join(str(error).split())}")
    if not document.data:
        document.raise_if_any()
    return document


class _Hopeless(Exception):
    """Nothing can be made of the document."""

    def __init__(self, reason: str, mark: Mark) -> None:
        super().__init__(reason)
        self.reason, self.mark = reason, mark


def _mark(event: Any) -> Mark:
    return Mark(event.start_mark.line + 1, event.start_mark.column + 1)


class _Builder:
    """Makes data of events and writes down where each value stands; recursion is bounded by MAXIMUM_DEPTH."""

    def __init__(self, events: Iterator[Any], document: Document) -> None:
        self._events = events
        self._document = document
        self._anchors: dict[str, tuple[Any, int]] = {}  # value, and how many values it holds
        self._count = 0

    def root(self) -> Any:
        found, documents = None, 0
        for event in self._events:
            if isinstance(event, DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise _Hopeless(
                        "a second document; a robot file holds one, without '---' in the middle", _mark(event)
                    )
            elif isinstance(event, NodeEvent):
                found = self._value(event, (), 1)
        return found

    def _value(self, event: Any, path: Path, depth: int) -> Any:
        before, mark = self._count, _mark(event)
        self._document.marks.setdefault(path, mark)
        self._count += 1
        if isinstance(event, AliasEvent):
            if event.anchor not in self._anchors:
                raise _Hopeless(
                    f"the alias '*{event.anchor}' has no anchor before it; write the value out", mark
                )
            value, size = self._anchors[event.anchor]
            self._count += size
        else:
            if depth > MAXIMUM_DEPTH:
                raise _Hopeless(f"nested deeper than {MAXIMUM_DEPTH} levels; no part of a robot is", mark)
            if event.tag is not None:
                tag = str(event.tag).replace("tag:yaml.org,2002:", "!!")
                self._document.add(path, f"the tag '{tag}' is refused; write the value without a tag", mark)
            value = self._content(event, path, depth)
            if event.anchor:
                self._anchors[event.anchor] = (value, self._count - before)
        if self._count > MAXIMUM_VALUES:
            raise _Hopeless(
                f"with its aliases written out the file has more than {MAXIMUM_VALUES} values", mark
            )
        return value

    def _content(self, event: Any, path: Path, depth: int) -> Any:
        if isinstance(event, ScalarEvent):
            return str(event.value) if event.style else plain_scalar(str(event.value))
        if isinstance(event, SequenceStartEvent):
            items: list[Any] = []
            while not isinstance(inner := next(self._events), SequenceEndEvent):
                items.append(self._value(inner, (*path, len(items)), depth + 1))
            return items
        assert isinstance(event, MappingStartEvent)
        entries: dict[str, Any] = {}
        while not isinstance(key := next(self._events), MappingEndEvent):
            if not isinstance(key, ScalarEvent):
                raise _Hopeless("a key must be plain text", _mark(key))
            name = str(key.value)
            here = (*path, name)
            if name in entries:
                first = self._document.marks[here].line
                reason = f"repeated key '{name}': it stands at line {first} already; keep one"
                self._document.add(here, reason, _mark(key))
                self._value(next(self._events), (*path, f"{name} again"), depth + 1)
                continue
            self._document.marks[here] = _mark(key)
            entries[name] = self._value(next(self._events), here, depth + 1)
        return entries


def plain_scalar(text: str) -> str | int | float | bool | None:
    """Return what an unquoted scalar means."""
    word = text.lower() if text in (text.upper(), text.title()) else text
    if word in _WORDS:
        return _WORDS[word]
    if _INTEGER.fullmatch(text):
        return int(text)
    if len(text) <= 300 and _FLOAT.fullmatch(text):
        return float(text)
    return float(text.replace(".", "")) if _INFINITE.fullmatch(text) else text
