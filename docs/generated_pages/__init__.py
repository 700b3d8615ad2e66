"""Sphinx extension: pages that are written from the code before the site is built, and formulas as MathML.

Written into `docs/reference`, which git ignores: stages, effects with their pictures, keys of a robot file, commands,
names for plugins. A page whose text did not change is left as it is, so that a second build is short.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

from generated_pages import commands, effects, example_run, names, robot_file, stages
from generated_pages.docstrings import use_plain_attributes
from generated_pages.formulas import use_mathml


def setup(app: Sphinx) -> dict[str, Any]:
    """Register what Sphinx calls."""
    app.connect("builder-inited", write_pages)
    use_mathml(app)
    use_plain_attributes(app)
    return {"parallel_read_safe": True}


def show_warnings_only() -> None:
    """Let handlers of the root logger pass warnings and errors only.

    A package of the theme (a11y_pygments) configures the root logger when it is imported, at the level DEBUG; what the
    runs behind the pages log then stood between Sphinx's own lines. Sphinx has handlers of its own.
    """
    for handler in logging.getLogger().handlers:
        handler.setLevel(max(handler.level, logging.WARNING))


def write_pages(app: Sphinx) -> None:
    """Write every page that comes from the code, and remove what nothing writes any more."""
    show_warnings_only()
    folder = Path(app.srcdir) / "reference"
    pages: dict[str, str] = {}
    for part in (stages, effects, robot_file, commands, names, example_run):
        pages |= part.pages()
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    for path in folder.rglob("*"):
        if path.is_file() and str(path.relative_to(folder)) not in pages:
            path.unlink()
