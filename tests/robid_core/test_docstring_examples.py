"""Every example in a docstring gives what it says, and whatever a notebook calls has one."""

from __future__ import annotations

import doctest
import importlib
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import robid_core
from robid_core import plot

CORE = Path(robid_core.__file__).parent
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
MODULES = sorted(
    ".".join(path.relative_to(CORE.parent).with_suffix("").parts)
    for path in CORE.rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)

NOTEBOOK = {
    "robid_core.artifacts",
    "robid_core.notebook",
    "robid_core.pipeline",
    "robid_core.robot",
    "robid_core.robot.recorded",
}
"""Homes of the names that a notebook is written with."""
FIGURES = {"robid_core.plot.estimates", "robid_core.plot.figures", "robid_core.plot.recorded"}
"""Where its figures are; what else `robid_core.plot` has the page is made of."""
PLUGINS = {
    "robid_core.arrays",
    "robid_core.drives",
    "robid_core.effect",
    "robid_core.errors",
    "robid_core.foreign",
    "robid_core.gate",
    "robid_core.interruption",
    "robid_core.parameters",
    "robid_core.parameters.tangents",
    "robid_core.registered",
    "robid_core.registry",
    "robid_core.robot.batch",
    "robid_core.robot.effect_columns",
    "robid_core.robot.file.left_out",
    "robid_core.robot.sampling",
    "robid_core.robot.file.model_file",
    "robid_core.robot.forces_along",
    "robid_core.robot.link_meshes",
    "robid_core.robot.side_by_side",
    "robid_core.robot.structure_effect",
    "robid_core.settings_types",
    "robid_core.stage",
}
"""Homes of the names that plugins are written with: their authors read docs/plugins.md."""
WITHOUT = {
    "Robot": {"equivalent_motor_damping", "left_out"},
}
"""What stages call rather than people: needs no example."""


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_hold(name: str) -> None:
    found = doctest.testmod(importlib.import_module(name), optionflags=OPTIONS)
    assert found.attempted, f"{name} has '>>> ' and no example"
    assert not found.failed


def test_every_home_of_public_names_is_for_notebooks_or_for_plugins() -> None:
    assert set(robid_core._HOME) == NOTEBOOK | PLUGINS
    assert not NOTEBOOK & PLUGINS


def has_example(thing: Any) -> bool:
    return ">>> " in (inspect.getdoc(thing) or "")


def own_methods(noun: type) -> Iterator[str]:
    """Yield the public methods that are written in robid, those of its bases among them."""
    for name, method in inspect.getmembers(noun, inspect.isroutine):
        if not name.startswith("_") and (getattr(method, "__module__", "") or "").startswith("robid_core"):
            yield name


def lacking() -> Iterator[tuple[str, str]]:
    """Yield noun and name of what a notebook calls and no example shows.

    A method may be shown by the docstring of its class. Of what all artifacts have, `Artifact` tells.
    """
    nouns = [getattr(robid_core, name) for home in NOTEBOOK for name in robid_core._HOME[home]]
    figures = [getattr(plot, name) for name in plot.__all__]
    figures = [one for one in figures if getattr(one, "__module__", "") in FIGURES]
    assert plot.record in figures
    for noun in [*nouns, *figures]:
        if inspect.isclass(noun):
            shown = inspect.getdoc(noun) or ""
            for name in own_methods(noun):
                inherited = noun is not robid_core.Artifact and hasattr(robid_core.Artifact, name)
                example = has_example(getattr(noun, name)) or (">>> " in shown and f".{name}(" in shown)
                if not example and not (inherited and noun.__dict__.get(name) is None):
                    yield noun.__name__, name
        elif inspect.isfunction(noun) and not has_example(noun):
            yield "robid_core", noun.__name__


def test_every_public_function_has_an_example_for_authors_of_plugins_too() -> None:
    """Base classes are shown by docs/plugins.md."""
    public = [getattr(robid_core, name) for name in robid_core.__all__]
    assert [one.__name__ for one in public if inspect.isfunction(one) and not has_example(one)] == []
    called = ("FreeParameters", "Finding", "MisfitTable", "Experiment", "Context")
    assert [name for name in called if not has_example(getattr(robid_core, name))] == []


def test_what_a_notebook_calls_has_an_example() -> None:
    found: dict[str, set[str]] = {}
    for noun, name in lacking():
        found.setdefault(noun, set()).add(name)
    assert found == WITHOUT
