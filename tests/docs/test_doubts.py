"""The page on reading a page names every doubt and remark that the code can state, and no other."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from robid_core.artifacts import doubts

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reading_the_page.md"


def stated() -> set[str]:
    """Return the kinds of doubts that core and plugins make."""
    found = set()
    for folder in ("robid_core", "plugins"):
        for file in (ROOT / folder).rglob("*.py"):
            if "testing" in file.parts or "Doubt(" not in (text := file.read_text(encoding="utf-8")):
                continue
            for call in ast.walk(ast.parse(text)):
                if isinstance(call, ast.Call) and ast.unparse(call.func) == "Doubt" and call.args:
                    kind = call.args[0]
                    found.add(
                        kind.value if isinstance(kind, ast.Constant) else getattr(doubts, ast.unparse(kind))
                    )
    return found


def test_every_doubt_of_the_code_is_on_the_page_and_every_one_on_the_page_in_the_code() -> None:
    section = (
        PAGE.read_text(encoding="utf-8")
        .partition("list of *doubts*")[2]
        .partition("Warnings of the stages")[0]
    )
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    remarks = section.partition("*Remarks*")[2]
    named = set(re.findall("`([a-z ]+)`", " ".join(rows) + remarks))
    assert named == stated()
