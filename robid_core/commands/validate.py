"""`robid validate`: all mistakes of a pipeline file at once."""

from __future__ import annotations

import typer

from robid_core.commands.arguments import (
    DEFAULT_PIPELINE,
    DataRoot,
    Overrides,
    PipelineArgument,
    load_pipeline,
    truth_as_robot,
)
from robid_core.commands.doctor import remarks_on_file


def command(
    file: PipelineArgument = DEFAULT_PIPELINE, overrides: Overrides = None, data: DataRoot = None
) -> None:
    """Check a pipeline file and list all mistakes, as file:line:column: setting: what is wrong; what to do.

    Plugins are imported; settings, wiring, the robot, what settings say of it, and named files are checked; nothing is
    run or written. Implausible numbers of a robot with drives are remarked on, and so are springs that no data can
    distinguish.
    """
    from robid_core.robot.file.coaxial import coaxial_springs
    from robid_core.robot.file.meeting import meeting_springs
    from robid_core.robot.file.reading import find_robot

    pipeline = load_pipeline(file, overrides, data)
    robot = pipeline.robot.load()
    if pipeline.drives is None:
        found = [pair.sentence for pair in coaxial_springs(robot.description)]
        found += [group.sentence for group in meeting_springs(robot.description)]
    else:
        found = [remark.sentence for remark in remarks_on_file(robot, find_robot(pipeline.robot.source))]
    if told := truth_as_robot(pipeline):
        found.append(told)
    for sentence in found:
        typer.echo(f"{file}: robot: remark: {sentence}")
    noun = "stage" if len(pipeline.stages) == 1 else "stages"
    typer.echo(f"{file}: valid, {len(pipeline.stages)} {noun}")
