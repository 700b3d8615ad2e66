"""From text to a tree of nodes (faults Y03 and Y06 to Y10).

The parser's events are counted before anything is built: depth, aliases. The tree is then composed here,
because every key and value must keep its line and column, repeated keys must name both lines, tags are
refused where they stand, and an alias must not blow up: its size counts at every use.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Iterator
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from robid_core.yaml_file.kind import FileKind
from robid_core.yaml_file.nodes import Aliases, Node, mapping, sequence
from robid_core.yaml_file.problems import KeyPath, Mark, ProblemList
from robid_core.yaml_file.scalars import plain_scalar

MAXIMUM_DEPTH = 32
MAXIMUM_NODES = 100_000  # aliases written out; a file of 256 KiB without aliases cannot have more to say
NO_BREAK_SPACE = "\u00a0"
_HALF = re.compile("[\ud800-\udfff]")  # what an escape may write, and no file can hold


def read_nodes(text: str, kind: FileKind, problems: ProblemList) -> Node | None:
    """Return the root of a document, or None where it cannot be read as YAML; problems are collected."""
    try:
        events = _scanned(text, kind)
    except _Refused as refused:
        problems.add(refused.mark, (), str(refused))
        return None
    except MarkedYAMLError as error:
        if (odd := _odd_indentation(text)) is not None:
            problems.add(odd, (), "not YAML: indented with a no-break space (U+00A0); type plain spaces")
            return None
        _tell_syntax(error, problems)
        return None
    except YAMLError as error:
        problems.add(Mark(1, 1), (), f"not YAML: {' '.join(str(error).split())}")
        return None
    return _Composer(events, kind, problems).document()


def _odd_indentation(text: str) -> Mark | None:
    """Return the place of the first no-break space that indents a line, as text copied from pages has it."""
    for number, line in enumerate(text.splitlines(), start=1):
        blank = line[: len(line) - len(line.lstrip())]
        if NO_BREAK_SPACE in blank:
            return Mark(number, blank.index(NO_BREAK_SPACE) + 1)
    return None


def _tell_syntax(error: MarkedYAMLError, problems: ProblemList) -> None:
    """Report what the parser stumbled over; what never ends is told where it begins."""
    reason, begun, at = str(error.problem or error.context), "", error.problem_mark or error.context_mark
    if error.context and error.context_mark is not None:
        endless = "end of stream" in reason
        begun = f", {error.context}" + (
            "" if endless else f" that begins at line {error.context_mark.line + 1}"
        )
        at = error.context_mark if endless else at
    mark = Mark(at.line + 1, at.column + 1) if at is not None else Mark(1, 1)
    hint = "check indentation, quotes and brackets before this place"
    problems.add(mark, (), f"not YAML: {' '.join((reason + begun).split())}; {hint}")


class _Refused(Exception):
    """A document holds what could hurt, at a place."""

    def __init__(self, mark: Mark, reason: str) -> None:
        super().__init__(reason)
        self.mark = mark


class _Hopeless(Exception):
    """The document was refused; the problem is in the list."""


@functools.lru_cache(maxsize=16)
def _scanned(text: str, kind: FileKind) -> tuple[Any, ...]:
    """Return the parser's events; a robot file is read by many stages of one pipeline, and scanned once."""
    return tuple(_scan(text, kind))


def _scan(text: str, kind: FileKind) -> Iterator[Any]:
    """Yield the parser's events, refusing what could hurt before it is built."""
    depth = aliases = documents = 0
    for event in YAML(typ="safe", pure=True).parse(text):
        mark = _mark(event)
        refusal = ""
        if isinstance(event, MappingStartEvent | SequenceStartEvent):
            depth += 1
            if depth > MAXIMUM_DEPTH:
                refusal = f"nested deeper than {MAXIMUM_DEPTH} levels"
        elif isinstance(event, MappingEndEvent | SequenceEndEvent):
            depth -= 1
        elif isinstance(event, ScalarEvent) and (half := _HALF.search(event.value)):
            refusal = (
                f"\\u{ord(half[0]):04x} is half a character, which no text has; write the character itself"
            )
        elif isinstance(event, AliasEvent):
            aliases += 1
            if aliases > kind.maximum_aliases:
                refusal = f"more than {kind.maximum_aliases} aliases; write the values out"
        elif isinstance(event, DocumentStartEvent):
            documents += 1
            if documents > 1:
                refusal = f"a second document; {kind.noun} holds one, without '---' in the middle"
            elif event.version not in (None, (1, 2)):
                version = ".".join(str(number) for number in event.version)
                refusal = f"YAML {version} is asked for; {kind.noun} is YAML 1.2"
        if refusal:
            raise _Refused(mark, refusal)
        yield event


class _Composer:
    """Builds nodes from events; recursion is bounded by MAXIMUM_DEPTH."""

    def __init__(self, events: Iterable[Any], kind: FileKind, problems: ProblemList) -> None:
        self._events = iter(events)
        self._kind = kind
        self._problems = problems
        self._anchors: dict[str, Node | None] = {}  # None while the anchored value is still being read

    def document(self) -> Node | None:
        for event in self._events:
            if isinstance(event, AliasEvent | ScalarEvent | MappingStartEvent | SequenceStartEvent):
                try:
                    return self._node(event, ())
                except _Hopeless:
                    return None
        self._problems.add(Mark(1, 1), (), f"the file is empty; begin with {self._kind.begin}")
        return None

    def _node(self, event: Any, path: KeyPath) -> Node:
        mark = _mark(event)
        if isinstance(event, AliasEvent):
            return self._alias(event.anchor, mark, path)
        if event.tag is not None:
            self._problems.add(
                mark, path, f"the tag '{_tag(event)}' is refused; write the value without a tag"
            )
        if event.anchor:
            self._anchors[event.anchor] = None
        if isinstance(event, ScalarEvent):
            value = event.value if event.style else plain_scalar(event.value)
            node = Node(value, mark)
        elif isinstance(event, SequenceStartEvent):
            node = self._sequence(mark, path)
        else:
            node = self._mapping(mark, path)
        if event.anchor:
            self._anchors[event.anchor] = node
        if node.size > MAXIMUM_NODES or node.depth > MAXIMUM_DEPTH:
            what = f"{MAXIMUM_NODES} values" if node.size > MAXIMUM_NODES else f"{MAXIMUM_DEPTH} levels"
            self._problems.add(mark, (), f"with its aliases written out this has more than {what}")
            raise _Hopeless
        return node

    def _alias(self, name: str, mark: Mark, path: KeyPath) -> Node:
        node = self._anchors.get(name)
        if node is None:
            reason = (
                "stands inside the value it repeats" if name in self._anchors else "has no anchor before it"
            )
            self._problems.add(mark, path, f"the alias '*{name}' {reason}; write the value out")
            return Node(None, mark)
        return node

    def _sequence(self, mark: Mark, path: KeyPath) -> Node:
        items: list[Node] = []
        aliases: Aliases = {}
        for event in self._events:
            if isinstance(event, SequenceEndEvent):
                break
            if isinstance(event, AliasEvent):
                aliases[len(items)] = _mark(event)
            items.append(self._node(event, (*path, len(items))))
        return sequence(mark, items, aliases)

    def _mapping(self, mark: Mark, path: KeyPath) -> Node:
        entries: dict[str, Node] = {}
        keys: dict[str, Mark] = {}
        aliases: Aliases = {}
        for event in self._events:
            if isinstance(event, MappingEndEvent):
                break
            at = _mark(event)
            key = self._key(event, at, path)
            if key is None or key in entries:
                muted = ProblemList(self._problems.file)
                self._problems, loud = muted, self._problems
                self._node(next(self._events), path)
                self._problems = loud
                if key is not None:
                    message = f"repeated key '{key}': it stands at line {keys[key].line} already; keep one"
                    self._problems.add(at, (*path, key), message, spoils=False)
                    self._problems.repeated.add((*path, key))
                continue
            keys[key] = at
            written = next(self._events)
            if isinstance(written, AliasEvent):
                aliases[key] = _mark(written)
            entries[key] = self._node(written, (*path, key))
        return mapping(mark, entries, keys, aliases)

    def _key(self, event: Any, mark: Mark, path: KeyPath) -> str | None:
        """Return the text of a key; None where it is refused (its value is then passed over)."""
        if not isinstance(event, ScalarEvent) or event.value == "" or event.tag is not None:
            self._node(event, path)
            if isinstance(event, AliasEvent) or event.tag is None:
                self._problems.add(mark, path, "a key must be plain text")
            return None
        if event.anchor:
            self._anchors[event.anchor] = Node(event.value, mark)
        if event.value == "<<" and not event.style:
            self._problems.add(
                mark,
                (*path, "<<"),
                "merge keys are not part of YAML 1.2; write the keys out, or repeat a whole value",
            )
            return None
        return str(event.value)


def _mark(event: Any) -> Mark:
    return Mark(event.start_mark.line + 1, event.start_mark.column + 1)


def _tag(event: Any) -> str:
    return str(event.tag).replace("tag:yaml.org,2002:", "!!")
