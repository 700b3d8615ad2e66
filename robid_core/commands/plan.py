"""`robid plan`: the wiring of a pipeline, as text or Mermaid, and the time it takes of the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from robid_core.commands.arguments import DEFAULT_PIPELINE, DataRoot, Overrides, PipelineFile, load_pipeline

if TYPE_CHECKING:
    from robid_core.pipeline import Pipeline, StageNode
    from robid_core.stage import Stage


def command(
    file: PipelineFile = DEFAULT_PIPELINE,
    overrides: Overrides = None,
    data: DataRoot = None,
    mermaid: Annotated[bool, typer.Option("--mermaid", help="As a Mermaid diagram.")] = False,
) -> None:
    """Show the stages in the order in which they run, what feeds each, and how long the robot will move."""
    pipeline = load_pipeline(file, overrides, data)
    typer.echo("\n".join(mermaid_lines(pipeline) if mermaid else text_lines(pipeline)))


def text_lines(pipeline: Pipeline) -> list[str]:
    """Return the wiring as text, with what the stages themselves foresee below each."""
    drives = f"drives {pipeline.drives.plugin.name}" if pipeline.drives else "no drives"
    lines = [f"{pipeline.name}: robot {pipeline.robot.written}, {drives}, seed {pipeline.seed}", ""]
    wide_name = max(len(node.name) for node in pipeline.stages)
    wide_use = max(len(node.plugin.name) for node in pipeline.stages)
    for node in pipeline.stages:
        sources = ", ".join(f"{parameter}: {source}" for parameter, source in node.inputs.items())
        lines.append(f"{node.name:{wide_name}}  {node.plugin.name:{wide_use}}  {sources}".rstrip())
        lines += [f"{'':{wide_name}}  {foreseen}" for foreseen in foresee(node, pipeline)]
    return lines


def mermaid_lines(pipeline: Pipeline) -> list[str]:
    """Return the wiring as a Mermaid flowchart; names are identifiers, so nothing needs to be escaped."""
    lines = ["flowchart TD"]
    for node in pipeline.stages:
        lines.append(f'    s_{node.name}["{node.name}<br/>{node.plugin.name}"]')
    for node in pipeline.stages:
        for source in dict.fromkeys(node.inputs.values()):
            made = pipeline.stage(source).stage.output.__name__
            lines.append(f"    s_{source} -- {made} --> s_{node.name}")
    return lines


def foresee(node: StageNode, pipeline: Pipeline) -> list[str]:
    """Return what can be said of a stage before it runs: its own `plan_lines`, and the robot's time."""
    upstream = {parameter: pipeline.stage(source).stage for parameter, source in node.inputs.items()}
    lines: list[str] = []
    plan_lines = getattr(node.stage, "plan_lines", None)
    if callable(plan_lines):
        lines += [str(line) for line in plan_lines(upstream)]
    time = robot_time(node.stage, upstream, pipeline)
    return [*lines, time] if time else lines


def robot_time(stage: Stage, upstream: dict[str, Stage], pipeline: Pipeline) -> str:
    """Return the motion that a stage asks for, empty where it moves nothing or cannot tell.

    One experiment per motor excites all axes of a block; a design spends its experiments as blocks.
    """
    from robid_core.drives import Drives

    if Drives not in stage.lends().values():
        return ""
    settings = {name: value for source in upstream.values() for name, value in source}
    period_s, blocks = settings.get("period_s"), settings.get("blocks")
    n_config = settings.get("count", settings.get("experiments"))
    periods = _number(stage, "periods") + _number(stage, "settle_periods")
    if not (
        isinstance(period_s, float) and isinstance(blocks, int) and isinstance(n_config, int) and periods
    ):
        return ""
    n_exp = pipeline.robot.load().n_axis
    seconds = n_config * blocks * n_exp * periods * period_s
    return (
        f"{_of(n_config, 'configuration')} x {_of(blocks, 'block')} x {_of(n_exp, 'experiment')} x "
        f"{_of(periods, 'period')} of {period_s:g} s = {seconds:g} s of robot time"
    )


def _number(stage: Any, name: str) -> int:
    value = getattr(stage, name, 0)
    return value if isinstance(value, int) else 0


def _of(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
