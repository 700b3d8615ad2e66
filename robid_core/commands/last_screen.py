"""The last screen of `robid run`: what was done, what fits and diagnoses found, and where it is.

At most 25 lines, but that doubts, remarks and verdicts are all told, and whole.
"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from robid_core.commands.fit_screen import doubt_lines, first_line, fit_line, fit_table

if TYPE_CHECKING:
    from robid_core.artifacts import Artifact, Fit
    from robid_core.pipeline import Pipeline
    from robid_core.run import RunResult

Kind = TypeVar("Kind", bound="Artifact")
LAST_SCREEN_LINES = 25
FEWEST_ROWS = 4  # of a table that doubts leave little room


def last_screen(pipeline: Pipeline, result: RunResult, again: str) -> list[str]:
    """Return the lines that a person reads when the run is over: at most 25 beside doubts, remarks and verdicts.

    Parameters
    ----------
    pipeline
        What was run.
    result
        What became of it.
    again
        The command that runs it again.
    """
    from robid_core.run.folded import folded

    show = shlex.join(["robid", "show", near(result.folder.path)])
    head = [headline(pipeline, result)]
    head += doubt_lines((*folded(result.warnings), *result.doubts), result.remarks)
    page, found = last_page(pipeline, result), fits(pipeline, result)
    tail = [f"page       {near(page)}"] if page is not None else []
    tail += [f"verdict    {near(path)}" for path in verdict_files(pipeline, result)]
    tail += [f"robot      {near(path)}" for path in robot_files(pipeline, result)]
    tail += [f"results    {show}", f"run again  {again}"]
    tail += [
        f"more poses {with_setting(again, key, value)}" for key, value in more_configurations(pipeline, found)
    ]
    verdicts = verdict_lines(pipeline, result)
    if not found:
        return [*head, *verdicts, "", *tail]
    stage, fit = found[-1]
    table = fit_table(fit, true_parameters(pipeline))
    unshown = fit.parameters.unreported()
    beside = [f"{unshown}: {show} {stage}"] if unshown else []
    told = [first_line(f"{name}: {fit_line(one)}") for name, one in found]
    room = LAST_SCREEN_LINES - len(head) - len(tail) - 2 - len(told)  # two empty lines
    room = max(room - len(beside), FEWEST_ROWS)
    if len(table) > room:
        table = [*table[: room - 1], f"... {len(table) - room + 1} more: {show} {stage}"]
    return [*head, "", *table, *beside, *told, *verdicts, "", *tail]


def more_configurations(pipeline: Pipeline, found: list[tuple[str, Fit]]) -> list[tuple[str, int]]:
    """Return the settings that double the configurations of a run, and to what, where a fit asks for more of them."""
    from robid_core.artifacts.doubts import MORE_CONFIGURATIONS
    from robid_core.stage import CandidateDesign

    if not any(doubt.kind in MORE_CONFIGURATIONS for _, fit in found for doubt in fit.doubts):
        return []
    designs = [node for node in pipeline.stages if isinstance(node.stage, CandidateDesign)]
    counts = [(node.name, getattr(node.stage, "count", None)) for node in designs]
    return [(f"stages.{name}.with.count", 2 * count) for name, count in counts if isinstance(count, int)]


def with_setting(command: str, key: str, value: object) -> str:
    """Return a command with `--set key=value` at its end, in place of what it sets there itself."""
    words = shlex.split(command)
    earlier = {
        i for i, word in enumerate(words) if i and words[i - 1] == "--set" and word.startswith(f"{key}=")
    }
    dropped = earlier | {i - 1 for i in earlier}
    kept = [word for i, word in enumerate(words) if i not in dropped]
    return shlex.join([*kept, "--set", f"{key}={value}"])


def verdict_lines(pipeline: Pipeline, result: RunResult) -> list[str]:
    """Return what the diagnoses of this run say, sentence by sentence below the name of the stage."""
    from robid_core.artifacts import Diagnosis

    lines = list[str]()
    for name, diagnosis in _made(pipeline, result, Diagnosis):
        lines += ["", f"{name}:", *(f"  {sentence}" for sentence in diagnosis.verdict.splitlines())]
    return lines


def verdict_files(pipeline: Pipeline, result: RunResult) -> list[Path]:
    """Return the verdicts of this run, for programs."""
    paths = (result.folder.verdict(name) for name in _current(pipeline, result))
    return [path for path in paths if path.is_file()]


def robot_files(pipeline: Pipeline, result: RunResult) -> list[Path]:
    """Return robot files of the last fit and of every diagnosis of this run."""
    from robid_core.artifacts import Diagnosis, Fit

    kinds = {node.name: node.stage.output for node in pipeline.stages}
    stages = _current(pipeline, result)
    last = [name for name in stages if issubclass(kinds[name], Fit)][-1:]
    wanted = [name for name in stages if name in last or issubclass(kinds[name], Diagnosis)]
    return [path for name in wanted if (path := result.folder.robot(name)).is_file()]


def headline(pipeline: Pipeline, result: RunResult) -> str:
    """Say in one line what was done."""
    counts = {
        word: list(result.outcomes.values()).count(word) for word in ("made", "same", "kept", "refused")
    }
    n = len(result.outcomes)
    if result.idle:
        return f"{pipeline.name}: nothing to do, all {n} stages are up to date"
    parts = [f"{counts['made'] + counts['same']} made", f"{counts['kept']} up to date"]
    parts += [f"{counts['refused']} without a result"] if counts["refused"] else []
    return (
        f"{pipeline.name}: {n} {'stage' if n == 1 else 'stages'}, {', '.join(parts)}, {result.seconds:.1f} s"
    )


def last_page(pipeline: Pipeline, result: RunResult) -> Path | None:
    """Return the last page that belongs to this run."""
    from robid_core.artifacts import Report

    kinds = {node.name: node.stage.output for node in pipeline.stages}
    for name in reversed(_current(pipeline, result)):
        record = result.manifest.stages.get(name)
        if issubclass(kinds[name], Report) and record is not None and record.file:
            return result.folder.path / record.file
    return None


def fits(pipeline: Pipeline, result: RunResult) -> list[tuple[str, Fit]]:
    """Return the fits of this run with their stages, in the order of the file; the last is shown in full."""
    from robid_core.artifacts import Fit

    return _made(pipeline, result, Fit)


def _made(pipeline: Pipeline, result: RunResult, kind: type[Kind]) -> list[tuple[str, Kind]]:
    """Return the results of one kind that belong to this run, with their stages."""
    kinds = {node.name: node.stage.output for node in pipeline.stages}
    return [
        (name, kind.read(result.folder.path / result.manifest.stages[name].file))
        for name in _current(pipeline, result)
        if issubclass(kinds[name], kind)
    ]


def _current(pipeline: Pipeline, result: RunResult) -> list[str]:
    """Return the stages whose results belong to this run, in the order of the file."""
    names = (node.name for node in pipeline.stages)
    return [name for name in names if result.outcomes.get(name) in ("made", "same", "kept")]


def true_parameters(pipeline: Pipeline) -> dict[str, float]:
    """Return the parameters of the plant by name, where it is simulated and its files are still there."""
    from robid_core.drives import Drives
    from robid_core.errors import RobidError

    drives = pipeline.drives.settings if pipeline.drives else None
    if not isinstance(drives, Drives):
        return {}
    try:
        truth = drives.truth(pipeline.robot.load())
    except RobidError:  # a file that was changed or removed meanwhile; the run itself has ended well
        return {}
    return truth.as_mapping() if truth else {}


def near(path: Path) -> str:
    """Return a path as seen from where the user is, where that is shorter."""
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)
