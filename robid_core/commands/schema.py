"""`robid schema`: the JSON schema of pipeline files with all installed plugins."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def command(
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write it to this file.")] = None,
) -> None:
    """Print the JSON schema (draft 7) of pipeline files with every installed plugin, for completion in editors.

    Save it, and write as the first line of a pipeline file: # yaml-language-server: $schema=robid.schema.json
    """
    import json

    from robid_core.errors import StoreError
    from robid_core.pipeline.schema import pipeline_schema
    from robid_core.registry import registry

    text = json.dumps(pipeline_schema(registry()), indent=2) + "\n"
    if output is None:
        typer.echo(text, nl=False)
        return
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{output}: cannot be written: {error.strerror}") from error
    typer.echo(f"{output}: written; begin a pipeline file with # yaml-language-server: $schema={output}")
