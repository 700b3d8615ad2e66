"""A robot file as it is judged: its data, where in the file each value stands, and what was found wrong."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robid_core.yaml_file.characters import decode, refuse_size
from robid_core.yaml_file.kind import ROBOT_FILE, of_another_kind
from robid_core.yaml_file.nodes import Node
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.problems import KeyPath, Mark, ProblemList


@dataclass
class Document:
    """A file read: its values with their places, and the mistakes found so far."""

    root: Node
    problems: ProblemList
    names: dict[KeyPath, str] = field(default_factory=dict)
    """What entries of lists are called: said before what is wrong with them."""
    derived: dict[KeyPath, Mark] = field(default_factory=dict)
    """Places of values that are not in the file themselves: of what they were made from."""

    @property
    def data(self) -> dict[str, Any]:
        """What the file says, as Python builtins."""
        return {key: node.plain() for key, node in self.root.entries().items()}

    def mark(self, path: KeyPath) -> Mark:
        """Return the place of a value, or of what holds it where it is not in the file itself."""
        for length in range(len(path), 0, -1):
            found, mark = self.root.at(path[:length])
            if len(found) == length:
                return mark
            if path[:length] in self.derived:
                return self.derived[path[:length]]
        return Mark(1, 1)

    def derive(self, path: KeyPath, origin: KeyPath) -> None:
        """Let `path`, which is not in the file, stand where `origin` stands: it was made from that."""
        self.derived.setdefault(path, self.mark(origin))

    def add(self, path: KeyPath, message: str) -> None:
        """Report a mistake in the entry at a path, unless that is spoiled already."""
        if self.problems.spoils(*path):
            return
        called = next((name for start, name in self.names.items() if path[: len(start)] == start), "")
        if called and not message.startswith(called):
            message = f"{called}: {message}"
        self.problems.add(self.mark(path), path, message, spoils=False)

    def spoil(self, path: KeyPath) -> None:
        """Say nothing more of an entry: what is wrong with it follows from what was told elsewhere."""
        self.problems.spoiled.add(path)


def line_of(path: Path, key: KeyPath) -> str:
    """Return where a key of a robot file stands, as `robot.yaml:17:5`; or what it comes from, a model or a base."""
    document = read_document(path)
    if "dh" in document.root.entries() and key[:1] == ("bodies",):
        key = next(
            (
                found
                for found in (("dh", "links", *key[1:]), ("dh", "links", *key[1:2]))
                if document.root.at(found)[0]
            ),
            key,
        )
    if not document.root.at(key)[0]:
        key = next(((name,) for name in ("base", "model", "dh") if name in document.root.entries()), key)
    mark = document.root.at(key)[1]
    return f"{path.name}:{mark.line}:{mark.column}"


def read_document(path: Path) -> Document:
    """Read a robot file; raises FileProblems where it cannot be read, is no YAML, or no mapping."""
    problems, data = ProblemList(path.name), b""
    try:
        size = path.stat().st_size
        if size > ROBOT_FILE.maximum_bytes:
            refuse_size(size, ROBOT_FILE, problems)
        else:
            data = path.read_bytes()
    except OSError as error:
        problems.add(Mark(1, 1), (), f"cannot be read: {error.strerror}; name a robot.yaml")
    problems.raise_if_any()
    return parse_document(data, path.name)


def parse_document(data: bytes, file: str) -> Document:
    """Make a document of what a robot file holds; raises FileProblems where it is no YAML, or no mapping.

    Repeated keys, tags and aliases that mean nothing are left in `problems`, to be told with what else is wrong.
    """
    problems = ProblemList(file)
    text = decode(data, ROBOT_FILE, problems)
    root = read_nodes(text, ROBOT_FILE, problems) if text is not None else None
    if root is not None and not isinstance(root.value, dict):
        problems.add(root.mark, (), f"a robot file holds keys and values; begin with {ROBOT_FILE.begin}")
        root = None
    if root is not None and (told := of_another_kind(root.entries(), ROBOT_FILE)):
        problems.add(root.mark, (), told)
        root = None
    if root is None:
        problems.raise_if_any()
        raise AssertionError("a document was refused without a problem")
    return Document(root, problems)
