"""How a run begins: its manifest before any stage, the executor it works with, what `--locked` holds it to."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from robid_core.errors import ConfigurationError
from robid_core.executors import process_executor
from robid_core.pipeline import Pipeline
from robid_core.run.environment import environment
from robid_core.run.folder import RunFolder
from robid_core.run.identity import Surroundings, ingredients_of
from robid_core.run.lent_robot import effect_plugins
from robid_core.run.manifest import Manifest, locked_differences, refuse_unlocked
from robid_core.run.options import RunOptions
from robid_core.stage import MapTasks
from robid_core.store import text_hash


def executor(pipeline: Pipeline, options: RunOptions) -> AbstractContextManager[MapTasks]:
    """Return what maps tasks in this run."""
    make, settings = executor_choice(pipeline, options)
    chosen: AbstractContextManager[MapTasks] = make(**settings)
    return chosen


def executor_choice(pipeline: Pipeline, options: RunOptions) -> tuple[Callable[..., Any], dict[str, Any]]:
    """Return the pipeline's choice of executor, else processes of this machine; `--jobs` wins."""
    if pipeline.executor is None:
        return process_executor, {"jobs": options.jobs}
    settings: dict[str, Any] = pipeline.executor.settings.model_dump()
    if options.jobs and "jobs" in settings:
        settings["jobs"] = options.jobs
    return pipeline.executor.plugin.load(), settings


def new_manifest(shared: Surroundings, options: RunOptions) -> Manifest:
    """Return the manifest of a run in which nothing has happened yet."""
    pipeline = shared.pipeline
    plugins = [node.plugin for node in pipeline.stages]
    plugins += [choice.plugin for choice in (pipeline.drives, pipeline.executor) if choice is not None]
    plugins += effect_plugins(shared.robot)
    return Manifest(
        name=pipeline.name,
        status="running",
        pipeline={
            "file": pipeline.path.name,
            "sha256": text_hash(pipeline.text),
            "overrides": list(pipeline.overrides),
        },
        seed=pipeline.seed,
        robot={"written": pipeline.robot.written, "sha256": shared.robot_hash},
        environment=environment(plugin.distribution for plugin in plugins),
        jobs=options.jobs,
        started=datetime.datetime.now().astimezone().isoformat(timespec="seconds"),
    )


def hold_to(previous: Manifest | None, folder: RunFolder, new: Manifest, shared: Surroundings) -> None:
    """Raise ConfigurationError unless a run would be the one that the manifest describes."""
    if previous is None:
        raise ConfigurationError(
            f"{folder.manifest}: --locked, but there is no manifest; run once without it"
        )
    ingredients = {node.name: ingredients_of(node, {}, shared) for node in shared.pipeline.stages}
    refuse_unlocked(folder, locked_differences(previous, new, ingredients))
