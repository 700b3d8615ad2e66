"""One page for each built-in stage: what it is, takes and makes, its settings, YAML to paste."""

from __future__ import annotations

import inspect
from typing import Any

from generated_pages.docstrings import prose
from generated_pages.text import code, contents, escaped, heading, literal, table
from robid_core.commands.stages import paste, setting_rows, summary
from robid_core.pipeline.checking import settings_model
from robid_core.registry import DRIVES, EXECUTORS, STAGES, Plugin, registry
from robid_core.robot import Robot

KINDS = {
    "design": "Configurations",
    "excitation": "Excitation",
    "acquisition": "Acquisition",
    "compensate": "Compensation",
    "frf": "Frequency responses",
    "fit": "Fits",
    "diagnosis": "Diagnosis",
    "report": "Report",
}
OTHERS = {DRIVES: "Drives", EXECUTORS: "Executors"}


def built_in(group: str) -> list[Plugin]:
    """Return the plugins of a group that robid itself brings."""
    return [plugin for plugin in registry().plugins(group) if plugin.distribution == "robid"]


def pages() -> dict[str, str]:
    """Return the text of every page by its path."""
    stages = built_in(STAGES)
    found = {f"stages/{plugin.name}.rst": _page(plugin) for plugin in stages}
    lines = heading("Stages")
    lines += [
        "A pipeline is a list of stages. Each page is written from the code; ``robid stages NAME`` prints it.",
        "",
    ]
    for kind, title in KINDS.items():
        lines += heading(title, "-")
        rows = [(f":doc:`{p.name}`", summary(p.load())) for p in stages if p.name.startswith(f"{kind}.")]
        lines += table(("stage", "what it does"), rows, "30 70")
    for group, title in OTHERS.items():
        lines += heading(title, "-")
        others = built_in(group)
        found |= {f"stages/{group.partition('.')[2]}.{p.name}.rst": _page(p) for p in others}
        rows = [(f":doc:`{group.partition('.')[2]}.{p.name}`", summary(p.load())) for p in others]
        lines += table(("name", "what it is"), rows, "30 70")
    lines += contents(sorted(name.removeprefix("stages/").removesuffix(".rst") for name in found))
    return found | {"stages/index.rst": "\n".join(lines)}


def _page(plugin: Plugin) -> str:
    loaded = plugin.load()
    name = plugin.name if plugin.group == STAGES else f"{plugin.group.partition('.')[2]}: {plugin.name}"
    lines = heading(name)
    lines += [prose(inspect.getdoc(loaded) or ""), ""]
    if plugin.group == STAGES:
        lines += [f".. include:: ../figures/stage_{plugin.name}.txt", ""]
        lines += _wiring(loaded)
    model = settings_model(loaded)
    rows = setting_rows(model)
    lines += heading("Settings", "-")
    if rows:
        cells = [
            (
                literal(key),
                kind,
                literal(default) if default != "required" else "**required**",
                escaped(meaning),
            )
            for key, kind, default, meaning in rows
        ]
        lines += table(("setting", "type", "default", "meaning"), cells, "22 20 16 42")
    else:
        lines += ["It has none.", ""]
    lines += heading("To paste", "-")
    return "\n".join([*lines, *code("yaml", paste(plugin, model))])


def _wiring(stage: Any) -> list[str]:
    """Say what a stage takes and makes."""
    takes = [(literal(entry.name), literal(entry.noun)) for entry in stage.inputs()]
    takes += [
        (literal(name), f"``Robot``: that of the pipeline; ``inputs: {{{name}: fit}}`` takes that of a fit")
        for name, kind in stage.lends().items()
        if kind is Robot
    ]
    lines = heading("Inputs and output", "-")
    lines += [f"Makes: ``{stage.output.__name__}``.", ""]
    return lines + (table(("input", "what it is"), takes, "30 70") if takes else ["It takes nothing.", ""])
