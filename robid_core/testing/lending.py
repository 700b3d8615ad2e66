"""What a run lends to a stage, in a form for tests: a Context that notices, and drives in memory."""

from __future__ import annotations

import logging
import pickle
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robid_core.drives import Drives
from robid_core.registry import DRIVES, registry
from robid_core.robot import Robot
from robid_core.stage import Context
from robid_core.testing.robots import PACKAGED


def map_through_pickle(function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
    """Run tasks one after another, each as it would arrive in another process.

    A function that is not at the top level of a module, or an argument that cannot travel, fails here.
    """
    results = []
    for argument in arguments:
        task, copies = pickle.loads(pickle.dumps((function, argument)))
        results.append(pickle.loads(pickle.dumps(task(*copies))))
    return results


def example_context(seed: int = 0, data_root: Path = Path()) -> Context:
    """Return a context whose chance begins at `seed`, whose map copies tasks, and which shows nothing."""

    def progress(done: float, total: float, note: str = "") -> None:
        if not 0 <= done <= total:
            raise AssertionError(f"progress {done} of {total} ({note}) is not a share")

    log = logging.getLogger("robid.testing")
    return Context(np.random.default_rng(seed), map_through_pickle, progress, log, data_root)


def example_drives(robot: Robot, folder: Path) -> Drives:
    """Return simulated drives (the plugin `simulated`) with the robot itself as plant; `folder` keeps its file."""
    plant = robot.name
    if robot.name not in PACKAGED.values():
        path = folder / f"{robot.name}.yaml"
        path.write_text(robot.to_yaml(), encoding="utf-8")
        plant = str(path)
    drives = registry().load(DRIVES, "simulated")(plant=plant)
    if not isinstance(drives, Drives):
        raise AssertionError("the plugin 'simulated' is no Drives")
    return drives
