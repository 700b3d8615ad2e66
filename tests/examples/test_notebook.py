"""The notebook runs from its first cell to its last, finds the plant, and is as short as it says."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pytest

from robid_core import Design, Fit, Report, Robot
from robid_core.errors import RobidError

NOTEBOOK = Path(__file__).parents[2] / "examples" / "notebook" / "whole_chain.ipynb"
MOST_LINES = 25


def cells() -> list[str]:
    content = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in content["cells"] if cell["cell_type"] == "code"]


@pytest.fixture(scope="module")
def names() -> dict[str, Any]:
    """What the notebook has defined at its end; each cell's last expression is shown as Jupyter shows it."""
    found: dict[str, Any] = {}
    shown = []
    for source in cells():
        tree = ast.parse(source)
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, NOTEBOOK.name, "exec"), found)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), NOTEBOOK.name, "eval"), found)
            shown.append(value._repr_html_())
    found["shown"] = shown
    return found


def test_the_whole_chain_takes_at_most_25_lines() -> None:
    assert sum(len(source.splitlines()) for source in cells()) <= MOST_LINES


def test_the_notebook_finds_the_spring_of_its_plant(names: dict[str, Any]) -> None:
    fit: Fit = names["fit"]
    name = "gear_stiffness.axis_1"
    true = names["plant"].parameter(name)
    error = float(fit.parameters.standard_error[fit.parameters.names.index(name)])
    assert abs(fit.parameters.value(name) - true) < 4 * error
    assert error < 1e-3 * true
    assert abs(names["robot"].parameter(name) / true - 1) > 0.2  # what it began with


def test_what_comes_after_the_fit_stands_on_it(names: dict[str, Any]) -> None:
    design: Design = names["design"]
    assert design.gap < 1e-3
    assert design.experiments.sum() == 4
    assert names["diagnosis"].time[0].relative_error < 0.01
    page: Report = names["page"]
    assert "From a notebook" in page.html
    assert "gear_stiffness.axis_1" in page.html


def test_every_cell_shows_itself_without_a_script_of_ours(names: dict[str, Any]) -> None:
    assert len(names["shown"]) == len(cells())
    own = [text for text in names["shown"] if "plotly" not in text]
    assert len(own) == 4
    for text in own:
        assert "<script" not in text
    assert "N m/rad" in own[2]


def test_a_robot_that_is_not_there_is_told_in_a_sentence() -> None:
    with pytest.raises(RobidError, match="did you mean 'one_axis'"):
        Robot.load("one_axes")
