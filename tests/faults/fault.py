"""A fault, what the user sees of it, and the line without which the user would not: said at the test that tries it.

    from faults.fault import fault

    @fault(
        "A02",
        sees="exit 5: file and member, \\"copy it again\\"",
        mutant=("adapters/robid_tables/npz.py", "archive.read(member)", "bytes(8)"),
    )
    def test_a_changed_byte_in_the_data_is_noticed(tmp_path: Path) -> None: ...

The id is one of the list of faults: B bus, D drives and motion, A acquisition and data, N numerics, R run, store
and plugins, Y YAML, report and paths. A mutant is a line of a file that stands there once, and the line that breaks
it; a test that has several promises may carry several faults. `sees` is what a person reads or finds, `without` (in
place of a mutant) says why no single line could be broken.

`docs/tested_faults.md` is made from all this by `python tests/faults/table.py`, and a test holds it to that. Everything
is read from the source of the tests, so arguments are texts, or names that the module gives to texts. A plain run looks
whether each mutant's line still stands, and tries one; `pytest -m full tests/mutants` breaks every one in a copy of the
sources and runs its test, which must fail (`tests/mutants/run.py`).
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import pytest
from mutants.mutant import Mutant

NAME = "fault"
Test = TypeVar("Test", bound=Callable[..., Any])


@dataclass(frozen=True)
class Fault:
    """One entry of the table; `test` is pytest's name of the test, from the root of the repository."""

    identifier: str
    sees: str
    test: str
    mutant: Mutant | None
    without: str


def fault(
    identifier: str, *, sees: str, mutant: tuple[str, str, str] | None = None, without: str = ""
) -> Callable[[Test], Test]:
    """Say which fault a test tries, what the user sees, and which broken line the test catches (file, old, new)."""
    if (mutant is None) != bool(without):
        raise TypeError(f"{identifier}: give a mutant, or say why there is none (without)")
    mark = pytest.mark.fault(identifier, sees=sees)

    def marked(test: Test) -> Test:
        result: Test = mark(test)
        return result

    return marked


def faults_in(folder: Path, root: Path) -> list[Fault]:
    """Return the faults that the tests below a folder try, by id, then by test."""
    found = [one for file in sorted(folder.rglob("test_*.py")) for one in _of_file(file, root)]
    return sorted(found, key=lambda one: (one.identifier, one.test, one.sees))


def _of_file(file: Path, root: Path) -> Iterator[Fault]:
    text = file.read_text(encoding="utf-8")
    if f"@{NAME}(" not in text:
        return
    place = file.relative_to(root).as_posix()
    tree = ast.parse(text)
    named = _Constants(tree)
    for node in ast.walk(tree):
        for call in node.decorator_list if isinstance(node, ast.FunctionDef) else ():
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == NAME:
                given = {item.arg: ast.literal_eval(named.visit(item.value)) for item in call.keywords}
                test = f"{place}::{node.name}"
                mutant = given.get("mutant")
                yield Fault(
                    identifier=ast.literal_eval(call.args[0]),
                    sees=given["sees"],
                    test=test,
                    mutant=None
                    if mutant is None
                    else Mutant(f"{node.name}: {mutant[2].strip()}", *mutant, test),
                    without=given.get("without", ""),
                )


class _Constants(ast.NodeTransformer):
    """Puts the texts that a module gives names to in the place of the names."""

    def __init__(self, tree: ast.Module) -> None:
        self._texts = {
            target.id: node.value
            for node in tree.body
            if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
            for target in node.targets
            if isinstance(target, ast.Name)
        }

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Return what a name stands for."""
        return self._texts.get(node.id, node)
