"""The folder of a run: `runs/<pipeline name>/` beside the pipeline file, and what stands where in it.

`runs` may be a link to a folder elsewhere, as on a larger disk.
"""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path

from robid_core.errors import ConfigurationError
from robid_core.pipeline import Pipeline
from robid_core.store import failures_named
from robid_core.yaml_file.characters import decode
from robid_core.yaml_file.kind import PIPELINE_FILE, of_another_kind
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.problems import ProblemList

RUNS = "runs"


def name_of(file: Path) -> str:
    """Return the name in a pipeline file, for which its data, its robot and its plugins need not be there.

    Raises
    ------
    RobidError
        As `Pipeline.load` does, where the file is no mapping with a name.
    """
    problems = ProblemList(str(file))
    with failures_named("read", file):
        text = decode(file.read_bytes(), PIPELINE_FILE, problems)
    root = read_nodes(text, PIPELINE_FILE, problems) if text is not None else None
    if root is not None and (told := of_another_kind(root.entries(), PIPELINE_FILE)):
        problems.add(root.mark, (), told)
        problems.raise_if_any()
    name = root.get("name") if root is not None else None
    if name is None or not isinstance(name.value, str):
        return Pipeline.load(file).name
    return name.value


@dataclass(frozen=True)
class RunFolder:
    """Paths of one run: the pipeline as read, the manifest, the log, the lock, records of motions."""

    path: Path

    @classmethod
    def of(cls, pipeline: Pipeline) -> RunFolder:
        """Return the folder of a pipeline, whether it was run or not."""
        return cls(pipeline.folder / RUNS / pipeline.name)

    @classmethod
    def find(cls, where: Path) -> RunFolder:
        """Return the run that a person means by a run folder, a file in it, a pipeline file, or a name in `runs`."""
        if not where.exists() and len(where.parts) == 1 and (RUNS / where).is_dir():
            where = RUNS / where
        if (
            where.suffix in (".yaml", ".yml")
            and where.is_file()
            and not (where.parent / "manifest.json").exists()
        ):
            where = where.parent / RUNS / name_of(where)
        for candidate in (where, *where.parents[:2]):
            if (candidate / "manifest.json").is_file():
                return cls(candidate)
        lacking = "no manifest.json in it" if where.exists() else "no such file or folder"
        raise ConfigurationError(
            f"{where}: not a run, there is {lacking}; name a folder in '{RUNS}', or run the pipeline first"
        )

    def others(self) -> tuple[Path, ...]:
        """Return the folders of the runs beside this one, in the order of their names."""
        beside = self.path.parent
        if not beside.is_dir():
            return ()
        with failures_named("read", beside):
            folders = sorted(path for path in beside.iterdir() if path != self.path)
        return tuple(path for path in folders if _has_results(path))

    @property
    def manifest(self) -> Path:
        """Everything from which the run can be made again."""
        return self.path / "manifest.json"

    @property
    def pipeline(self) -> Path:
        """The pipeline as it was read."""
        return self.path / "pipeline.yaml"

    @property
    def log(self) -> Path:
        """What happened, run after run."""
        return self.path / "log.txt"

    @property
    def raw(self) -> Path:
        """Raw logs of motions, a file for each acquisition; no artifacts."""
        return self.path / "raw"

    def robot(self, stage: str) -> Path:
        """The robot that a stage found, as a robot file."""
        return self.path / f"robot.{stage}.yaml"

    def verdict(self, stage: str) -> Path:
        """What a diagnosis found, as JSON."""
        return self.path / f"verdict.{stage}.json"

    @property
    def lock(self) -> Path:
        """The file whose lock a run holds."""
        return self.path / "store" / "lock"

    @property
    def motions(self) -> Path:
        """Records of motions on hardware."""
        return self.path / "store" / "motions"

    def make(self) -> None:
        """Make what must be there before the lock can be taken."""
        runs = self.path.parent
        if runs.is_symlink() and not runs.is_dir():
            raise ConfigurationError(
                f"{runs}: a link to {runs.readlink()}, which is no folder; make that folder, or remove the link"
            )
        with failures_named("make", self.path):
            self.lock.parent.mkdir(parents=True, exist_ok=True)

    def require_writable(self) -> None:
        """Raise StoreError where the lock could not be taken because nothing may be written here."""
        with failures_named("lock", self.lock):
            descriptor = os.open(self.lock, os.O_RDWR | os.O_CREAT, 0o644)
        with contextlib.suppress(OSError):
            os.close(descriptor)


def _has_results(path: Path) -> bool:
    try:
        return (path / "store" / "index").is_dir()
    except PermissionError:  # another user's, who keeps it closed
        return False
