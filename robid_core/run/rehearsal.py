"""What a run will ask of the robot, made without running: the stages up to the excitations, in memory.

They get what a run lends them, their own chance included, so that the artifacts are those of the run. Nothing is
written, and nothing that could move is lent.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robid_core.artifacts import Artifact
from robid_core.executors import one_thread
from robid_core.pipeline import Pipeline, StageNode
from robid_core.pipeline.wiring import each
from robid_core.robot import Robot
from robid_core.run.arguments import arguments_of
from robid_core.run.calling import make_context
from robid_core.run.compilation import compile_ahead
from robid_core.run.guard import checked_result, named_errors
from robid_core.run.log import NAME
from robid_core.run.progress import Listener, Silence
from robid_core.stage import CandidateDesign, Context, ExcitationDesign, map_in_process

LOG = Path("robid plan --debug")  # where the trace of a failure is: there is no log file


@dataclass(frozen=True)
class Rehearsed:
    """Result of a stage, and what it would have written into the log as a warning."""

    artifact: Artifact
    warnings: tuple[str, ...]


def rehearsable(pipeline: Pipeline) -> list[StageNode]:
    """Stages that `rehearse` makes: excitations and what feeds them, where nothing has to be measured for it."""
    able: dict[str, StageNode] = {}
    for node in pipeline.stages:
        harmless = set(node.stage.lends().values()) <= {Robot, Context}
        kind = isinstance(node.stage, CandidateDesign | ExcitationDesign)
        if kind and harmless and all(source in able for source in node.feeds):
            able[node.name] = node
    needed: set[str] = set()
    for node in reversed(able.values()):
        if isinstance(node.stage, ExcitationDesign) or node.name in needed:
            needed |= {node.name, *node.feeds}
    return [node for node in able.values() if node.name in needed]


def rehearse(pipeline: Pipeline, listener: Listener | None = None) -> dict[str, Rehearsed]:
    """Make the excitations of a pipeline and what feeds them.

    Raises
    ------
    RobidError
        As a run would, the stage named; MotionRefused where an excitation breaks a limit of the nominal robot.
    """
    listener, nodes = listener or Silence(), rehearsable(pipeline)
    made: dict[str, Rehearsed] = {}
    if not nodes:
        return made
    robot = pipeline.robot.load()
    with one_thread():
        for index, node in enumerate(nodes, start=1):
            listener.begin(node.name, index, len(nodes), ("for its advice",))
            began = time.perf_counter()
            progress = _progress(listener, node.name)
            if index == 1:
                compile_ahead(progress, say=listener.note)
            made[node.name] = _make(node, pipeline, robot, made, progress)
            listener.end(node.name, "made", time.perf_counter() - began)
    return made


def _make(
    node: StageNode,
    pipeline: Pipeline,
    robot: Robot,
    made: dict[str, Rehearsed],
    progress: Callable[..., None],
) -> Rehearsed:
    artifacts = {p: [made[name].artifact for name in each(source)] for p, source in node.inputs.items()}
    log = logging.getLogger(f"{NAME}.{node.name}")
    arguments: dict[str, Any] = {**arguments_of(node.stage, artifacts, log)}
    for parameter, kind in node.stage.lends().items():
        arguments[parameter] = (
            robot
            if kind is Robot
            else make_context(node.name, pipeline.seed, pipeline.data_root, map_in_process, progress)
        )
    heard = _Heard()
    log.addHandler(heard)
    try:
        with named_errors(node, log, LOG):
            return Rehearsed(
                checked_result(node.name, node.plugin, node.stage, node.stage.run(**arguments)),
                tuple(heard.warnings),
            )
    finally:
        log.removeHandler(heard)


class _Heard(logging.Handler):
    """Keeps warnings."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.warnings: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep it; errors are raised as well."""
        if record.levelno == logging.WARNING:
            self.warnings.append(record.getMessage())


def _progress(listener: Listener, name: str) -> Callable[..., None]:
    def progress(done: float, total: float, note: str = "") -> None:
        listener.progress(name, done, total, note)

    return progress
