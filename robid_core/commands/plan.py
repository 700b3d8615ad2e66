"""`robid plan`: the wiring of a pipeline, as text or Mermaid, the time it takes of the robot, and advice.

The advice comes from a simulated run: the excitations are made and cleared as a run would, and what they predict is
printed below them. One that breaks a limit is refused here already.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from robid_core.commands.arguments import (
    DEFAULT_PIPELINE,
    DataRoot,
    Overrides,
    PipelineArgument,
    load_pipeline,
)
from robid_core.commands.trial import foreign_plugins, in_a_copy
from robid_core.errors import PluginError, RobidError, said_by
from robid_core.executors.task import surviving

if TYPE_CHECKING:
    from robid_core.pipeline import Pipeline, StageNode
    from robid_core.pipeline.wiring import Source
    from robid_core.stage import Stage


def command(
    file: PipelineArgument = DEFAULT_PIPELINE,
    overrides: Overrides = None,
    data: DataRoot = None,
    mermaid: Annotated[bool, typer.Option("--mermaid", help="As a Mermaid diagram, without advice.")] = False,
    dry: Annotated[bool, typer.Option("--dry", help="The wiring only: simulate nothing.")] = False,
) -> None:
    """Show the stages in the order in which they run, what feeds each, how long the robot will move, and advice.

    The excitations are simulated with the nominal robot; nothing moves and nothing is written.
    """
    pipeline = load_pipeline(file, overrides, data)
    if mermaid:
        typer.echo("\n".join(mermaid_lines(pipeline)))
        return
    lines, error = in_a_copy(
        lambda: planned(pipeline, dry), foreign_plugins(file), "stages said what they foresee"
    )
    typer.echo("\n".join(lines))
    if error is not None:
        raise error


def planned(pipeline: Pipeline, dry: bool) -> tuple[list[str], BaseException | None]:
    """Return what is to be shown, and what spoke against the advice in it."""
    try:
        return text_lines(pipeline, {} if dry else predictions(pipeline)), None
    except RobidError as error:
        return text_lines(pipeline), surviving(error)


def predictions(pipeline: Pipeline) -> dict[str, list[str]]:
    """Make the excitations of a pipeline and return what each predicts, by stage; warnings begin with '!'."""
    from robid_core.artifacts import Excitation
    from robid_core.commands.excitation_screen import advice_lines
    from robid_core.commands.last_screen import near
    from robid_core.commands.run_screen import listening
    from robid_core.run import RunFolder
    from robid_core.run.rehearsal import rehearse
    from robid_core.stage import ExcitationDesign

    with listening(quiet=False, verbose=False, warnings=False) as listener:
        made = rehearse(pipeline, listener)
    advice: dict[str, list[str]] = {}
    for name, rehearsed in made.items():
        lines = advice_lines(rehearsed.artifact) if isinstance(rehearsed.artifact, Excitation) else []
        advice[name] = [*lines, *(f"! {warning}" for warning in rehearsed.warnings)]
    for node in pipeline.stages:
        if isinstance(node.stage, ExcitationDesign) and node.name not in made:
            show = ["robid", "show", near(RunFolder.of(pipeline).path), node.name]
            advice[node.name] = [
                f"not simulated: it needs what only a run finds out; {shlex.join(show)} shows the advice afterwards"
            ]
    return advice


def text_lines(pipeline: Pipeline, advice: Mapping[str, list[str]] | None = None) -> list[str]:
    """Return the wiring as text, with what the stages themselves foresee, and `advice` by stage, below each."""
    drives = f"drives {pipeline.drives.plugin.name}" if pipeline.drives else "no drives"
    lines = [f"{pipeline.name}: robot {pipeline.robot.written}, {drives}, seed {pipeline.seed}", ""]
    wide_name = max(len(node.name) for node in pipeline.stages)
    wide_use = max(len(node.plugin.name) for node in pipeline.stages)
    for node in pipeline.stages:
        sources = ", ".join(f"{parameter}: {in_words(source)}" for parameter, source in node.inputs.items())
        lines.append(f"{node.name:{wide_name}}  {node.plugin.name:{wide_use}}  {sources}".rstrip())
        below = [*foresee(node, pipeline), *(advice or {}).get(node.name, [])]
        lines += [f"{'':{wide_name}}  {line}" for line in below]
    return lines


def in_words(source: Source) -> str:
    """Return what feeds a parameter, as it stands in the file."""
    return source if isinstance(source, str) else f"[{', '.join(source)}]"


def mermaid_lines(pipeline: Pipeline) -> list[str]:
    """Return the wiring as a Mermaid flowchart; names are identifiers, so nothing needs to be escaped."""
    lines = ["flowchart TD"]
    for node in pipeline.stages:
        lines.append(f'    s_{node.name}["{node.name}<br/>{node.plugin.name}"]')
    for node in pipeline.stages:
        for source in node.feeds:
            made = pipeline.stage(source).stage.output.__name__
            lines.append(f"    s_{source} -- {made} --> s_{node.name}")
    return lines


def foresee(node: StageNode, pipeline: Pipeline) -> list[str]:
    """Return what can be said of a stage before it runs: its own `plan_lines`, and the robot's time."""
    upstream: dict[str, Stage] = {}
    for parameter, source in node.inputs.items():
        if isinstance(source, str):
            upstream[parameter] = pipeline.stage(source).stage
        else:
            upstream |= {f"{parameter}[{i}]": pipeline.stage(name).stage for i, name in enumerate(source)}
    lines: list[str] = []
    plan_lines = getattr(node.stage, "plan_lines", None)
    if callable(plan_lines):
        try:
            lines += [str(line) for line in plan_lines(upstream)]
        except (RobidError, KeyboardInterrupt):
            raise
        except Exception as error:
            why = f"{type(error).__name__}: {said_by(error)}"
            raise PluginError(
                f"stage {node.name}: R09: {node.plugin} cannot say what it foresees: {why}"
            ) from error
    time = robot_time(node.stage, upstream, pipeline)
    return [*lines, time] if time else lines


def robot_time(stage: Stage, upstream: dict[str, Stage], pipeline: Pipeline) -> str:
    """Return the motion that a stage asks for, empty where it moves nothing or cannot tell."""
    from robid_core.drives import Drives
    from robid_core.pipeline.planned_motion import planned_motion

    if Drives not in stage.lends().values():
        return ""
    motion = planned_motion(stage, upstream, pipeline.robot.load().n_axis)
    return "" if motion is None else f"{motion} = {motion.seconds:g} s of robot time"
