"""Exit codes in the documentation and in `robid --help` are those of the classes of errors."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from typer.testing import CliRunner

from robid_core import errors
from robid_core.commands.app import build

CODES = {0, 130} | {
    kind.exit_code
    for kind in vars(errors).values()
    if inspect.isclass(kind) and issubclass(kind, errors.RobidError)
}


def test_the_page_of_faults_lists_all_exit_codes() -> None:
    page = Path(__file__).parents[2] / "docs" / "faults.md"
    table = page.read_text(encoding="utf-8").partition("## Exit codes")[2].partition("##")[0]
    assert {int(code) for code in re.findall(r"^\| (\d+) \|", table, re.MULTILINE)} == CODES


def test_the_help_lists_all_exit_codes() -> None:
    words = CliRunner().invoke(build([], debug=False), ["--help"]).output.partition("Exit codes:")[2]
    assert {int(code) for code in re.findall(r"\d+", words)} == CODES
