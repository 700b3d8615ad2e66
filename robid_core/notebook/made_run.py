"""A run as a mapping: artifacts by the stage that made them, read and verified when they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

from robid_core.artifacts import Artifact
from robid_core.artifacts.tables import Table
from robid_core.compiled.telling import compilation_told
from robid_core.pipeline import Pipeline
from robid_core.robot import Robot
from robid_core.run import RunFolder, RunOptions, run_pipeline
from robid_core.run.lent_robot import robot_from
from robid_core.run.manifest import Manifest
from robid_core.run.results import manifest_of, read_artifact, result_path

ONE_PROCESS = 1  # more start Python anew, which a script without a main guard does not survive


class Run(Mapping[str, Artifact]):
    """The folder `runs/<name>` of a pipeline: `run["fit"]` is what the stage `fit` made.

    Examples
    --------
    >>> import tempfile, robid_core as robid
    >>> pipeline = robid.Pipeline.from_dict(
    ...     {"robot": "one_axis", "stages": {"where": {"use": "design.candidates", "with": {"count": 2}}}},
    ...     folder=tempfile.mkdtemp())
    >>> run = robid.Run.make(pipeline)
    >>> list(run), run["where"].n_config, run.outcomes
    (['where'], 2, {'where': 'made'})
    >>> robid.Run.load(run.path)["where"].n_config
    2
    >>> run.table()["result"], run.doubts
    (['Configurations'], ())
    >>> run.robot("where")  # of a fit the robot that it found
    Traceback (most recent call last):
    robid_core.errors.ConfigurationError: ... holds no model...
    """

    def __init__(self, folder: RunFolder, manifest: Manifest) -> None:
        self._folder, self.manifest = folder, manifest

    @classmethod
    def make(
        cls,
        pipeline: Pipeline | Mapping[str, Any] | Path | str,
        *,
        first: str | None = None,
        last: str | None = None,
        force: tuple[str, ...] = (),
        jobs: int = ONE_PROCESS,
    ) -> Run:
        """Bring the results of a pipeline up to date, as `robid run` does, and return them.

        Parameters
        ----------
        pipeline
            A pipeline, its file, or what `Pipeline.from_dict` takes.
        first, last
            The stages to begin and to end with.
        force
            Stages that are made again though they are up to date.
        jobs
            Processes; more than one in a script only below `if __name__ == "__main__":`.

        Raises
        ------
        RobidError
            As its class says; what was finished before is kept.
        """
        if isinstance(pipeline, Mapping):
            pipeline = Pipeline.from_dict(pipeline)
        elif not isinstance(pipeline, Pipeline):
            pipeline = Pipeline.load(pipeline)
        with compilation_told():
            result = run_pipeline(pipeline, RunOptions(first=first, last=last, force=force, jobs=jobs))
        return cls(result.folder, result.manifest)

    @classmethod
    def load(cls, where: Path | str) -> Run:
        """Return a run by its folder, a file in it, or its pipeline file; nothing is run."""
        folder = RunFolder.find(Path(where))
        return cls(folder, manifest_of(folder))

    @property
    def path(self) -> Path:
        """The folder."""
        return self._folder.path

    @property
    def outcomes(self) -> dict[str, str]:
        """What became of each stage: made, same, kept, refused, or earlier."""
        return {name: record.outcome for name, record in self.manifest.stages.items()}

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why numbers of fits should be doubted, and which stages gave no result."""
        found = []
        for name, record in self.manifest.stages.items():
            if record.note:
                found.append(f"stage {name}: {record.note}")
            found += [f"stage {name}: {doubt['sentence']}; {doubt['remedy']}" for doubt in record.doubts]
        return tuple(found)

    def robot(self, stage: str) -> Robot:
        """Return the robot that a stage found; raises NotTrustworthy where its fit did not converge."""
        return robot_from(self[stage], stage, "kernel")

    def table(self) -> Table:
        """Return a row for each stage: what it made, and what became of it."""
        records = self.manifest.stages
        return Table(
            stage=list(records),
            result=[record.artifact or "-" for record in records.values()],
            outcome=[record.outcome for record in records.values()],
            seconds=[record.seconds for record in records.values()],
            file=[record.file for record in records.values()],
        )

    def __getitem__(self, stage: str) -> Artifact:
        """Return what a stage made; ConfigurationError names the ones that made something."""
        return read_artifact(result_path(self._folder, self.manifest, stage))

    def __iter__(self) -> Iterator[str]:
        """Yield the stages that made something."""
        return (name for name, record in self.manifest.stages.items() if record.file)

    def __len__(self) -> int:
        """Count them."""
        return sum(1 for _ in self)

    def __repr__(self) -> str:
        return f"<Run {self.manifest.name}: {self.manifest.status}, {', '.join(self)}>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows of it."""
        doubts = "".join(f"<p>{escape(doubt)}</p>" for doubt in self.doubts)
        head = escape(f"{self.manifest.name}: {self.manifest.status}, in {self.path}")
        return f"<div><b>Run</b> {head}{self.table()._repr_html_()}{doubts}</div>"
