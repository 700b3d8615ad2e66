"""`robid schema`: the JSON schema of pipeline files with all installed plugins, or of robot files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def command(
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write it to this file.")] = None,
    robot: Annotated[
        bool, typer.Option("--robot", help="Of robot files, with what every key means.")
    ] = False,
) -> None:
    """Print the JSON schema (draft 7) of pipeline files with every installed plugin, for completion in editors.

    With --robot that of robot files. Save it, and write as the first line of a pipeline file:
    # yaml-language-server: $schema=robid.schema.json
    """
    import functools
    import json

    from robid_core.commands.trial import in_a_copy
    from robid_core.errors import StoreError
    from robid_core.pipeline.schema import pipeline_schema
    from robid_core.registry import GROUPS, registry
    from robid_core.robot.file.schema import robot_schema

    foreign = [plugin for group in GROUPS for plugin in registry().plugins(group) if plugin.is_foreign]
    making = robot_schema if robot else functools.partial(pipeline_schema, registry())
    schema = in_a_copy(making, foreign, "the schema was made")
    text = json.dumps(schema, indent=2) + "\n"
    if output is None:
        typer.echo(text, nl=False)
        return
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{output}: cannot be written: {error.strerror}") from error
    typer.echo(f"{output}: written; begin the file with # yaml-language-server: $schema={output}")
