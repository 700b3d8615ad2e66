"""Settings given on the command line: `stages.fit.with.starts=50`, typed like the file itself."""

from __future__ import annotations

from dataclasses import replace

from robid_core.yaml_file.kind import PIPELINE_FILE
from robid_core.yaml_file.nodes import Node, mapping, sequence
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.problems import KeyPath, Mark, ProblemList, dotted, suggestion


def override(root: Node, text: str, number: int, problems: ProblemList) -> Node:
    """Return the document with one value changed; what cannot be changed goes to `problems`.

    Parameters
    ----------
    root
        The document.
    text
        ``path=value``: keys separated by dots (list items by their number from 0), the value in YAML 1.2.
        A key that is not there is added, except under `stages`.
    number
        Which of the overrides this is; their problems are told in this order.
    problems
        Takes the mistakes; they name the override in place of a line.
    """
    mark = Mark(0, number, text)
    key, equals, value = text.partition("=")
    path = tuple(key.strip().split("."))
    if not equals or not all(path):
        problems.add(mark, (), "write it as path=value, for example stages.fit.with.starts=50")
        return root
    inner = ProblemList(problems.file)
    node = read_nodes(value, PIPELINE_FILE, inner)
    if node is None or inner.problems:
        reason = inner.problems[0].message if value.strip() else "there is no value after '='"
        problems.add(mark, path, reason)
        return root
    return _put(root, path, _marked(node, mark), mark, (), problems)


def _put(node: Node, path: KeyPath, value: Node, mark: Mark, done: KeyPath, problems: ProblemList) -> Node:
    """Return `node` with `value` at `path`; nodes may be shared by aliases, so nothing is changed in place."""
    if not path:
        return value
    part, rest = str(path[0]), path[1:]
    if isinstance(node.value, list):
        if not part.isdigit() or int(part) >= len(node.value):
            problems.add(
                mark, (*done, part), f"the list {dotted(done)} has the items 0 to {len(node.value) - 1}"
            )
            return node
        items = list(node.value)
        items[int(part)] = _put(items[int(part)], rest, value, mark, (*done, part), problems)
        return sequence(node.mark, items)
    entries, keys = dict(node.entries()), dict(node.keys)
    if part not in entries and done == ("stages",):
        problems.add(
            mark, (*done, part), f"no stage '{part}'; {suggestion(part, list(entries), 'there are')}"
        )
        return node
    # A value that must be a mapping but is not is replaced whole: `robot: six_axis` has a long form.
    short = Node({"model": node}, node.mark, {"model": node.mark}) if done == ("robot",) else None
    if short is not None and isinstance(node.value, str):
        entries, keys = dict(short.entries()), dict(short.keys)
    entries[part] = _put(entries.get(part, mapping(mark, {}, {})), rest, value, mark, (*done, part), problems)
    if not rest or part not in keys:
        keys[part] = mark
    return mapping(node.mark, entries, keys)


def _marked(node: Node, mark: Mark) -> Node:
    """Return the node with every place replaced by the override."""
    keys = dict.fromkeys(node.keys, mark)
    if isinstance(node.value, dict):
        return replace(
            node, value={key: _marked(entry, mark) for key, entry in node.value.items()}, keys=keys, mark=mark
        )
    if isinstance(node.value, list):
        return replace(node, value=[_marked(entry, mark) for entry in node.value], mark=mark)
    return replace(node, mark=mark)
