"""How to run, and what a run did."""

from __future__ import annotations

from dataclasses import dataclass

from robid_core.pipeline import Pipeline
from robid_core.run.folder import RunFolder
from robid_core.run.manifest import Manifest

ALL = "*"


@dataclass(frozen=True)
class RunOptions:
    """What the command line asks for, with the names it has there."""

    first: str | None = None
    """--from: this stage and what depends on it; the rest must be in the store."""
    last: str | None = None
    """--until: this stage and what it needs."""
    force: tuple[str, ...] = ()
    """--force: make these stages again though they are up to date; `ALL` for every chosen one."""
    jobs: int = 0
    """--jobs: worker processes; 0 takes what the pipeline says, or as many as there are processors."""
    locked: bool = False
    """--locked: refuse unless everything is as the manifest says."""
    wait: bool = True
    """Not --no-wait: wait for another run in the same folder."""
    again: bool = False
    """--again: make recordings on hardware anew."""
    at_the_robot: bool = False
    """--at-the-robot: a person stands at the emergency stop; without it no hardware moves."""
    check: bool = False
    """--check: run each stage that is made twice, and refuse one that gives other bytes."""
    deadline_s: float | None = None
    """--deadline: longest time for one stage, after which its processes are killed; not for hardware."""
    memory_mb: int | None = None
    """--memory: most memory that one stage may take; not for hardware."""
    trust_plugins: bool = False
    """--trust-plugins: run stages of third parties in the run's own process, not each in one of its own."""
    strict: bool = False
    """--strict: any doubt about a result is one too many; remarks are none."""

    def forced(self, pipeline: Pipeline) -> set[str]:
        """Return the names of the stages to make again; ConfigurationError where one does not exist."""
        if ALL in self.force:
            return {node.name for node in pipeline.stages}
        return {pipeline.stage(name).name for name in self.force}


@dataclass(frozen=True)
class RunResult:
    """Result of a run: each stage made, same, kept or refused; warnings, doubts and remarks.

    `exit_code` is 0, or 6 where numbers must not be used: a stage gave no result, a fit did not converge, or, with
    `strict`, there is any doubt.
    """

    folder: RunFolder
    manifest: Manifest
    outcomes: dict[str, str]
    warnings: tuple[str, ...]
    doubts: tuple[str, ...]
    remarks: tuple[str, ...]
    seconds: float
    exit_code: int

    @property
    def idle(self) -> bool:
        """Tell whether nothing had to be done."""
        return all(outcome == "kept" for outcome in self.outcomes.values())
