"""`robid init`: a new project from a template, around a packaged robot or the URDF of one's own."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated
from xml.sax.saxutils import escape

import typer

TEMPLATES = Path(__file__).with_name("templates")
FIRST = """
First replace every `fill_in` of `robot.yaml` (`robid validate` lists them) and the proposed springs by what data sheets
say; `robid doctor robot.yaml` looks for implausible values. `plant.yaml` is the simulated machine: the same robot with
springs a quarter softer.
"""


def command(
    folder: Annotated[Path, typer.Argument(help="Folder of the project; made where it does not exist.")],
    robot: Annotated[
        str, typer.Option("--robot", help="Packaged robot to begin with, or the URDF file of your own.")
    ] = "one_axis",
    own_robot: Annotated[
        bool, typer.Option("--own-robot", help="Copy the robot into the project as robot.yaml, to be edited.")
    ] = False,
    lock: Annotated[
        list[str] | None,
        typer.Option(
            "--lock", metavar="JOINT", help="Joint of the URDF that does not move; may be repeated."
        ),
    ] = None,
    plugin: Annotated[
        str | None,
        typer.Option(
            "--plugin", help="A package of your own in place of a project: estimator, effect, fit, report."
        ),
    ] = None,
) -> None:
    """Make a new project: a pipeline of a simulated robot that runs as it is, and a README that says what to change.

    With a URDF the project holds a robot.yaml in which whatever a URDF cannot know waits to be filled in. With
    --plugin: a package with a plugin that runs as it is, and the test of its kind. Nothing is overwritten.
    """
    from robid_core.commands.init_plugin import plugin_files
    from robid_core.errors import ConfigurationError, StoreError

    if Path(robot).suffix and own_robot:
        raise ConfigurationError(
            "--own-robot copies a packaged robot; the project of a URDF has its own anyway"
        )
    remarks: tuple[str, ...] = ()
    if plugin:
        files, following = plugin_files(folder, plugin), f"cd {folder} && pip install -e . && pytest"
    elif Path(robot).suffix:
        files, remarks, following = files_of_urdf(folder, Path(robot), tuple(lock or ()))
    elif lock:
        raise ConfigurationError(f"--lock is for joints of a URDF; {robot} is none")
    else:
        files = project_files(folder, robot, own_robot)
        following = f"cd {folder} && robid plan && robid run"
    present = [name for name in files if (folder / name).exists()]
    if present:
        raise ConfigurationError(
            f"{folder}: holds {' and '.join(present)} already, which would be overwritten; name another folder"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            with (folder / name).open("x", encoding="utf-8") as file:
                file.write(text)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written: {error.strerror}; name another folder") from error
    typer.echo(f"{folder}: {', '.join(files)}")
    for remark in remarks:
        typer.echo(f"- {remark}")
    typer.echo(f"next: {following}")


def project_files(folder: Path, robot: str, own_robot: bool) -> dict[str, str]:
    """Return the texts of a new project by file name; ConfigurationError for a robot that is not packaged."""
    from robid_core.errors import ConfigurationError
    from robid_core.robot import Robot
    from robid_core.robot.file.reading import PACKAGED_FILES
    from robid_core.yaml_file.problems import suggestion

    nominal = [name for name in PACKAGED_FILES if f"{name}_true" in PACKAGED_FILES]
    if robot not in nominal:
        raise ConfigurationError(f"no packaged robot '{robot}'; {suggestion(robot, nominal, 'there are')}")
    loaded = Robot.load(robot)
    count = configurations_for(len(loaded.stiffness_names))
    files = _filled(folder, "robot.yaml" if own_robot else robot, f"{robot}_true", count)
    if own_robot:
        files["robot.yaml"] = loaded.to_yaml()
    return files


def files_of_urdf(
    folder: Path, urdf: Path, lock: tuple[str, ...]
) -> tuple[dict[str, str], tuple[str, ...], str]:
    """Return the texts of a project around a URDF by file name, remarks, and what to do next.

    Raises ConfigurationError where the file is no URDF, or cannot be a chain.
    """
    from robid_core.errors import ConfigurationError
    from robid_core.robot.draft import draft_of

    if not urdf.is_file():
        raise ConfigurationError(
            f"--robot {urdf}: there is no such file; name the URDF file of your robot, or a packaged robot"
        )
    name = project_name(folder)
    draft = draft_of(urdf, name, lock)
    files = _filled(folder, "robot.yaml", "plant.yaml", configurations_for(draft.n_springs), FIRST)
    files |= {
        "robot.yaml": draft.robot,
        "plant.yaml": draft.plant,
        urdf.name: with_mesh_places(urdf.read_text(encoding="utf-8"), draft.meshes, folder),
    }
    following = (
        f"cd {folder}, fill in the {draft.to_fill_in} values that robid validate lists, then robid doctor robot.yaml "
        "&& robid plan && robid run"
    )
    return files, draft.remarks, following


def with_mesh_places(urdf: str, meshes: Mapping[str, Path], folder: Path) -> str:
    """Return the text of a URDF in which meshes have names that hold in another folder: paths from there."""
    for name, file in meshes.items():
        place = Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
        for quote in "\"'":
            urdf = urdf.replace(f"{quote}{name}{quote}", f"{quote}{escape(place)}{quote}")
    return urdf


def configurations_for(n_springs: int) -> int:
    """Return how many random configurations separate so many elastic coordinates: one for each three, two at least.

    Springs whose axes are parallel in a configuration yield as one there, and arms have axes that always are: of
    eleven springs of a six-axis arm two configurations left four pairs inseparable, four left none.
    """
    return max(2, math.ceil(n_springs / 3))


def _filled(folder: Path, robot: str, plant: str, count: int, first: str = "") -> dict[str, str]:
    values = {
        "NAME": project_name(folder),
        "ROBOT": robot,
        "PLANT": plant,
        "COUNT": str(count),
        "FIRST": first,
    }
    return {
        target: fill((TEMPLATES / source).read_text(encoding="utf-8"), values)
        for target, source in (("pipeline.yaml", "pipeline.template"), ("README.md", "readme.template"))
    }


def project_name(folder: Path) -> str:
    """Return the folder's name as far as it can name a pipeline."""
    from robid_core.settings_types import is_device_name

    kept = "".join(
        letter if letter.isascii() and letter.isalnum() else "-" for letter in folder.resolve().name
    )
    kept = kept.strip("-")[:64]
    return "project" if not kept or is_device_name(kept) else kept


def fill(template: str, values: dict[str, str]) -> str:
    """Return the template with `@NAME@` and its like replaced."""
    for key, value in values.items():
        template = template.replace(f"@{key}@", value)
    return template
