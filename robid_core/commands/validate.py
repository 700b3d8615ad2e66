"""`robid validate`: all mistakes of a pipeline file at once."""

from __future__ import annotations

import typer

from robid_core.commands.arguments import (
    DEFAULT_PIPELINE,
    DataRoot,
    Overrides,
    PipelineArgument,
    load_pipeline,
)


def command(
    file: PipelineArgument = DEFAULT_PIPELINE, overrides: Overrides = None, data: DataRoot = None
) -> None:
    """Check a pipeline file and tell all its mistakes, as file:line:column: setting: what is wrong; what to do.

    Plugins are imported, settings, wiring, the robot, what settings say of it, and named files checked; nothing is run
    or written.
    """
    pipeline = load_pipeline(file, overrides, data)
    noun = "stage" if len(pipeline.stages) == 1 else "stages"
    typer.echo(f"{file}: valid, {len(pipeline.stages)} {noun}")
