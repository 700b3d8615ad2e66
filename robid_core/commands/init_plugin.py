"""The package that `robid init --plugin` writes: a plugin that runs, its entry point, its test."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from robid_core.commands.init import fill, project_name

TEMPLATES = Path(__file__).with_name("templates") / "plugin"


@dataclass(frozen=True)
class PluginKind:
    """A kind of plugin: what it is in words, its class in the template, where and how it is registered and tried."""

    what: str
    cls: str
    group: str
    family: str
    check: str
    use: str


STAGE = 'In a pipeline: `{stage}: {{use: {plugin}}}`; in Python: `robid.use("{plugin}")`.'
KINDS = {
    "estimator": PluginKind("An estimator of frequency responses", "MeanOfBlocks", "robid.stages", "frf", "check_stage",
        STAGE.replace("{stage}", "frf")),
    "effect": PluginKind("An effect", "Churning", "robid.effects", "friction", "check_effect",
        "In a robot file: `effects: {{oil: {{use: {plugin}, on: axis_1}}}}`; a diagnosis tries it, too."),
    "fit": PluginKind("A fit", "SpringFit", "robid.stages", "fit", "check_stage", STAGE.replace("{stage}", "fit")),
    "report": PluginKind("A page", "ParameterPage", "robid.stages", "report", "check_stage",
        STAGE.replace("{stage}", "page")),
}  # fmt: skip


def plugin_files(folder: Path, kind: str) -> dict[str, str]:
    """Return the texts of a new package by file name; ConfigurationError for a kind that there is not."""
    from robid_core.errors import ConfigurationError
    from robid_core.yaml_file.problems import suggestion

    if kind not in KINDS:
        raise ConfigurationError(f"no plugin of kind '{kind}'; {suggestion(kind, list(KINDS), 'there are')}")
    chosen = KINDS[kind]
    short = re.sub(r"[^a-z0-9]+", "_", project_name(folder).lower()).strip("_").removeprefix("robid_")
    plugin = f"{chosen.family}.{short}"
    values = {
        "DISTRIBUTION": f"robid-{short.replace('_', '-')}",
        "PACKAGE": f"robid_{short}",
        "PLUGIN": plugin,
        "GROUP": chosen.group,
        "CLASS": chosen.cls,
        "CHECK": chosen.check,
        "FUNCTION": short,
        "WHAT": chosen.what,
        "USE": chosen.use.format(plugin=plugin),
    }
    sources = {
        "pyproject.toml": "pyproject",
        "README.md": "readme",
        f"{values['PACKAGE']}/__init__.py": kind,
        f"tests/test_{short}.py": "test",
    }
    files = {
        target: fill((TEMPLATES / f"{source}.template").read_text(encoding="utf-8"), values)
        for target, source in sources.items()
    }
    return {**files, f"{values['PACKAGE']}/py.typed": ""}
