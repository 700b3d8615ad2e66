"""A YAML file as a tree of nodes that know where they stand (faults Y03 and Y06 to Y10).

The parser's events are counted before anything is built: depth, aliases. The tree is then composed here,
because every key and value must keep its line and column, repeated keys must name both lines, tags are
refused where they stand, and an alias must not blow up: its size counts at every use.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
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

from robid_core.pipeline.problems import Mark, Path, ProblemList
from robid_core.pipeline.scalars import Scalar, plain_scalar

MAXIMUM_DEPTH = 32
MAXIMUM_ALIASES = 64
MAXIMUM_NODES = 100_000  # aliases expanded; a file of 256 KiB without aliases cannot have more to say


@dataclass(frozen=True, eq=False)
class Node:
    """A value with its place; `keys` holds the places of a mapping's keys, which messages point at."""

    value: Scalar | list[Node] | dict[str, Node]
    mark: Mark
    keys: dict[str, Mark] = field(default_factory=dict)
    size: int = 1
    depth: int = 1

    def get(self, key: str) -> Node | None:
        """Return the value under a key of a mapping; None where there is none."""
        return self.value.get(key) if isinstance(self.value, dict) else None

    def entries(self) -> dict[str, Node]:
        """Return the entries of a mapping; empty for anything else."""
        return self.value if isinstance(self.value, dict) else {}

    def plain(self) -> Any:
        """Return the value as Python builtins."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return self.value

    def find(self, path: Path) -> Node | None:
        """Return the node at a path; None where it does not exist."""
        node: Node | None = self
        for part in path:
            if node is not None and isinstance(node.value, list) and isinstance(part, int):
                node = node.value[part] if part < len(node.value) else None
            else:
                node = node.get(str(part)) if node is not None else None
        return node

    def at(self, path: Path) -> tuple[Path, Mark]:
        """Follow a path as far as it exists.

        Returns the existing part and the place to point at: the key where there is one, else the item. Steps
        that are not there (names that a validator adds) are skipped.
        """
        node, mark, found = self, self.mark, []
        for part in path:
            if isinstance(node.value, dict) and part in node.value:
                mark = node.keys[str(part)]
                node = node.value[str(part)]
            elif isinstance(node.value, list) and isinstance(part, int) and part < len(node.value):
                node = node.value[part]
                mark = node.mark
            else:
                continue
            found.append(part)
        return tuple(found), mark


def mapping(mark: Mark, entries: dict[str, Node], keys: dict[str, Mark]) -> Node:
    """Return a mapping node."""
    size = 1 + sum(node.size for node in entries.values())
    return Node(entries, mark, keys, size, 1 + max((node.depth for node in entries.values()), default=0))


def sequence(mark: Mark, items: list[Node]) -> Node:
    """Return a list node."""
    size = 1 + sum(node.size for node in items)
    return Node(items, mark, {}, size, 1 + max((node.depth for node in items), default=0))


def read_document(text: str, problems: ProblemList) -> Node | None:
    """Return the root of a document, or None where it cannot be read as YAML; problems are collected."""
    try:
        events = list(_scan(text, problems))
    except _Hopeless:
        return None
    except MarkedYAMLError as error:
        _tell_syntax(error, problems)
        return None
    except YAMLError as error:
        problems.add(Mark(1, 1), (), f"not YAML: {' '.join(str(error).split())}")
        return None
    return _Composer(events, problems).document()


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


class _Hopeless(Exception):
    """The document was refused; the problem is in the list."""


def _scan(text: str, problems: ProblemList) -> Iterator[Any]:
    """Yield the parser's events, refusing what could hurt before it is built."""
    depth = aliases = documents = 0
    for event in YAML(typ="safe", pure=True).parse(text):
        mark = Mark(event.start_mark.line + 1, event.start_mark.column + 1)
        refusal = ""
        if isinstance(event, MappingStartEvent | SequenceStartEvent):
            depth += 1
            if depth > MAXIMUM_DEPTH:
                refusal = f"nested deeper than {MAXIMUM_DEPTH} levels"
        elif isinstance(event, MappingEndEvent | SequenceEndEvent):
            depth -= 1
        elif isinstance(event, AliasEvent):
            aliases += 1
            if aliases > MAXIMUM_ALIASES:
                refusal = f"more than {MAXIMUM_ALIASES} aliases; write the values out"
        elif isinstance(event, DocumentStartEvent):
            documents += 1
            if documents > 1:
                refusal = "a second document; a pipeline file holds one, without '---' in the middle"
            elif event.version not in (None, (1, 2)):
                refusal = "YAML {}.{} is asked for; pipeline files are YAML 1.2".format(*event.version)
        if refusal:
            problems.add(mark, (), refusal)
            raise _Hopeless
        yield event


class _Composer:
    """Builds nodes from events; recursion is bounded by MAXIMUM_DEPTH."""

    def __init__(self, events: list[Any], problems: ProblemList) -> None:
        self._events = iter(events)
        self._problems = problems
        self._anchors: dict[str, Node | None] = {}  # None while the anchored value is still being read

    def document(self) -> Node | None:
        for event in self._events:
            if isinstance(event, AliasEvent | ScalarEvent | MappingStartEvent | SequenceStartEvent):
                try:
                    return self._node(event, ())
                except _Hopeless:
                    return None
        self._problems.add(Mark(1, 1), (), "the file is empty; begin with `robid: 1`, or see `robid init`")
        return None

    def _node(self, event: Any, path: Path) -> Node:
        mark = Mark(event.start_mark.line + 1, event.start_mark.column + 1)
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
            node = sequence(mark, self._items(path))
        else:
            node = self._mapping(mark, path)
        if event.anchor:
            self._anchors[event.anchor] = node
        if node.size > MAXIMUM_NODES or node.depth > MAXIMUM_DEPTH:
            what = f"{MAXIMUM_NODES} values" if node.size > MAXIMUM_NODES else f"{MAXIMUM_DEPTH} levels"
            self._problems.add(mark, (), f"with its aliases written out this has more than {what}")
            raise _Hopeless
        return node

    def _alias(self, name: str, mark: Mark, path: Path) -> Node:
        node = self._anchors.get(name)
        if node is None:
            reason = (
                "stands inside the value it repeats" if name in self._anchors else "has no anchor before it"
            )
            self._problems.add(mark, path, f"the alias '*{name}' {reason}; write the value out")
            return Node(None, mark)
        return node

    def _items(self, path: Path) -> list[Node]:
        items: list[Node] = []
        for event in self._events:
            if isinstance(event, SequenceEndEvent):
                break
            items.append(self._node(event, (*path, len(items))))
        return items

    def _mapping(self, mark: Mark, path: Path) -> Node:
        entries: dict[str, Node] = {}
        keys: dict[str, Mark] = {}
        for event in self._events:
            if isinstance(event, MappingEndEvent):
                break
            at = Mark(event.start_mark.line + 1, event.start_mark.column + 1)
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
            entries[key] = self._node(next(self._events), (*path, key))
        return mapping(mark, entries, keys)

    def _key(self, event: Any, mark: Mark, path: Path) -> str | None:
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


def _tag(event: Any) -> str:
    return str(event.tag).replace("tag:yaml.org,2002:", "!!")
