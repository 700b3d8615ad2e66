"""Pages of the names that plugins and notebooks import, for autodoc: from the lists in the packages themselves."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterable
from typing import get_origin

from generated_pages.text import code, contents, escaped, heading, literal, table
from robid_core import _HOME

PACKAGES = {
    "robid_core.mechanics": "Mechanics of robots",
    "robid_core.residual": "Torque residual",
    "robid_core.testing": "Contract tests for plugins",
}
TITLES = {
    "robid_core.arrays": "Types of arrays",
    "robid_core.artifacts": "Artifacts",
    "robid_core.drives": "Drives",
    "robid_core.effect": "Effects",
    "robid_core.errors": "Errors",
    "robid_core.foreign": "Files of others",
    "robid_core.gate": "Safety gate",
    "robid_core.interruption": "Interruption",
    "robid_core.notebook": "Stages and runs from Python",
    "robid_core.parameters": "Free parameters",
    "robid_core.pipeline": "Pipelines",
    "robid_core.registered": "Loading plugins",
    "robid_core.registry": "Registry",
    "robid_core.robot": "Robots",
    "robid_core.settings_types": "Types of settings",
    "robid_core.stage": "Stages",
}


def pages() -> dict[str, str]:
    """Return the text of every page by its path."""
    groups: dict[str, list[str]] = {}
    for module, names in _HOME.items():
        groups.setdefault(".".join(module.split(".")[:2]), []).extend(names)
    found = {
        f"python/{module.rpartition('.')[2]}.rst": _page(
            TITLES.get(module, module.rpartition(".")[2]), "robid_core", sorted(names)
        )
        for module, names in sorted(groups.items())
    }
    for module, title in PACKAGES.items():
        exported = importlib.import_module(module).__all__
        found[f"python/{module.rpartition('.')[2]}.rst"] = _page(title, module, exported)
    lines = heading("Python names")
    lines += [
        "Everything that a plugin or a notebook may import. The other modules of robid are internal and may change.",
        "The functions of ``robid_core.estimation`` are imported from their modules, such as",
        "``robid_core.estimation.response.spectra``; their docstrings are read there.",
        "",
    ]
    lines += contents([name.removeprefix("python/").removesuffix(".rst") for name in found], hidden=False)
    return found | {"python/index.rst": "\n".join(lines)}


def _page(title: str, module: str, names: Iterable[str]) -> str:
    lines = heading(title)
    lines += code("python", [f"from {module} import ..."])
    others = []
    for name in names:
        value = getattr(importlib.import_module(module), name)
        if get_origin(value) is not None or not callable(value):
            others.append((literal(name), escaped(_said(value))))
        elif inspect.isclass(value):
            lines += [f".. autoclass:: {module}.{name}", "   :members:", "   :show-inheritance:", ""]
        else:
            lines += [f".. autofunction:: {module}.{name}", ""]
    if others:
        lines += table(("name", "what it is"), others, "30 70")
    return "\n".join(lines)


def _said(value: object) -> str:
    """Return a type or a constant as it would be written."""
    text = str(value).replace("numpy.", "").replace("typing.", "")
    return text if len(text) < 200 else type(value).__name__
