"""`robid export`: a robot as a file for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from robid_core.arrays import FloatArray
    from robid_core.artifacts import Model
    from robid_core.robot import Robot

FORMATS = {
    "robot": (".yaml", ".yml"),
    "urdf": (".urdf",),
    "mjcf": (".xml", ".mjcf"),
    "state_space": (".mat", ".npz"),
    "table": (".csv", ".json"),
}


def command(
    robot: Annotated[str, typer.Argument(help="Packaged robot, robot file, or robot.<stage>.yaml of a run.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="The file to write.")],
    to: Annotated[
        str | None,
        typer.Option("--to", help=f"{', '.join(FORMATS)}; left out: what the ending of the file says."),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            "--at", metavar="ANGLES", help="state_space: joint-side motor angles, as 0,0.5,-1; zeros."
        ),
    ] = None,
    outputs: Annotated[
        str | None,
        typer.Option(
            "--outputs", metavar="NAMES", help="state_space: outputs, as motor_acceleration,arm_angle."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")] = False,
) -> None:
    """Write a robot for other programs.

    robot: robot.yaml, bodies inline. urdf and mjcf (MuJoCo): elastic joints as joints. state_space: A, B, C, D of the
    linear model at --at for MATLAB or python-control. table: every named number with its unit, of a run's robot with
    covariance.
    """
    from robid_core.errors import ConfigurationError, StoreError
    from robid_core.robot import Robot

    kind = chosen_format(out, to)
    if kind != "state_space" and (at is not None or outputs is not None):
        raise ConfigurationError(f"--at and --outputs are for state_space; {kind} has no use for them")
    if out.exists() and not overwrite:
        raise ConfigurationError(f"{out} is there already; name another file, or say --overwrite")
    loaded = Robot.load(robot)
    written, told = content(loaded, robot, kind, out.suffix.lower(), at, outputs)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_bytes(written)
    except OSError as error:
        raise StoreError(f"{out}: cannot be written: {error.strerror}") from error
    typer.echo(f"{out}: {loaded.name} as {kind}{told}")
    if kind in ("urdf", "mjcf"):
        typer.echo(
            "- fixed links (flange, tool) are part of the link that carries them; meshes are not written"
        )
        if effects := loaded.description.effects:
            typer.echo(f"- {kind} has no place for effects, left out: {', '.join(effects)}")


def chosen_format(out: Path, to: str | None) -> str:
    """Return the format that is asked for, or that the ending of the file says.

    Raises ConfigurationError where neither says one, or they disagree.
    """
    from robid_core.errors import ConfigurationError
    from robid_core.yaml_file.problems import suggestion

    if to is not None and to not in FORMATS:
        raise ConfigurationError(f"--to {to}: no such format; {suggestion(to, FORMATS, 'there are')}")
    suffix = out.suffix.lower()
    fitting = [kind for kind, endings in FORMATS.items() if suffix in endings]
    if to is None and not fitting:
        endings = ", ".join(ending for endings in FORMATS.values() for ending in endings)
        raise ConfigurationError(f"{out}: the ending says no format; end it with one of {endings}")
    if to is not None and to not in fitting:
        raise ConfigurationError(f"{out}: a file of {to} ends with {' or '.join(FORMATS[to])}")
    return to or fitting[0]


def content(
    robot: Robot, source: str, kind: str, suffix: str, at: str | None, outputs: str | None
) -> tuple[bytes, str]:
    """Return what the file holds, and what is told of it."""
    if kind == "state_space":
        from robid_core.robot.state_space import OUTPUTS, state_space_file

        angle = configuration(at, robot)
        names = OUTPUTS if outputs is None else tuple(name.strip() for name in outputs.split(","))
        place = ", ".join(f"{value:g}" for value in angle)
        return state_space_file(robot, angle, suffix, names), f" at ({place}), continuous time"
    if kind == "table":
        from robid_core.robot.parameter_table import parameter_table

        model = model_of(source, robot)
        told = (
            ", no covariance: no robot of a run" if model is None else f", {len(model.free_names)} estimated"
        )
        return parameter_table(robot, model, suffix).encode("utf-8"), told
    texts = {"robot": robot.to_yaml, "urdf": robot.to_urdf, "mjcf": robot.to_mjcf}
    return texts[kind]().encode("utf-8"), ""


def configuration(text: str | None, robot: Robot) -> FloatArray:
    """Return the joint-side motor angles that a person wrote; zeros where nothing is written."""
    import numpy as np

    from robid_core.errors import ConfigurationError

    if text is None:
        return np.zeros(robot.n_axis)
    try:
        angle = np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise ConfigurationError(f"--at {text}: give {robot.n_axis} numbers with commas, rad or m") from None
    if len(angle) == robot.n_axis:  # another number is refused by the robot
        limits = zip(robot.axis_names, angle, robot.drives.lower, robot.drives.upper, strict=True)
        for name, value, lower, upper in limits:
            if not lower <= value <= upper:
                raise ConfigurationError(
                    f"--at {text}: {value:g} is beyond the limits of {name}, {lower:g} to {upper:g} rad or m; degrees?"
                )
    return angle


def model_of(source: str, robot: Robot) -> Model | None:
    """Return the model that a run's robot file was written of; None for any other file.

    Raises ConfigurationError where the run has another result meanwhile: its covariance is of other numbers.
    """
    from robid_core.artifacts import Artifact, Model
    from robid_core.errors import ConfigurationError
    from robid_core.run.folder import RunFolder
    from robid_core.run.results import manifest_of, refuse_damaged

    path = Path(source)
    parts = path.name.split(".")
    if len(parts) != 3 or parts[0] != "robot" or not (path.parent / "manifest.json").is_file():
        return None
    folder = RunFolder(path.parent)
    record = manifest_of(folder).stages.get(parts[1])
    if record is None or not record.file:
        return None
    file = folder.path / record.file
    refuse_damaged(file, record.sha256)
    model = getattr(Artifact.read(file), "model", None)
    if not isinstance(model, Model):
        return None
    if type(robot).of_model(model).parameters() != robot.parameters():
        raise ConfigurationError(
            f"{path}: other numbers than stage '{parts[1]}' found, not those of this covariance; run it again"
        )
    return model
