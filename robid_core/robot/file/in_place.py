"""A model put into the robot file that it came from: numbers change where they stand, all else stays as it is written.

Only the characters of the numbers are replaced; comments, order and layout are the file's. A number that the file does
not have goes under `parameters:` of a derived file, or into its mapping. What comes from somewhere else (a data
sheet, a model file) cannot be changed here; bodies of a Denavit-Hartenberg table can. The result is read again: it is
the model's robot, to rounding where a table stands, or it is refused.
"""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.nodes import CollectionNode, MappingNode, Node, ScalarNode, SequenceNode

from robid_core.artifacts import Model
from robid_core.errors import ConfigurationError, RobidError
from robid_core.robot.file.changes import described
from robid_core.robot.file.denavit_hartenberg import DenavitHartenbergTable, in_table
from robid_core.robot.file.derived_file import COLUMN, key_text, known_of
from robid_core.robot.file.description import RobotDescription
from robid_core.robot.file.document import parse_document
from robid_core.robot.file.named_parameters import layout_of, number_at
from robid_core.robot.file.part import with_tuples
from robid_core.robot.file.reading import parse_description
from robid_core.robot.file.writing import robot_sha256
from robid_core.yaml_file.problems import KeyPath

ROUNDING = 1e-13  # of lengths in a table, m, that are taken off and put on again


class Edit(NamedTuple):
    """Characters `start` to `end` of a text, and what comes in their place."""

    start: int
    end: int
    text: str


def with_model(text: str, path: Path, model: Model) -> str:
    """Return the text of the robot file `path` with the numbers of a model in it.

    Raises
    ------
    ConfigurationError
        Where the file is not the robot that the model began with, or some number has no place in it.
    """
    fitted, base = described(model), parse_description(text, path)
    if robot_sha256(base) != model.base_sha256:
        raise ConfigurationError(
            f"{path}: {base.name} has changed since the fit was made from it; run the pipeline again"
        )
    root = YAML(typ="safe", pure=True).compose(io.StringIO(text))
    table = None
    if _find(root, ("dh",)) is not None:
        written = parse_document(text.encode("utf-8"), path.name).data["dh"]
        table = DenavitHartenbergTable.model_validate(with_tuples(written))
    derived = _find(root, ("base",)) is not None
    edits: list[Edit] = []
    added: dict[str, str] = {}
    layout = layout_of(base)
    homeless = [name for name in model.names if name not in layout]
    for name, value in zip(model.names, model.value.tolist(), strict=True):
        if name in homeless or value == number_at(base, layout[name]):
            continue
        place, number = layout[name].path, value
        if table is not None:
            place, number = in_table(table, place, number)
        found = _in_place(text, root, name, place, number, derived)
        edits += found
        if derived and not found:
            added[name] = f"{key_text(name)}: {value!r}"
        elif not found:
            homeless.append(name)
    if added:
        edits.append(_under_parameters(text, root, added, known_of(model)))
    for edit in sorted(edits, key=lambda edit: edit.start)[
        ::-1
    ]:  # from the end; the first at a place goes in last
        text = text[: edit.start] + edit.text + text[edit.end :]
    if homeless or not _is(text, path, fitted, exactly=table is None):
        what = ", ".join(homeless) or "some effect, or a number that stands for others too (an alias)"
        raise ConfigurationError(
            f"{path}: there is no place of its own for {what}; take the robot file that the run wrote: it names this "
            "one as its base"
        )
    return text


def _is(text: str, path: Path, wanted: RobotDescription, exactly: bool) -> bool:
    try:
        found = parse_description(text, path)
    except RobidError:
        return False
    return found == wanted if exactly else _alike(found.model_dump(), wanted.model_dump())


def _alike(one: Any, other: Any) -> bool:
    """Whether plain data are the same but for the rounding of numbers."""
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=ROUNDING, abs_tol=ROUNDING)
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_alike(one[key], other[key]) for key in one)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(_alike(a, b) for a, b in zip(one, other, strict=True))
    return bool(one == other)


def _in_place(text: str, root: Node, name: str, path: KeyPath, value: float, derived: bool) -> list[Edit]:
    """Return what sets a number where it stands, or in the mapping where it would; nothing where there is neither."""
    places: list[KeyPath] = [("parameters", name)] if derived else []
    places += [path, (*path[:-2], path[-1], path[-2])] if "inertia" in path else [path]
    found = [node for place in places if isinstance(node := _find(root, place), ScalarNode)]
    if found:
        ends = {(node.start_mark.index, node.end_mark.index) for node in found}
        return [Edit(start, end, repr(value)) for start, end in sorted(ends)]
    holder, key = _find(root, path[:-1]), path[-1]
    if derived or not isinstance(holder, MappingNode) or not holder.value or not isinstance(key, str):
        return []
    if _find(holder, ("data_sheet",)) is not None:
        return []
    return [_inserted(text, holder, [f"{key}: {value!r}"])]


def _under_parameters(text: str, root: Node, added: dict[str, str], known: dict[str, str]) -> Edit:
    """Return what puts numbers under `parameters:`, with what is known of them where lines have room for it."""
    lines = [f"{entry:{COLUMN}}  # {known[name]}" for name, entry in added.items()]
    holder = _find(root, ("parameters",))
    if isinstance(holder, MappingNode) and holder.flow_style:
        return _inserted(text, holder, list(added.values()))
    if isinstance(holder, MappingNode):
        return _inserted(text, holder, lines)
    assert isinstance(root, MappingNode)
    if root.flow_style:
        return _inserted(text, root, [f"parameters: {{{', '.join(added.values())}}}"])
    return _inserted(text, root, ["parameters:", *(f"  {line}" for line in lines)])


def _inserted(text: str, holder: MappingNode, entries: list[str]) -> Edit:
    """Return what adds entries to a mapping, after its last one."""
    if holder.flow_style:
        at = holder.end_mark.index - 1
        return Edit(at, at, (", " if holder.value else "") + ", ".join(entries))
    indent = " " * holder.value[0][0].start_mark.column
    last = _end(holder)
    at = text.find("\n", last) if "\n" in text[last:] else len(text)
    return Edit(at, at, "".join(f"\n{indent}{entry}" for entry in entries))


def _end(node: Node) -> int:
    """Return where the last character of a node stands: a block's own mark is behind the comments that follow it."""
    if not isinstance(node, CollectionNode) or node.flow_style or not node.value:
        return int(node.end_mark.index)
    last = node.value[-1]
    return _end(last[1] if isinstance(node, MappingNode) else last)


def _find(node: Node | None, path: KeyPath) -> Node | None:
    """Return what stands at a path, None where nothing does."""
    for step in path:
        if isinstance(node, MappingNode):
            node = next((value for key, value in node.value if key.value == step), None)
        elif isinstance(node, SequenceNode) and isinstance(step, int) and step < len(node.value):
            node = node.value[step]
        else:
            return None
    return node
