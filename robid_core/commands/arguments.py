"""Arguments that several commands share, and the way they read a pipeline."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from robid_core.pipeline import Pipeline

PipelineArgument = Annotated[Path, typer.Argument(help="The pipeline file.", show_default="pipeline.yaml")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Change a setting, as stages.fit.with.starts=50."),
]
DataRoot = Annotated[
    Path | None,
    typer.Option("--data", metavar="FOLDER", help="Folder of measured data, in place of ROBID_DATA."),
]
DEFAULT_PIPELINE = Path("pipeline.yaml")


def truth_as_robot(pipeline: Pipeline) -> str:
    """Say that a pipeline begins at the truth behind simulated drives; empty where it does not."""
    from robid_core.robot.file.reading import PACKAGED_FILES

    nominal = pipeline.robot.source.removesuffix("_true")
    if pipeline.robot.source not in PACKAGED_FILES or nominal == pipeline.robot.source:
        return ""
    return (
        f"{pipeline.robot.source} is the truth behind simulated drives, where fits begin at what they are to find; the "
        f"robot file of a real one is not as right: robot: {nominal}"
    )


def load_pipeline(file: Path, overrides: list[str] | None, data: Path | None) -> Pipeline:
    """Read a pipeline as a command asks for it; where plugins of third parties are named, in a copy first."""
    from robid_core.commands.trial import foreign_plugins, in_a_copy
    from robid_core.pipeline import Pipeline

    def load() -> Pipeline:
        return Pipeline.load(file, tuple(overrides or ()), data_root=data)

    if plugins := foreign_plugins(file):
        in_a_copy(lambda: bool(load()), plugins, "the pipeline was read")
    return load()
