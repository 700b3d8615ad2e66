"""`robid adopt`: what a fit found, put into the robot file of the pipeline, comments and all."""

from __future__ import annotations

import difflib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robid_core.commands.arguments import DEFAULT_PIPELINE, DataRoot, load_pipeline
from robid_core.errors import ConfigurationError, NotTrustworthy, StoreError

if TYPE_CHECKING:
    from robid_core.artifacts import Model
    from robid_core.pipeline import Pipeline


def command(
    words: Annotated[
        list[str],
        typer.Argument(metavar="[PIPELINE] STAGE", help="The fit, or the diagnosis, whose robot is taken."),
    ],
    data: DataRoot = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show what would change; write nothing.")
    ] = False,
) -> None:
    """Put what a fit found into the pipeline's robot file: numbers change where they stand, comments stay.

    The next run begins with this robot; what depends on it is made again.
    """
    if len(words) > 2:
        raise ConfigurationError(
            f"one stage at a time, not {' '.join(words)}; write robid adopt [PIPELINE] STAGE"
        )
    file = Path(words[0]) if len(words) == 2 else DEFAULT_PIPELINE
    typer.echo("\n".join(adopt(load_pipeline(file, None, data), words[-1], dry_run)))


def adopt(pipeline: Pipeline, stage: str, dry_run: bool = False) -> list[str]:
    """Rewrite the robot file of a pipeline and return what changed, as the lines of a unified diff.

    Raises
    ------
    ConfigurationError
        Where the stage found no robot, the robot is packaged, the file changed since, or a number has no place in it.
    NotTrustworthy
        Where the fit did not converge.
    """
    from robid_core.robot.file.in_place import with_model
    from robid_core.robot.file.reading import PACKAGED_FILES

    model, found = _model(pipeline, stage)
    if pipeline.robot.source in PACKAGED_FILES:
        raise ConfigurationError(
            f"{pipeline.robot.written} comes with robid and stays as it is; take {found} as robot, or begin with a "
            "robot file of your own (robid init --own-robot)"
        )
    path = Path(pipeline.robot.source)
    try:
        before = path.read_bytes().decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: cannot be read: {error}") from error
    after = with_model(before, path, model)
    if not dry_run:
        draft = path.with_name(f"{path.name}.{os.getpid()}")
        try:
            draft.write_bytes(after.encode("utf-8"))
            draft.replace(path)
        except OSError as error:
            draft.unlink(missing_ok=True)
            raise StoreError(f"{path}: cannot be written: {error}; the file is as it was") from error
    lines = difflib.unified_diff(
        before.splitlines(), after.splitlines(), path.name, path.name, "", stage, 1, ""
    )
    return list(lines) or [f"{path.name} has these numbers already"]


def _model(pipeline: Pipeline, stage: str) -> tuple[Model, Path]:
    """Return the model of a stage's last result, and the robot file that the run wrote of it."""
    from robid_core.artifacts import Fit
    from robid_core.run import RunFolder
    from robid_core.run.results import manifest_of, refuse_damaged

    folder, node = RunFolder.of(pipeline), pipeline.stage(stage)
    record = manifest_of(folder).stages.get(node.name)
    if record is None or not record.file:
        raise ConfigurationError(f"stage '{stage}' has no result; robid run makes it")
    path = folder.path / record.file
    if not path.is_file():
        raise ConfigurationError(f"{path}: there is no such file; robid run makes it")
    refuse_damaged(path, record.sha256)
    artifact = node.stage.output.read(path)
    if isinstance(artifact, Fit) and not artifact.converged:
        raise NotTrustworthy(f"stage {stage}: the fit must not be used: {artifact.status}")
    model: Model | None = getattr(artifact, "model", None)
    if model is None:
        raise ConfigurationError(
            f"stage '{stage}': its {type(artifact).__name__} holds no robot; name a fit that gives a model"
        )
    return model, folder.robot(stage)
