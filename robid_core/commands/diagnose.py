"""`robid diagnose`: what the simulation of a robot gets wrong, from records of its motion."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robid_core.commands.arguments import DataRoot, load_pipeline

FILE = "diagnosis.yaml"
HEADING = "# Written by `robid diagnose`; it is a pipeline like any other, and is written anew by the same command.\n"


def command(
    records: Annotated[
        list[Path],
        typer.Argument(metavar="RECORD...", help="Records of the drives (.mcap), at least four experiments."),
    ],
    robot: Annotated[
        str, typer.Option("--robot", help="The robot as it was told: a file, or a packaged one.")
    ],
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="EFFECT", help="Try these only, EFFECT or EFFECT@AXIS."),
    ] = None,
    exclude: Annotated[
        list[str] | None, typer.Option("--exclude", metavar="EFFECT", help="Do not try these.")
    ] = None,
    test: Annotated[
        str,
        typer.Option(
            "--test", metavar="EFFECT@AXIS", help="One law: its p-value without a search, its size."
        ),
    ] = "",
    data: DataRoot = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the essentials.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print the log, too.")] = False,
) -> None:
    """Find what a simulation gets wrong: refit the robot, hold every effect against what is left, extend the robot.

    Writes diagnosis.yaml, a pipeline, and runs it: in runs/diagnosis/ there are then the page, verdict.explain.json and
    robot.explain.yaml, the extended robot. An interrupted diagnosis goes on with the same command.
    """
    from robid_core.commands.run import run_and_tell
    from robid_core.errors import ConfigurationError
    from robid_core.run import RunOptions

    if test and (only or exclude):
        raise ConfigurationError("--test asks for one law; leave --only and --exclude away")
    root, names = below_one_folder(records, data)
    text = HEADING + pipeline_text(robot, names, [test] if test else only or [], exclude or [])
    path = Path(FILE)
    if path.exists() and not path.read_text(encoding="utf-8").startswith(HEADING):
        raise ConfigurationError(f"{FILE} exists and was not written by robid diagnose; move it away")
    path.write_text(text, encoding="utf-8")
    pipeline = load_pipeline(path, None, root)
    run_and_tell(pipeline, RunOptions(), f"robid run {FILE} --data {root}", quiet, verbose)
    typer.echo("\n".join(verdict_lines(pipeline.folder / "runs" / pipeline.name)))


def below_one_folder(records: list[Path], data: Path | None) -> tuple[Path, list[str]]:
    """Return a folder that holds all records, and their names below it."""
    import os

    from robid_core.errors import ConfigurationError

    for record in records:
        if not record.is_file():
            raise ConfigurationError(f"{record}: there is no such file")
    whole = [record.resolve() for record in records]
    root = data.resolve() if data is not None else Path(os.path.commonpath([one.parent for one in whole]))
    outside = next((one for one in whole if not one.is_relative_to(root)), None)
    if outside is not None:
        raise ConfigurationError(f"{outside}: not below {root}; leave --data away, or name another folder")
    return root, [one.relative_to(root).as_posix() for one in whole]


def pipeline_text(robot: str, records: list[str], only: list[str], exclude: list[str]) -> str:
    """Return the pipeline that reads the records, explains them and shows it."""
    import json

    stages = {
        f"record_{number + 1}": {"use": "acquisition.recorded", "with": {"path": name}}
        for number, name in enumerate(records)
    }
    asked = {key: value for key, value in (("only", only), ("exclude", exclude)) if value}
    lines = ["robid: 1", "name: diagnosis", "seed: 1", f"robot: {json.dumps(robot)}", "stages:"]
    lines += [f"  {name}: {json.dumps(stage)}" for name, stage in stages.items()]
    explain = {"use": "diagnosis.effects", "inputs": {"record": list(stages)}, "with": asked}
    lines.append(f"  explain: {json.dumps(explain)}")
    page = {"use": "report.html", "inputs": {"diagnosis": "explain", "record": next(iter(stages))}}
    lines.append(f"  page: {json.dumps(page)}")
    return "\n".join(lines) + "\n"


def verdict_lines(folder: Path) -> list[str]:
    """Return the verdict of a run, sentence by sentence."""
    import json

    path = folder / "verdict.explain.json"
    if not path.is_file():
        return []
    told = json.loads(path.read_text(encoding="utf-8"))
    return ["", *told["verdict"], "", f"verdict: {path}", f"extended robot: {folder / 'robot.explain.yaml'}"]
