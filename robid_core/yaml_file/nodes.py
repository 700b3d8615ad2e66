"""Values of a file that know where they stand."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from robid_core.yaml_file.problems import KeyPath, Mark
from robid_core.yaml_file.scalars import Scalar

Aliases = dict[str | int, Mark]


@dataclass(frozen=True, eq=False)
class Node:
    """A value with its place.

    `keys` holds the places of a mapping's keys, which messages point at; `aliases` the entries of a mapping or list
    that are written as aliases, with the places of these: the values themselves stand somewhere else.
    """

    value: Scalar | list[Node] | dict[str, Node]
    mark: Mark
    keys: dict[str, Mark] = field(default_factory=dict)
    size: int = 1
    depth: int = 1
    aliases: Aliases = field(default_factory=dict)

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

    def find(self, path: KeyPath) -> Node | None:
        """Return the node at a path; None where it does not exist."""
        node: Node | None = self
        for part in path:
            if node is not None and isinstance(node.value, list) and isinstance(part, int):
                node = node.value[part] if part < len(node.value) else None
            else:
                node = node.get(str(part)) if node is not None else None
        return node

    def at(self, path: KeyPath) -> tuple[KeyPath, Mark]:
        """Follow a path as far as it exists.

        Returns the existing part and the place to point at: the key where there is one, else the item; the alias
        for whatever it repeats. Steps that are not there (names that a validator adds) are skipped.
        """
        node, mark, found, repeated = self, self.mark, [], False
        for part in path:
            if isinstance(node.value, dict) and part in node.value:
                place, inner = node.keys[str(part)], node.value[str(part)]
            elif isinstance(node.value, list) and isinstance(part, int) and part < len(node.value):
                inner = node.value[part]
                place = node.aliases.get(part, inner.mark)
            else:
                continue
            mark = mark if repeated else place
            repeated = repeated or part in node.aliases
            node = inner
            found.append(part)
        return tuple(found), mark


def mapping(
    mark: Mark, entries: dict[str, Node], keys: dict[str, Mark], aliases: Aliases | None = None
) -> Node:
    """Return a mapping node."""
    size = 1 + sum(node.size for node in entries.values())
    depth = 1 + max((node.depth for node in entries.values()), default=0)
    return Node(entries, mark, keys, size, depth, aliases or {})


def sequence(mark: Mark, items: list[Node], aliases: Aliases | None = None) -> Node:
    """Return a list node."""
    size = 1 + sum(node.size for node in items)
    return Node(items, mark, {}, size, 1 + max((node.depth for node in items), default=0), aliases or {})
