"""Pieces of reStructuredText that several pages are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def heading(text: str, line: str = "=") -> list[str]:
    """Return a heading and an empty line."""
    return [text, line * len(text), ""]


def literal(text: str) -> str:
    """Return text set as code; empty stays empty."""
    return f"``{text}``" if text else ""


def table(head: Sequence[str], rows: Iterable[Sequence[str]], widths: str = "auto") -> list[str]:
    """Return a table whose cells are reStructuredText of one line."""
    lines = [".. list-table::", "   :header-rows: 1", f"   :widths: {widths}", ""]
    for row in (head, *rows):
        for i, cell in enumerate(row):
            lines.append(f"   {'*' if i == 0 else ' '} - {cell}".rstrip())
    return [*lines, ""]


def code(language: str, lines: Iterable[str]) -> list[str]:
    """Return a block of code."""
    return [f".. code-block:: {language}", "", *(f"   {line}".rstrip() for line in lines), ""]


def contents(names: Iterable[str], depth: int = 1, hidden: bool = True) -> list[str]:
    """Return a table of contents of pages by name."""
    flags = ["   :hidden:"] if hidden else []
    return [".. toctree::", *flags, f"   :maxdepth: {depth}", "", *(f"   {name}" for name in names), ""]


def escaped(text: str) -> str:
    """Return plain words (help texts, descriptions) in which no sign means markup but single backquotes."""
    return text.replace("\\", "\\\\").replace("*", "\\*").replace("|", "\\|").replace("_ ", "\\_ ")
