"""`robid doctor`: whether this installation can work, and what it works with; or whether a robot's numbers can be."""

from __future__ import annotations

import functools
import os
import sys
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robid_core.errors import ConfigurationError, ExtraMissing, RobidError, StoreError

if TYPE_CHECKING:
    from robid_core.robot import Robot
    from robid_core.robot.remark import Remark

LIBRARIES = (
    "numpy",
    "scipy",
    "numba",
    "pydantic",
    "h5py",
    "pin",
    "cvxpy",
    "python-can",
    "canopen",
    "mcap",
    "torch",
)
Finding = tuple[int, str]  # exit code of the failure, 0 where all is well; what was found


def command(
    robot: Annotated[
        str | None,
        typer.Argument(help="Packaged robot or robot file to look at; left out: the installation."),
    ] = None,
) -> None:
    """Check versions, plugins, threads, the cache of compiled kernels, the data folder and the run folder.

    With a robot: look for implausible numbers in it. Exit code 2 where one is impossible, 0 with remarks.
    """
    if robot is not None:
        look_at(robot)
        return
    findings = [*versions(), *plugins(), kernel_cache(), threads(), data_folder(), run_folder()]
    for code, text in findings:
        typer.echo(f"{'FAIL' if code else 'ok  '} {text}")
    failures = [code for code, _ in findings if code]
    if failures:
        typer.echo(f"{len(failures)} of {len(findings)} checks failed", err=True)
        raise typer.Exit(failures[0])


def look_at(name: str) -> None:
    """Tell what is implausible about a robot; leaves with exit code 2 where something is impossible."""
    from robid_core.robot import Robot
    from robid_core.robot.file.document import line_of
    from robid_core.robot.file.reading import find_robot

    robot, file = Robot.load(name), find_robot(name)
    remarks = remarks_on_file(robot, file)
    for remark in remarks:
        degree = "FAIL" if remark.impossible else "note"
        typer.echo(f"{degree} {line_of(file, remark.key)}: {remark.sentence}")
    wrong = sum(remark.impossible for remark in remarks)
    if wrong:
        typer.echo(f"{robot.name}: {wrong} of {len(remarks)} findings are impossible", err=True)
        raise typer.Exit(ConfigurationError.exit_code)
    count = "1 remark" if len(remarks) == 1 else f"{len(remarks)} remarks"
    axes = "1 axis" if robot.n_axis == 1 else f"{robot.n_axis} axes"
    typer.echo(f"{robot.name}: {axes}, {count if remarks else 'nothing implausible'}")


def remarks_on_file(robot: Robot, file: Path) -> list[Remark]:
    """Return what is implausible about a robot, and about the factors by which its file changes its base."""
    from robid_core.robot.file.document import read_document
    from robid_core.robot.file.factors import unusual_factors
    from robid_core.robot.plausibility import remarks_on
    from robid_core.robot.remark import Remark

    factors = unusual_factors(read_document(file).data)
    found = [Remark(f"factors.{pattern}", what, path=("factors", pattern)) for pattern, what in factors]
    return [*found, *remarks_on(robot)]


def versions() -> list[Finding]:
    """Return the versions of robid, Python and the libraries whose results depend on them."""
    from robid_core import __version__

    found = []
    for name in LIBRARIES:
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            found.append(f"{name} not installed")
    code = 0 if sys.version_info >= (3, 11) else ConfigurationError.exit_code
    return [
        (code, f"robid {__version__}, Python {sys.version.split()[0]}"),
        (0, f"libraries: {', '.join(found)}"),
    ]


def plugins() -> list[Finding]:
    """Import every plugin; those that fail, or are not what their group asks for, are named with the reason.

    So are names that stand twice.
    """
    from robid_core.commands.trial import loaded_apart
    from robid_core.registered import check_registered
    from robid_core.registry import GROUPS, NOUNS, registry

    findings: list[Finding] = []
    count = 0
    for group in GROUPS:
        for name in registry().names(group):
            try:
                plugin = registry().find(group, name)
                loaded_apart(plugin, functools.partial(check_registered, plugin))
                count += 1
            except ExtraMissing as error:
                findings.append((0, f"optional {group} {error}"))
            except RobidError as error:
                said = " ".join(str(error).split())
                findings.append((error.exit_code, f"plugin {group} {said.removeprefix(NOUNS[group] + ' ')}"))
    return [(0, f"{count} plugins can be imported"), *findings]


def kernel_cache() -> Finding:
    """Tell where compiled kernels are kept, and whether that can be written."""
    from robid_core.compiled.machine_code import cache_folder

    return 0, f"compiled kernels are kept in {cache_folder('kernels')}, for all installations of this user"


def threads() -> Finding:
    """Tell the number of processors, and that a run takes one thread each."""
    from robid_core.executors import thread_settings

    each = ", ".join(f"{what} {count}" for what, count in thread_settings().items())
    return 0, f"{os.cpu_count()} processors; threads in each process of a run: {each}"


def data_folder() -> Finding:
    """Tell where measured data are looked for."""
    from robid_core.pipeline.places import ENVIRONMENT, find_places

    try:
        places = find_places(Path("pipeline.yaml"))
    except ConfigurationError as error:
        return error.exit_code, str(error)
    there = (
        ""
        if places.data_root.is_dir()
        else f"; not there: set {ENVIRONMENT} where a pipeline reads recordings"
    )
    return 0, f"measured data: {places.data_root} ({places.data_root_from}){there}"


def run_folder() -> Finding:
    """Tell whether results can be written beside a pipeline in this folder."""
    folder = Path.cwd()
    code, note = (0, "") if _writable(folder) else (StoreError.exit_code, " (this folder is read-only)")
    return code, f"results of pipelines here: {folder / 'runs'}{note}"


def _writable(folder: Path) -> bool:
    return os.access(folder, os.W_OK)
