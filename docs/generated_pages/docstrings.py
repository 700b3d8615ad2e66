"""Docstrings on their way into pages: bars are absolute values there and not markup, and a colon is a colon."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

_CODE = re.compile(r"(``.*?``|`[^`]*`)", re.DOTALL)
_BEFORE_NAPOLEON, _AFTER_NAPOLEON = 100, 900
_untouched: dict[str, list[str]] = {}


def prose(text: str) -> str:
    """Return a docstring in which bars outside code are escaped; indented blocks stay as they are."""
    parts = _CODE.split(text)
    parts[::2] = [
        "\n".join(line if line.startswith("    ") else line.replace("|", "\\|") for line in part.split("\n"))
        for part in parts[::2]
    ]
    return "".join(parts)


def use_plain_attributes(app: Sphinx) -> None:
    """Keep napoleon from taking what stands before a colon in an attribute's docstring for its type."""
    app.connect("autodoc-process-docstring", _keep, priority=_BEFORE_NAPOLEON)
    app.connect("autodoc-process-docstring", _restore, priority=_AFTER_NAPOLEON)


def _keep(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    del app, obj, options
    lines[:] = prose("\n".join(lines)).split("\n")
    if what in ("attribute", "property", "data"):
        _untouched[name] = list(lines)


def _restore(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    del app, what, obj, options
    if name in _untouched:
        lines[:] = _untouched.pop(name)
