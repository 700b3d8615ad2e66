"""`robid diagnose`: what the simulation of a robot gets wrong, from records of its motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robid_core.commands.arguments import DataRoot, load_pipeline
from robid_core.commands.continuation import AGAIN, diagnosis_of, drives_of, experiment_of, stages_of

if TYPE_CHECKING:
    from robid_core.artifacts import SeparatingExperiment
    from robid_core.pipeline import Pipeline

FILE = "diagnosis.yaml"
HEADING = "# Written by `robid diagnose`; it is a pipeline like any other, and is written anew by the same command.\n"


@dataclass(frozen=True)
class Asked:
    """Options of a diagnosis from the command line."""

    only: list[str] = field(default_factory=list)
    exclude: list[str] = field(default_factory=list)
    robots: dict[str, str] = field(default_factory=dict)
    """Robot files of records that have one of their own, by the record's name."""
    blocks: int = 1
    """Pieces into which each record is cut."""

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the stage."""
        every = (("only", self.only), ("exclude", self.exclude), ("robots", self.robots))
        return {key: value for key, value in every if value} | (
            {"blocks": self.blocks} if self.blocks > 1 else {}
        )


def command(
    robot: Annotated[
        str, typer.Option("--robot", help="The nominal robot: a robot file, or a packaged one.")
    ],
    records: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="RECORD...",
            help="Recordings with at least four experiments, or one long motion and --blocks: records of robid, or "
            "with --channels any that it reads.",
        ),
    ] = None,
    more: Annotated[
        list[Path] | None, typer.Option("--records", metavar="RECORD", help="The same as RECORD.")
    ] = None,
    channels: Annotated[
        Path | None,
        typer.Option(
            "--channels",
            metavar="MAP",
            help="Channel map of recordings that are no records of robid, which `robid records RECORD --output MAP` "
            "writes; without RECORD the files that it names are read.",
        ),
    ] = None,
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
    variant: Annotated[
        list[str] | None,
        typer.Option(
            "--variant",
            metavar="RECORD=ROBOT",
            help="A record that was measured under another robot file: another payload, given as an effect.",
        ),
    ] = None,
    keep_apart: Annotated[
        list[Path] | None,
        typer.Option(
            "--keep-apart",
            metavar="RECORD",
            help="A further record that no fit uses: it shows how well the robot predicts held-out data.",
        ),
    ] = None,
    blocks: Annotated[
        int,
        typer.Option(
            "--blocks",
            metavar="NUMBER",
            min=1,
            max=100,
            help="Cut each record, one long motion without periods, into so many experiments.",
        ),
    ] = 1,
    continued: Annotated[
        Path | None,
        typer.Option(
            "--continue",
            metavar="PIPELINE",
            help="Measure the experiment that separates ties on this pipeline's simulated drives, and diagnose again.",
        ),
    ] = None,
    data: DataRoot = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the essentials.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print the log, too.")] = False,
) -> None:
    """Find what a simulation gets wrong: refit the robot, try every effect on the residual, extend the robot.

    Recordings are records of robid (MCAP, HDF5), or any other files (CSV, MAT, NPZ, Parquet, bags) with a channel map.

    Writes diagnosis.yaml, a pipeline, and runs it: in runs/diagnosis/ there are then the page, verdict.explain.json and
    robot.explain.yaml, the extended robot. With --continue the experiment that separates ties is measured, and all
    records are diagnosed again (verdict.explain_again.json). After an interruption the same command continues: stages
    that were finished are kept, and the search begins again.
    """
    from robid_core.commands.run import run_and_tell
    from robid_core.errors import ConfigurationError
    from robid_core.run import RunOptions

    if test and (only or exclude):
        raise ConfigurationError("--test asks for one law; leave --only and --exclude away")
    if blocks > 1 and continued is not None:
        raise ConfigurationError(
            "--blocks cuts every record, and what --continue measures has periods and stays whole; leave one away"
        )
    robot = robot_below_here(robot)
    files, apart = [*(records or []), *(more or [])], keep_apart or []
    if apart and not files:
        raise ConfigurationError(
            "--keep-apart goes with RECORDs; what a channel map reads itself it keeps apart by `role: test`, or by an "
            "index table with a column role"
        )
    root, sources = read_sources(files, channels, data, apart, together=not variant)
    one_each = len(files) > 1 and len(sources) == len(files) + len(apart)
    if one_each and sources[0].get("period_s") and not (quiet or variant):
        typer.echo(
            f"{len(sources)} recordings, each read as a record of its own. Experiments of one record are all files of "
            "a folder that a pattern numbers; a table (index: ...) with a column role keeps some of them apart."
        )
    names = [str(one.get("path")) for one in sources] if files else []
    asked = Asked(
        [test] if test else only or [],
        exclude or [],
        robots_of(variant or [], [*files, *apart], names),
        blocks,
    )
    drives = drives_of(continued) if continued is not None else None

    def run(experiment: SeparatingExperiment | None = None) -> Pipeline:
        write_pipeline(pipeline_text(robot, sources, asked, drives, experiment))
        pipeline = load_pipeline(Path(FILE), None, root)
        run_and_tell(pipeline, RunOptions(), f"robid run {FILE} --data {root}", quiet, verbose)
        return pipeline

    pipeline = run()
    if drives is None:
        return
    experiment = experiment_of(diagnosis_of(pipeline, "explain"))
    if experiment is None:
        typer.echo("\nNo tie that an experiment would separate: nothing was measured.")
        return
    run(experiment)


def write_pipeline(text: str) -> None:
    """Write the pipeline file; ConfigurationError where the one that there is was written by somebody else."""
    from robid_core.errors import ConfigurationError

    path = Path(FILE)
    if path.exists() and not path.read_text(encoding="utf-8").startswith(HEADING):
        raise ConfigurationError(f"{FILE} exists and was not written by robid diagnose; move it away")
    path.write_text(HEADING + text, encoding="utf-8")


def read_sources(
    files: list[Path],
    channels: Path | None,
    data: Path | None,
    apart: Sequence[Path] = (),
    *,
    together: bool = True,
) -> tuple[Path, list[dict[str, Any]]]:
    """Return the data root, and the settings that read each recording: `files`, or what a channel map names itself.

    `apart` are further ones, of the role test. `together`: files that are all those of a map's pattern are one record,
    of configurations and experiments as their names number them.

    Raises ConfigurationError where there is neither, a file is missing, or has no channel map and needs one.
    """
    from robid_core.commands.recordings.map_file import (
        SOURCES,
        read_map,
        settings_of_all,
        settings_of_record,
    )
    from robid_core.errors import ConfigurationError
    from robid_core.pipeline.places import find_places

    maps = read_map(channels) if channels is not None else []
    if files:
        root, names = below_one_folder([*files, *apart], data)
        sources = list[dict[str, Any]]()
        for some, own, role in (
            (files, names[: len(files)], {}),
            (apart, names[len(files) :], {"role": "test"}),
        ):
            whole = settings_of_all(root, own, maps) if together and len(own) > 1 else None
            each = (
                [whole]
                if whole is not None
                else [settings_of_record(*one, maps, channels) for one in zip(some, own, strict=True)]
            )
            sources += [one | role for one in each]
        return root, sources
    if not maps or not all(any(one.get(key) for key in SOURCES) for one in maps):
        raise ConfigurationError(
            "no recordings are given; name the files, or a channel map that does (path, pattern or index)"
        )
    root = find_places(Path(FILE), data).data_root
    return root if root.is_dir() else Path.cwd(), maps  # without a data folder, paths begin where one stands


def below_one_folder(records: list[Path], data: Path | None) -> tuple[Path, list[str]]:
    """Return a folder that holds all records, and their names below it."""
    import os

    from robid_core.errors import ConfigurationError
    from robid_core.foreign import is_recording

    for record in records:
        if not is_recording(record):
            raise ConfigurationError(
                f"{record}: is a folder; name its recordings, {record}/*"
                if record.is_dir()
                else f"{record}: there is no such file"
            )
    whole = [record.resolve() for record in records]
    root = data.resolve() if data is not None else Path(os.path.commonpath([one.parent for one in whole]))
    outside = next((one for one in whole if not one.is_relative_to(root)), None)
    if outside is not None:
        raise ConfigurationError(f"{outside}: not below {root}; leave --data away, or name another folder")
    return root, [one.relative_to(root).as_posix() for one in whole]


def robot_below_here(robot: str) -> str:
    """Return a robot's name, or its file as the pipeline here names it; ConfigurationError where it is not below."""
    from robid_core.errors import ConfigurationError

    path, here = Path(robot), Path.cwd().resolve()
    if not path.is_absolute() and ".." not in path.parts:
        return robot
    whole = path.resolve()
    if not whole.is_relative_to(here):
        raise ConfigurationError(
            f"--robot {robot}: not below the folder in which the diagnosis is written; run the command in a folder "
            "above the robot file, or copy the file (with its `base`) here"
        )
    return whole.relative_to(here).as_posix()


def robots_of(variants: list[str], records: list[Path], names: list[str]) -> dict[str, str]:
    """Return the robot files of records that have one of their own, by the names of the records.

    Raises ConfigurationError where it is not RECORD=ROBOT, or the record is none of those that are diagnosed.
    """
    from robid_core.errors import ConfigurationError

    if variants and not records:
        raise ConfigurationError(
            "--variant names one of the RECORDs, and none is given; a channel map has `variant`"
        )
    if not variants:
        return {}
    named = {record.resolve(): name for record, name in zip(records, names, strict=True)}
    found = {}
    for one in variants:
        record, _, robot = one.partition("=")
        name = named.get(Path(record).resolve())
        if name is None or not robot:
            raise ConfigurationError(
                f"--variant {one}: give one of the records and its robot file, `--variant {records[-1]}=loaded.yaml`"
            )
        found[name] = robot
    return found


def pipeline_text(
    robot: str,
    sources: Sequence[Mapping[str, Any]],
    asked: Asked,
    drives: dict[str, Any] | None = None,
    experiment: SeparatingExperiment | None = None,
) -> str:
    """Return the pipeline that reads records and explains them; with an experiment, measures it and explains all.

    `sources` are settings of `acquisition.recorded`.
    """
    import json

    stages: dict[str, Any] = {
        f"record_{number + 1}": {
            "use": "acquisition.recorded",
            "with": dict(source)
            | ({"variant": source["path"]} if source.get("path") in asked.robots else {}),
        }
        for number, source in enumerate(sources)
    }
    names, told = list(stages), "explain"
    stages[told] = {"use": "diagnosis.effects", "inputs": {"record": names}, "with": asked.settings}
    if experiment is not None:
        stages |= stages_of(names, experiment, asked.settings)
        told = AGAIN
    stages["page"] = {"use": "report.html", "inputs": {"diagnosis": told, "record": names[0]}}
    lines = ["robid: 1", "name: diagnosis", "seed: 1", f"robot: {json.dumps(robot)}"]
    lines += [f"drives: {json.dumps(drives)}"] if drives is not None else []
    lines += ["stages:", *(f"  {name}: {json.dumps(stage)}" for name, stage in stages.items())]
    return "\n".join(lines) + "\n"
