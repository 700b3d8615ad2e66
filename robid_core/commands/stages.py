"""`robid stages`: all plugins, effects among them, with where they come from, or one of them explained."""

from __future__ import annotations

import functools
import inspect
import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from pydantic import BaseModel

    from robid_core.effect import Effect
    from robid_core.registry import Plugin

Row = tuple[str, ...]


def command(
    name: Annotated[
        str | None, typer.Argument(help="Explain this plugin, as frf.log or friction.lugre.")
    ] = None,
) -> None:
    """List every installed plugin with its package and version, or explain one."""
    from robid_core.commands.trial import loaded_apart
    from robid_core.errors import ConfigurationError
    from robid_core.registry import GROUPS, registry
    from robid_core.yaml_file.problems import suggestion

    plugins = [plugin for group in GROUPS for plugin in registry().plugins(group)]
    if name is None:
        typer.echo("\n".join(table([("NAME", "GROUP", "PACKAGE", "WHAT IT IS"), *map(row, plugins)])))
        return
    short = name.rpartition(":")[2]
    chosen = [
        plugin
        for plugin in plugins
        if plugin.name == short and name in (short, f"{plugin.distribution}:{short}")
    ]
    if not chosen:
        names = sorted({plugin.name for plugin in plugins})
        raise ConfigurationError(f"no plugin '{name}'; {suggestion(name, names, 'there are')}")
    pages = [loaded_apart(plugin, functools.partial(explain, plugin)) for plugin in chosen]
    typer.echo("\n\n".join("\n".join(page) for page in pages))


def table(rows: list[Row]) -> list[str]:
    """Return rows of text as aligned lines."""
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    return [
        "  ".join(f"{cell:{width}}" for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in rows
    ]


def row(plugin: Plugin) -> Row:
    """Return one line of the list; a plugin that cannot be imported, or used, says why."""
    from robid_core.commands.trial import loaded_apart
    from robid_core.errors import ExtraMissing, PluginError
    from robid_core.registered import check_registered

    def checked(loaded: Any) -> str:
        check_registered(plugin, loaded)
        return summary(loaded)

    try:
        what = loaded_apart(plugin, checked)
    except ExtraMissing as error:
        what = f"not installed: {error}"
    except PluginError as error:
        what = f"FAILS: {' '.join(str(error).split())}"
    group = plugin.group.removeprefix("robid.")
    return plugin.name, group, f"{plugin.distribution} {plugin.version}", what


def summary(plugin: Any) -> str:
    """Return the first line of an object's docstring."""
    return (inspect.getdoc(plugin) or "").partition("\n")[0].rstrip(".")


def explain(plugin: Plugin, loaded: Any) -> list[str]:
    """Return everything a user needs to know of a plugin and of what it registers."""
    from robid_core.pipeline.checking import settings_model
    from robid_core.registry import DRIVES, EFFECTS, EXECUTORS, STAGES
    from robid_core.robot import Robot

    lines = [f"{plugin.name}: {plugin.group}, {plugin.distribution} {plugin.version}, {plugin.target}"]
    if plugin.group == EFFECTS:
        return lines + explain_effect(plugin.name, loaded)
    if plugin.group == STAGES:
        takes = [f"{entry.name}: {entry.noun}" for entry in loaded.inputs()]
        takes += [
            f"{name}: Robot (the nominal one; `inputs: {{{name}: fit}}` takes that of a fit)"
            for name, kind in loaded.lends().items()
            if kind is Robot
        ]
        lines.append(f"takes {', '.join(takes) or 'nothing'}; makes {loaded.output.__name__}")
    lines += ["", inspect.getdoc(loaded) or "(no description)"]
    if plugin.group in (STAGES, DRIVES, EXECUTORS):
        model = settings_model(loaded)
        rows = setting_rows(model)
        lines += ["", "Settings", *(f"  {line}" for line in table(rows))] if rows else ["", "No settings."]
        lines += ["", "To paste", "", *paste(plugin, model)]
    return lines


def explain_effect(name: str, effect: type[Effect]) -> list[str]:
    """Return where an effect acts, its theory and source, its table, and YAML for a robot file."""
    from robid_core.commands import effect_screen as screen

    rows = screen.parameter_rows(effect)
    lines = [screen.kind_line(effect), "", *screen.theory(effect)]
    lines += ["", "Parameters", *(f"  {line}" for line in table(rows))] if rows else ["", "No parameters."]
    return [*lines, "", "To paste into a robot.yaml", "", *screen.paste(name, effect)]


def setting_rows(model: type[BaseModel]) -> list[Row]:
    """Return name, type, default and meaning of every setting."""
    properties = model.model_json_schema(by_alias=True)
    rows: list[Row] = []
    for name, info in model.model_fields.items():
        schema = properties["properties"].get(info.alias or name, {})
        default = "required" if info.is_required() else json.dumps(schema.get("default"))
        meaning = " ".join((info.description or "").split())
        rows.append((info.alias or name, kind_of(schema, properties.get("$defs", {})), default, meaning))
    return rows


def kind_of(schema: dict[str, Any], definitions: dict[str, Any]) -> str:
    """Return the type of a setting in words: `integer > 0`, `list of 2 numbers`, `D or A`."""
    if "$ref" in schema:
        return kind_of(definitions.get(schema["$ref"].rpartition("/")[2], {}), definitions)
    if "anyOf" in schema:
        return " or ".join(dict.fromkeys(kind_of(option, definitions) for option in schema["anyOf"]))
    if "enum" in schema or "const" in schema:
        return " or ".join(str(value) for value in schema.get("enum", [schema.get("const")]))
    if schema.get("type") == "array":
        items = schema.get("prefixItems") or [schema.get("items", {})]
        inner = " | ".join(dict.fromkeys(kind_of(item, definitions) for item in items))
        return f"list of {len(items)} ({inner})" if "prefixItems" in schema else f"list of {inner}"
    words = {"object": "mapping", "string": "text", "boolean": "true or false"}
    bounds = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    limits = [f"{sign} {schema[key]:g}" for key, sign in bounds.items() if key in schema]
    kind = str(schema.get("type", "anything"))
    return " ".join([words.get(kind, kind), *limits])


def paste(plugin: Plugin, model: type[BaseModel]) -> list[str]:
    """Return YAML that uses the plugin, required settings to be filled in, the others at their defaults."""
    from robid_core.registry import STAGES

    rows = setting_rows(model)
    key = plugin.name.partition(".")[0] if plugin.group == STAGES else plugin.group.removeprefix("robid.")
    lines = [f"{key.removesuffix('s') if key == 'executors' else key}:", f"  use: {plugin.name}"]
    required = [name for name, _, default, _ in rows if default == "required"]
    lines += ["  with:"] if rows else []
    for name, kind, default, _ in rows:
        value = f"...  # {kind}" if name in required else default
        comment = "" if required and name in required else "# "
        lines.append(f"    {comment}{name}: {value}")
    if rows and not required:
        lines[2] = "  # with:"
    return lines
