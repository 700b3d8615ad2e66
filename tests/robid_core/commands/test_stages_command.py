"""`robid stages`: every plugin with its origin; one explained so that its YAML can be pasted."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from typing import Annotated, Literal

import pytest
from pydantic import Field

from robid_core import FrfEstimator, Settings
from robid_core.commands.stages import command, kind_of, paste, row, setting_rows
from robid_core.pipeline.document import read_document
from robid_core.pipeline.problems import ProblemList
from robid_core.registry import STAGES, Plugin, Registry, registry


class Inner(Settings):
    """Inside."""

    order: int = 4


class Everything(FrfEstimator):
    """One of each."""

    count: Annotated[int, Field(ge=1, lt=9)]
    """How many."""
    band: tuple[float, float] = (1.0, 2.0)
    """From and to."""
    names: tuple[str, ...] = ()
    form: Literal["matrix", "element"] = "matrix"
    flag: bool = False
    limit: float | None = None
    inner: Inner = Inner()


def plugin(target: str, name: str = "frf.everything") -> Plugin:
    return Plugin(STAGES, name, target, "somebody", "3.1", EntryPoint(name, target, STAGES))


def test_settings_are_told_in_words() -> None:
    assert setting_rows(Everything) == [
        ("count", "integer >= 1 < 9", "required", "How many."),
        ("band", "list of 2 (number)", "[1.0, 2.0]", "From and to."),
        ("names", "list of text", "[]", ""),
        ("form", "matrix or element", '"matrix"', ""),
        ("flag", "true or false", "false", ""),
        ("limit", "number or null", "null", ""),
        ("inner", "mapping", '{"order": 4}', ""),
    ]


def test_what_is_to_be_pasted_is_yaml_once_the_gaps_are_filled() -> None:
    lines = paste(plugin("x:y"), Everything)
    assert lines[:4] == ["frf:", "  use: frf.everything", "  with:", "    count: ...  # integer >= 1 < 9"]
    text = "\n".join(line.replace("# ", "", 1) if line.strip().startswith("#") else line for line in lines)
    root = read_document(text.replace("...", "3"), ProblemList("x"))
    assert root is not None
    values = root.plain()["frf"]["with"]
    stage = Everything.model_validate_json(__import__("json").dumps(values), strict=True)
    assert stage == Everything(count=3)


def test_a_plugin_that_fails_is_a_line_and_no_failure() -> None:
    name, group, package, what = row(plugin("robid_no_such_module:Stage"))
    assert (name, group, package) == ("frf.everything", "stages", "somebody 3.1")
    assert what.startswith("FAILS: 'frf.everything' (somebody 3.1) needs the module robid_no_such_module")


def test_every_installed_stage_can_be_explained(capsys: pytest.CaptureFixture[str]) -> None:
    for name in registry().names(STAGES):
        command(name)
        out = capsys.readouterr().out
        assert out.startswith(f"{name}: robid.stages, ")
        assert "To paste" in out


def test_the_list_has_every_plugin_once(capsys: pytest.CaptureFixture[str]) -> None:
    command(None)
    lines = capsys.readouterr().out.splitlines()
    found = Registry([p.entry_point for p in registry().plugins(STAGES)])
    for name in found.names(STAGES):
        assert sum(line.startswith(f"{name} ") for line in lines) == 1


def test_an_unknown_type_is_told_as_anything() -> None:
    assert kind_of({}, {}) == "anything"
