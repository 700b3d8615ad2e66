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
    or written. Springs of the robot that no data tell apart by structure are remarked.
    """
    from robid_core.robot.file.coaxial import coaxial_springs

    pipeline = load_pipeline(file, overrides, data)
    for pair in coaxial_springs(pipeline.robot.load().description):
        typer.echo(f"{file}: robot: remark: {pair.sentence}")
    noun = "stage" if len(pipeline.stages) == 1 else "stages"
    typer.echo(f"{file}: valid, {len(pipeline.stages)} {noun}")
