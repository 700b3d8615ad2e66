"""Calls a stage with what its `run` asks for: artifacts read back from the store, and what the run lends."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from robid_core.artifacts import Artifact, Truth
from robid_core.compiled.telling import compilation_told
from robid_core.drives import Drives
from robid_core.executors import ProcessMap, process_executor
from robid_core.interruption import heed
from robid_core.pipeline import StageNode
from robid_core.pipeline.wiring import each
from robid_core.robot import Robot
from robid_core.run.arguments import arguments_of
from robid_core.run.beginning import executor_choice
from robid_core.run.compilation import compile_ahead
from robid_core.run.confine import run_confined
from robid_core.run.confined_stage import Job
from robid_core.run.folder import RunFolder
from robid_core.run.guard import checked_result
from robid_core.run.identity import Surroundings, child_generator
from robid_core.run.lent_robot import (
    possible_effects,
    refuse_unnamed_effects,
    robot_from,
    robot_source,
)
from robid_core.run.log import NAME
from robid_core.run.options import RunOptions
from robid_core.run.process_state import state_taken_back
from robid_core.run.progress import Listener
from robid_core.stage import Context, MapTasks, Progress, ReportStage
from robid_core.store import Entry, Store, failures_named


class Caller:
    """Calls stages with the services that a run has for them."""

    def __init__(
        self, shared: Surroundings, store: Store, tasks: MapTasks, listener: Listener, options: RunOptions
    ) -> None:
        self._shared, self._store, self._tasks = shared, store, tasks
        self._listener, self._options = listener, options
        self._compiled = False

    def call(self, node: StageNode, entries: Mapping[str, Entry]) -> Artifact:
        """Run a stage on stored artifacts (by the stage that made them) and return its checked result.

        Inputs come from the store, verified, never as another stage left them in memory: a run that was
        killed and resumed computes with the same bytes as one that was not.
        """
        if self._is_confined(node):
            return self._checked(node, self._confined(node, entries))
        artifacts = {
            parameter: [self._store.read(entry, kind) for kind, entry in found]
            for parameter, found in self._inputs(node, entries).items()
        }
        log = logging.getLogger(f"{NAME}.{node.name}")
        arguments: dict[str, Any] = {**arguments_of(node.stage, artifacts, log), **self._lent(node, entries)}
        for parameter, kind in node.stage.lends().items():
            if kind is Context:
                arguments[parameter] = make_context(
                    node.name,
                    self._shared.pipeline.seed,
                    self._shared.pipeline.data_root,
                    ProcessMap(1) if _has_drives(node) else self._tasks,
                    self._progress(node),
                    self._raw_folder(node),
                    *self._told(node),
                )
        self._compile_ahead(node)
        with state_taken_back(log), compilation_told(lambda kernel: self._tell_compilation(node, kernel)):
            return self._checked(node, node.stage.run(**arguments))

    def _told(self, node: StageNode) -> tuple[str, tuple[str, ...]]:
        """Return the run's name, and what the stages before this one warned of: reports print both."""
        if not isinstance(node.stage, ReportStage):
            return "", ()
        return self._shared.pipeline.name, self._shared.warnings_before(node)

    def _is_confined(self, node: StageNode) -> bool:
        """Tell whether a stage gets a process of its own: under a limit, or where code of a third party is in it."""
        limited = self._options.deadline_s is not None or self._options.memory_mb is not None
        foreign = any(plugin.is_foreign for plugin in (node.plugin, *node.references))
        wanted = limited or (foreign and not self._options.trust_plugins)
        return wanted and not self._shared.moves_hardware(node.stage)

    @staticmethod
    def _checked(node: StageNode, result: Any) -> Artifact:
        return checked_result(node.name, node.plugin, node.stage, result)

    def _raw_folder(self, node: StageNode) -> Path:
        """Return the folder for logs that are no artifacts; each motion of hardware gets one of its own."""
        folder = RunFolder.of(self._shared.pipeline).raw
        if self._shared.moves_hardware(node.stage):
            numbered = (folder / f"{node.name}-{number}" for number in itertools.count(1))
            folder = next(path for path in numbered if not path.exists())
        with failures_named("make", folder):
            folder.mkdir(parents=True, exist_ok=True)
        return folder

    def _compile_ahead(self, node: StageNode) -> None:
        """Compile what simulations need before the first stage of a pipeline that simulates; once a process."""
        stages = self._shared.pipeline.stages
        if not self._compiled and Robot in node.stage.lends().values() and any(map(_has_drives, stages)):
            self._compiled = True
            jobs = self._tasks.jobs if isinstance(self._tasks, ProcessMap) else 0
            compile_ahead(self._progress(node), jobs, self._listener.note)

    def _tell_compilation(self, node: StageNode, kernel: str) -> None:
        if not self._compiled:
            self._compiled = True
            self._listener.note(
                f"{node.name}: compiling kernels as they are needed, once: {kernel} and others"
            )

    def _inputs(
        self, node: StageNode, entries: Mapping[str, Entry]
    ) -> dict[str, list[tuple[type[Artifact], Entry]]]:
        """Return class and entry of what feeds each input; an optional one whose stage gave nothing stays away."""
        output = {stage.name: stage.stage.output for stage in self._shared.pipeline.stages}
        wanted = {item.name for item in node.stage.inputs()}
        return {
            parameter: [(output[name], entries[name]) for name in each(source) if name in entries]
            for parameter, source in node.inputs.items()
            if parameter in wanted and (not isinstance(source, str) or source in entries)
        }

    def _robot(self, node: StageNode, entries: Mapping[str, Entry]) -> Robot:
        """Return the nominal robot, or the one that the stage takes from another."""
        pipeline, source = self._shared.pipeline, robot_source(node)
        if source is None:
            return self._shared.robot
        artifact = self._store.read(entries[source], pipeline.stage(source).stage.output)
        robot = robot_from(artifact, source, pipeline.robot.dynamics)
        refuse_unnamed_effects(robot, source, possible_effects(node, pipeline, self._shared.robot))
        return robot

    def _lent(self, node: StageNode, entries: Mapping[str, Entry]) -> dict[str, Any]:
        """Return robot, drives and truth, where the stage asks for them."""
        lent: dict[str, Any] = {}
        drives = self._shared.drives
        for parameter, kind in node.stage.lends().items():
            if kind is Robot:
                lent[parameter] = self._robot(node, entries)
            elif kind is Truth:
                lent[parameter] = drives.truth(self._shared.robot) if drives is not None else None
            elif issubclass(kind, Drives):
                lent[parameter] = drives
        return lent

    def _confined(self, node: StageNode, entries: Mapping[str, Entry]) -> Artifact:
        pipeline = self._shared.pipeline
        context = [parameter for parameter, kind in node.stage.lends().items() if kind is Context]
        with self._store.draft(node.stage.output.suffix) as result:
            job = Job(
                name=node.name,
                plugin=str(node.plugin),
                stage=node.stage,
                artifacts={
                    parameter: [(kind, self._store.verified_path(entry)) for kind, entry in found]
                    for parameter, found in self._inputs(node, entries).items()
                },
                lent=self._lent(node, entries),
                context=(
                    (context[0], pipeline.seed, pipeline.data_root, self._raw_folder(node))
                    if context
                    else None
                ),
                executor=(
                    (process_executor, {"jobs": 1})
                    if _has_drives(node)
                    else executor_choice(pipeline, self._options)
                ),
                result=result,
                has_drives=_has_drives(node),
                told=self._told(node),
            )
            self._compile_ahead(node)
            run_confined(job, self._options.deadline_s, self._options.memory_mb, self._hear(node))
            return node.stage.output.read(result)

    def _hear(self, node: StageNode) -> Callable[..., None]:
        """Return what is called with what a stage in another process tells."""
        progress = self._progress(node)

        def hear(what: str, *told: Any) -> None:
            if what == "progress":
                progress(*told)
            elif what == "compiling":
                self._tell_compilation(node, *told)

        return hear

    def _progress(self, node: StageNode) -> Callable[..., None]:
        def progress(done: float, total: float, note: str = "") -> None:
            heed()
            self._listener.progress(node.name, done, total, note)

        return progress


def _has_drives(node: StageNode) -> bool:
    """Tell whether a stage may move something: none of its work leaves this process, whatever the executor is."""
    return any(issubclass(kind, Drives) for kind in node.stage.lends().values())


def make_context(
    name: str,
    seed: int,
    data_root: Path,
    tasks: MapTasks,
    progress: Progress,
    scratch: Path | None = None,
    run_name: str = "",
    warnings: tuple[str, ...] = (),
) -> Context:
    """Return what a run lends to the stage of this name."""
    return Context(
        generator=child_generator(seed, name),
        map=tasks,
        progress=progress,
        log=logging.getLogger(f"{NAME}.{name}"),
        data_root=data_root,
        scratch=scratch,
        run_name=run_name,
        warnings=warnings,
    )
