"""Calls a stage with what its `run` asks for: artifacts read back from the store, and what the run lends."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

from robid_core.artifacts import Artifact, Truth
from robid_core.drives import Drives
from robid_core.pipeline import StageNode
from robid_core.robot import Robot
from robid_core.run.guard import checked_result
from robid_core.run.identity import Surroundings, child_generator
from robid_core.run.log import NAME
from robid_core.run.progress import Listener
from robid_core.stage import Context, MapTasks
from robid_core.store import Entry, Store


class Caller:
    """Knows what a run lends to its stages."""

    def __init__(self, shared: Surroundings, store: Store, tasks: MapTasks, listener: Listener) -> None:
        self._shared, self._store, self._tasks, self._listener = shared, store, tasks, listener

    def call(self, node: StageNode, entries: Mapping[str, Entry]) -> Artifact:
        """Run a stage on stored artifacts (by the stage that made them) and return its checked result.

        Inputs come from the store, verified, never as another stage left them in memory: a run that was
        killed and resumed computes with the same bytes as one that was not.
        """
        arguments = {**self._artifacts(node, entries), **self._lent(node)}
        return checked_result(node, node.stage.run(**arguments))

    def _artifacts(self, node: StageNode, entries: Mapping[str, Entry]) -> dict[str, Artifact]:
        """Read the inputs; an optional one whose stage gave nothing stays away."""
        return {
            parameter: self._store.read(entries[source], self._shared.pipeline.stage(source).stage.output)
            for parameter, source in node.inputs.items()
            if source in entries
        }

    def _lent(self, node: StageNode) -> dict[str, Any]:
        lent: dict[str, Any] = {}
        drives = self._shared.drives
        for parameter, kind in node.stage.lends().items():
            if kind is Robot:
                lent[parameter] = self._shared.robot
            elif kind is Truth:
                lent[parameter] = drives.truth(self._shared.robot) if drives is not None else None
            elif kind is Context:
                lent[parameter] = self._context(node)
            elif issubclass(kind, Drives):
                lent[parameter] = drives
        return lent

    def _context(self, node: StageNode) -> Context:
        def progress(done: float, total: float, note: str = "") -> None:
            self._listener.progress(node.name, done, total, note)

        return Context(
            generator=child_generator(self._shared.pipeline.seed, node.name),
            map=self._tasks,
            progress=progress,
            log=stage_log(node),
            data_root=self._shared.pipeline.data_root,
        )


def stage_log(node: StageNode) -> logging.Logger:
    """Return the logger of a stage."""
    return logging.getLogger(f"{NAME}.{node.name}")
