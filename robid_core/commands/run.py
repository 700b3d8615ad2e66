"""`robid run`: bring the results of a pipeline up to date."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robid_core.commands import INTERRUPTED
from robid_core.commands.arguments import (
    DEFAULT_PIPELINE,
    DataRoot,
    Overrides,
    PipelineArgument,
    load_pipeline,
    truth_as_robot,
)
from robid_core.errors import ConfigurationError, RobidError
from robid_core.interruption import interrupted_told

if TYPE_CHECKING:
    from robid_core.pipeline import Pipeline
    from robid_core.run import Decision, RunOptions

MAXIMUM_JOBS = 1024


def command(
    file: PipelineArgument = DEFAULT_PIPELINE,
    stages: Annotated[list[str] | None, typer.Argument(help="Stages that --force makes again.")] = None,
    overrides: Overrides = None,
    first: Annotated[
        str | None, typer.Option("--from", metavar="STAGE", help="Only this stage and what depends on it.")
    ] = None,
    last: Annotated[
        str | None, typer.Option("--until", metavar="STAGE", help="Only this stage and what it needs.")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Make again what is up to date: the stages named, or all.")
    ] = False,
    jobs: Annotated[
        int,
        typer.Option(min=0, max=MAXIMUM_JOBS, help="Worker processes; 0: as many as processors."),
    ] = 0,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be done, and why; do nothing.")
    ] = False,
    locked: Annotated[
        bool, typer.Option("--locked", help="Refuse unless all is as the manifest of the last run says.")
    ] = False,
    again: Annotated[bool, typer.Option("--again", help="Make recordings on hardware anew.")] = False,
    at_the_robot: Annotated[
        bool,
        typer.Option(
            "--at-the-robot", help="Hardware may move: the cell is clear, somebody is at the emergency stop."
        ),
    ] = False,
    no_wait: Annotated[
        bool, typer.Option("--no-wait", help="Refuse, not wait, where another run is in the folder.")
    ] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Run each stage twice; refuse one that gives other bytes.")
    ] = False,
    deadline: Annotated[
        float | None, typer.Option(metavar="SECONDS", min=0.1, help="Kill a stage that takes longer.")
    ] = None,
    memory: Annotated[
        int | None, typer.Option(metavar="MB", min=256, help="End a stage that takes more memory.")
    ] = None,
    trust_plugins: Annotated[
        bool,
        typer.Option(
            "--trust-plugins", help="Give stages of third parties no process of their own: quicker."
        ),
    ] = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="End with exit code 6 where a result is doubted for any reason.")
    ] = False,
    data: DataRoot = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the essentials.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print the log, too.")] = False,
) -> None:
    """Run a pipeline: stages that are up to date are kept, the others are made, in the folder runs/NAME.

    A run that was stopped, in whatever way, goes on where it was when the same command is given again.
    """
    from robid_core.run import ALL, RunOptions

    file, named = _sort_words(file, stages or [], force)
    pipeline = load_pipeline(file, overrides, data)
    options = RunOptions(
        first=first,
        last=last,
        force=(tuple(named) or (ALL,)) if force else (),
        jobs=jobs,
        locked=locked,
        wait=not no_wait,
        again=again,
        at_the_robot=at_the_robot,
        check=check,
        deadline_s=deadline,
        memory_mb=memory,
        trust_plugins=trust_plugins,
        strict=strict,
    )
    if dry_run:
        from robid_core.run import preview_run

        typer.echo("\n".join(preview_lines(preview_run(pipeline, options))))
        return
    if told := truth_as_robot(pipeline):
        typer.echo(f"! {file}: robot: {told}", err=True)
    run_and_tell(pipeline, options, command_words(file, overrides, data, last), quiet, verbose)


def run_and_tell(pipeline: Pipeline, options: RunOptions, again: str, quiet: bool, verbose: bool) -> None:
    """Run a pipeline, with progress and what it made on the screen; `again` is the command that goes on."""
    from robid_core.commands.last_screen import headline, last_page, last_screen, verdict_lines
    from robid_core.commands.run_screen import listening
    from robid_core.run import run_pipeline
    from robid_core.run.folded import folded
    from robid_core.standard_streams import never_failing

    never_failing("stdout")  # what it shows comes after the results are stored
    try:
        with listening(quiet, verbose) as listener:
            result = run_pipeline(pipeline, options, listener)
    except RobidError as error:
        for warning in folded(error.warnings):
            typer.echo(f"! {warning}", err=True)
        raise
    except KeyboardInterrupt as interrupt:
        told = [interrupted_told(), *getattr(interrupt, "__notes__", ()), "finished stages are kept"]
        typer.echo(f"{'; '.join(told)}, and the same command goes on from there", err=True)
        raise typer.Exit(INTERRUPTED) from None
    if quiet:
        page = last_page(pipeline, result)
        typer.echo(headline(pipeline, result) + (f"; {page}" if page else ""))
        for line in filter(None, verdict_lines(pipeline, result)):
            typer.echo(line)
        for doubt in (*folded(result.warnings), *result.doubts, *result.remarks):
            typer.echo(doubt, err=True)
    else:
        typer.echo("\n".join(last_screen(pipeline, result, again)))
    if result.exit_code:
        raise typer.Exit(result.exit_code)


def _sort_words(file: Path, stages: list[str], force: bool) -> tuple[Path, list[str]]:
    """Tell the pipeline file from the stages that --force makes again: `run --force fit`, `run p.yaml --force fit`."""
    words = [str(file), *stages]
    files = [word for word in words if Path(word).suffix in (".yaml", ".yml") or Path(word).is_file()]
    others = [word for word in words if word not in files]
    if len(files) > 1:
        raise ConfigurationError(f"one pipeline at a time, not {' and '.join(files)}")
    if others and not force:
        if files:
            raise ConfigurationError(
                f"{others[0]}: what shall be done with it? To run up to a stage, write --until {others[0]}"
            )
        return Path(others[0]), []
    return (Path(files[0]) if files else DEFAULT_PIPELINE), others


def preview_lines(decisions: list[Decision]) -> list[str]:
    """Return one line per stage: what becomes of it, and why."""
    wide_name = max(len(decision.stage) for decision in decisions)
    wide_action = max(len(decision.action.value) for decision in decisions)
    return [
        f"{d.stage:{wide_name}}  {d.action.value:{wide_action}}  {'; '.join(d.reasons)}".rstrip()
        for d in decisions
    ]


def command_words(file: Path, overrides: list[str] | None, data: Path | None, last: str | None = None) -> str:
    """Return the command that runs this again."""
    words = ["robid", "run", str(file)]
    for override in overrides or ():
        words += ["--set", override]
    if data is not None:
        words += ["--data", str(data)]
    if last is not None:
        words += ["--until", last]
    return shlex.join(words)
