"""The JSON schema of pipeline.yaml with every installed plugin, for completion and checks in editors.

Draft 7, which is what editors read: pydantic's `$defs` become `definitions`, and the settings of a plugin
follow from its name by `if`/`then` (a union of all plugins would only ever say "not valid under any schema").
Plugins that cannot be imported are known by name only.
"""

from __future__ import annotations

import json
from typing import Any

from pydantic import BaseModel

from robid_core.errors import RobidError
from robid_core.pipeline.checking import settings_model
from robid_core.pipeline.grammar import VERSION, PipelineFile, RobotUse
from robid_core.registered import check_registered
from robid_core.registry import DRIVES, DYNAMICS, EXECUTORS, STAGES, Plugin, Registry
from robid_core.robot import Robot
from robid_core.stage import Input, Stage

Schema = dict[str, Any]


def pipeline_schema(plugins: Registry) -> Schema:
    """Return the schema of a pipeline file as JSON values."""
    definitions: Schema = {}
    top = _definitions_lifted(PipelineFile.model_json_schema(by_alias=True), definitions)
    properties = top["properties"]
    properties["robid"] = {**properties["robid"], "const": VERSION}
    properties["robot"] = _robot(plugins, definitions)
    for key, group in (("drives", DRIVES), ("executor", EXECUTORS)):
        description = properties[key].get("description", "")
        definitions[key] = _choice(plugins, group, definitions, description)
        properties[key] = {"$ref": f"#/definitions/{key}"}
    definitions["stage"] = _choice(
        plugins, STAGES, definitions, "One stage: a plugin, its settings, its inputs."
    )
    properties["stages"] = {
        "type": "object",
        "description": properties["stages"].get("description", ""),
        "minProperties": 1,
        "propertyNames": {"pattern": "^[A-Za-z_][A-Za-z0-9_]{0,63}$"},
        "additionalProperties": {"$ref": "#/definitions/stage"},
    }
    for replaced in ("RobotUse", "PluginUse", "StageUse"):
        definitions.pop(replaced, None)
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "robid pipeline",
        "definitions": definitions,
        **{key: value for key, value in top.items() if key != "title"},
    }


def _robot(plugins: Registry, definitions: Schema) -> Schema:
    """Return the schema of `robot:`, a name or a table."""
    table = _definitions_lifted(RobotUse.model_json_schema(), definitions)
    table["properties"]["dynamics"]["examples"] = ["kernel", *plugins.names(DYNAMICS)]
    return {
        "description": PipelineFile.model_fields["robot"].description,
        "anyOf": [{"type": "string"}, table],
    }


def _choice(plugins: Registry, group: str, definitions: Schema, description: str) -> Schema:
    """Return the schema of `{use, with}` (and `inputs` for stages), one `if`/`then` for each plugin."""
    names: dict[str, str] = {}
    branches = []
    for plugin in plugins.plugins(group):
        written = [plugin.name, f"{plugin.distribution}:{plugin.name}"]
        try:
            loaded = plugin.load()
            check_registered(plugin, loaded)
            model = settings_model(loaded)
            branch = _branch(plugin, model, definitions)
        except (RobidError, TypeError, NameError) as error:
            names |= dict.fromkeys(written, " ".join(str(error).split()))
            continue
        names |= dict.fromkeys(written, (model.__doc__ or "").strip().partition("\n")[0])
        condition = {"properties": {"use": {"enum": written}}, "required": ["use"]}
        branches.append({"if": condition, "then": branch})
    # Names alone come first in an editor's list, those that pin a distribution after them.
    names = dict(sorted(names.items(), key=lambda entry: (":" in entry[0], entry[0])))
    properties: Schema = {
        "use": {
            "description": "Name of the plugin, or 'distribution:name' where two distributions have it.",
            "type": "string",
            "enum": list(names),
            "enumDescriptions": list(names.values()),
        },
        "with": {"type": "object", "description": "Settings of the plugin."},
    }
    if group == STAGES:
        properties["inputs"] = {
            "type": "object",
            "description": "Input: name of the stage that feeds it, where that is not obvious; a list for many.",
            "additionalProperties": {"type": ["string", "array"]},
        }
    return {
        "type": "object",
        "description": description,
        "additionalProperties": False,
        "required": ["use"],
        "properties": properties,
        "allOf": branches,
    }


def _branch(plugin: Plugin, model: type[BaseModel], definitions: Schema) -> Schema:
    """Return what follows from `use: plugin`: the schema of `with`, whether it may be absent, the inputs."""
    key = f"{plugin.group.removeprefix('robid.')}.{plugin.name}"
    definitions[key] = _definitions_lifted(model.model_json_schema(by_alias=True), definitions, key)
    branch: Schema = {"properties": {"with": {"$ref": f"#/definitions/{key}"}}}
    if definitions[key].get("required"):
        branch["required"] = ["with"]
    if issubclass(model, Stage):
        inputs = {entry.name: _input(entry) for entry in model.inputs()}
        inputs |= {
            name: {
                "type": "string",
                "description": "A fit or diagnosis whose robot is taken, not the nominal one.",
            }
            for name, kind in model.lends().items()
            if kind is Robot
        }
        branch["properties"]["inputs"] = {"properties": inputs, "additionalProperties": False}
    return branch


def _input(entry: Input) -> Schema:
    """Return the schema of what stands under one input."""
    if not entry.many and not entry.optional:
        return {"type": "string", "description": f"A stage that makes {entry.artifact.__name__}."}
    if not entry.many:
        return {
            "type": ["string", "array"],
            "maxItems": 0,
            "description": f"A stage that makes {entry.artifact.__name__}, or [] for none.",
        }
    return {
        "type": ["string", "array"],
        "items": {"type": "string"},
        "minItems": 0 if entry.optional else 1,
        "uniqueItems": True,
        "description": f"Stages that make {entry.artifact.__name__}.",
    }


def _definitions_lifted(schema: Schema, definitions: Schema, prefix: str = "") -> Schema:
    """Move `$defs` of a schema to the common definitions, renamed so that plugins do not collide."""
    local = schema.pop("$defs", {})
    names = {name: f"{prefix}.{name}" if prefix else name for name in local}
    text = json.dumps([schema, local])
    for name, renamed in names.items():
        text = text.replace(f'"#/$defs/{name}"', f'"#/definitions/{renamed}"')
    lifted, inner = json.loads(text)
    for name, entry in inner.items():
        definitions[names[name]] = _draft_7(entry)
    result: Schema = _draft_7(lifted)
    return result


def _draft_7(schema: Any) -> Any:
    """Return a schema in the words of draft 7: tuples by `items`, nothing beside a `$ref`, no generated titles."""
    if isinstance(schema, list):
        return [_draft_7(entry) for entry in schema]
    if not isinstance(schema, dict):
        return schema
    result: Schema = {}
    for key, value in schema.items():
        if key in ("properties", "definitions"):
            result[key] = {name: _draft_7(entry) for name, entry in value.items()}
        elif key in ("default", "const", "enum", "examples", "title"):
            if key != "title":
                result[key] = value
        else:
            result[key] = _draft_7(value)
    if "prefixItems" in result:
        if "items" in result:
            result["additionalItems"] = result.pop("items")
        result["items"] = result.pop("prefixItems")
    if "$ref" in result and len(result) > 1:
        result["allOf"] = [{"$ref": result.pop("$ref")}]
    return result
