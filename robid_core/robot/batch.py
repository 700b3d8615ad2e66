"""Simulated experiments by the hundred: dealt to the cores of this machine, or to wherever a run's `map` computes.

The bytes are the same in this process, in worker processes, on a cluster, and after a worker was killed (see
`experiments`). Results are handed on as they come: what is in memory is what the caller keeps, and a few portions.
"""

from __future__ import annotations

import contextlib
import inspect
import os
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray
from robid_core.errors import NotTrustworthy
from robid_core.executors.stream import stream, stream_threads
from robid_core.executors.task import perform, unit
from robid_core.registry import EFFECTS, TASKS
from robid_core.robot.experiments import GROUP, ExperimentBatch, portions, simulate_experiments, task
from robid_core.robot.plant import check_once

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

__all__ = [
    "BatchDiverged",
    "BatchPortion",
    "ExperimentBatch",
    "SimulatedBatch",
    "simulate_over",
    "simulate_portions",
]

Tasks = Callable[..., list[Any]]
Tell = Callable[[float, float, str], None]

UNIT = "simulate.experiments"  # name of `simulate_experiments` in the group robid.tasks
HERE = "simulating experiments"
ELSEWHERE = "simulating experiments on the workers (a new one compiles for a minute first)"


@dataclass(frozen=True)
class BatchPortion:
    """Results of the experiments `first` to `last` - 1 of a batch."""

    batch: int
    first: int
    last: int
    position: FloatArray
    """Measured motor angle, rad, (last - first, kept samples, n_axis)."""
    torque: FloatArray
    """Measured motor torque, N m, same shape."""
    saturated: FloatArray
    """Share of all samples at the torque limit, (last - first, n_axis)."""
    problem: str = ""
    """Of an experiment that "left all bounds at 0.12 s, ..."; its samples are NaN from there on."""
    failed: int | None = None
    """Which experiment of the batch that was, the first one if several."""
    coordinates: FloatArray | None = None
    """True generalised coordinates where they are asked for, (last - first, kept samples, n_coordinate)."""


@dataclass(frozen=True)
class SimulatedBatch:
    """What the drives would have sampled in the experiments of one batch."""

    position: FloatArray
    """Measured motor angle, rad, (n_lane, kept samples, n_axis)."""
    torque: FloatArray
    """Measured motor torque, N m, same shape."""
    saturated: FloatArray
    """Share of all samples at the torque limit, (n_lane, n_axis)."""


class BatchDiverged(NotTrustworthy):
    """An experiment of a batch left all bounds; `partial` holds the portions up to there, NaN behind."""

    def __init__(self, message: str, partial: SimulatedBatch | None = None) -> None:
        super().__init__(message)
        self.partial = partial


def simulate_portions(
    tasks: Tasks,
    batches: Sequence[ExperimentBatch],
    progress: Tell | None = None,
    n_thread: int | None = None,
) -> Iterator[BatchPortion]:
    """Yield the results of batches in order, portion by portion, as they come.

    Parameters
    ----------
    tasks
        A run's `context.map`.
    batches
        Experiments, of any number of robots.
    progress
        A run's `context.progress`: hears how many experiments are done.
    n_thread
        Threads of this process that compute; 0: the map computes. By default threads where the map is of this
        machine, as many as it may have (compiled loops need no processes of their own), else the map. Results
        do not depend on it.

    Raises
    ------
    ConfigurationError
        Where arrays do not fit one another or the robot, or its controller is unstable.
    PluginError
        Where a worker lacks the code, or has another version of it.

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> from robid_core.testing import example_context
    >>> robot = robid.Robot.load("one_axis")
    >>> reference = np.sin(2 * np.pi * np.arange(100) / 100)[None, :, None] * np.ones((3, 1, 1))
    >>> batch = robid.ExperimentBatch(robot, reference, np.zeros((3, 1)))
    >>> portions = robid.simulate_portions(example_context().map, [batch, batch])
    >>> sorted({portion.batch for portion in portions})
    [0, 1]
    """
    for index, batch in enumerate(batches):
        batch.check(f"batch {index + 1}: " if len(batches) > 1 else "")
        check_once(batch.robot, batch.robot.joint_angle(batch.motor_angle[0]), batch.method)
    total, done = sum(batch.n_lane for batch in batches), 0
    tell = progress if progress is not None else _say_nothing
    count = _threads(tasks) if n_thread is None else n_thread
    note = HERE if count else ELSEWHERE
    tell(0, total, note)
    results: Generator[Any]
    if count:
        for batch in batches:
            _prepare(batch)
        work = (task(batches[index], first, last) for index, first, last in portions(batches))
        results = stream_threads(count, simulate_experiments, work)
    else:
        results = stream(tasks, perform, _travelling(batches))
    with contextlib.closing(results):
        for (index, first, last), result in zip(portions(batches), results, strict=True):
            position, torque, saturated, coordinates, problem, lane = result
            done += last - first
            tell(done, total, HERE)
            failed = first + lane if problem else None
            yield BatchPortion(index, first, last, position, torque, saturated, problem, failed, coordinates)


def simulate_over(
    tasks: Tasks,
    robot: Robot,
    speed_reference: FloatArray,
    angle: npt.ArrayLike,
    seed: npt.ArrayLike | None = None,
    *,
    n_period: int = 1,
    n_kept: int | None = None,
    method: str = "implicit_midpoint",
    progress: Tell | None = None,
    n_thread: int | None = None,
) -> SimulatedBatch:
    """Simulate many experiments of one robot in closed loop, over the cores of this machine or a run's map.

    Each comes out as ``robot.simulate(reference[None], angle[None], seed)`` gives it alone.

    Parameters
    ----------
    tasks
        A run's `context.map`.
    robot
        The robot.
    speed_reference
        One period of motor speed, rad/s, (n_lane, n_sample, n_axis).
    angle
        Joint-side motor angles at the start, rad, (n_lane, n_axis).
    seed
        Draws the sensors' noise of each experiment, whole numbers, (n_lane,); None: no noise.
    n_period, n_kept, method
        As in `ExperimentBatch`.
    progress, n_thread
        As in `simulate_portions`.

    Raises
    ------
    BatchDiverged
        Where an experiment leaves all bounds; it holds what was computed before.

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> from robid_core.testing import example_context
    >>> robot = robid.Robot.load("one_axis")
    >>> reference = np.sin(2 * np.pi * np.arange(100) / 100)[None, :, None] * np.ones((3, 1, 1))
    >>> batch = robid.simulate_over(example_context().map, robot, reference, np.zeros((3, 1)), seed=[1, 2, 3])
    >>> batch.torque.shape
    (3, 100, 1)
    """
    seeds = None if seed is None else np.atleast_1d(np.asarray(seed, dtype=np.int64))
    start = robot.motor_angle(np.atleast_2d(np.asarray(angle, dtype=float)))
    batch = ExperimentBatch(robot, speed_reference, start, None, seeds, n_period, n_kept, method)
    batch.check()
    result = SimulatedBatch(
        np.empty(batch.shape), np.empty(batch.shape), np.empty((batch.n_lane, batch.shape[2]))
    )
    for portion in simulate_portions(tasks, [batch], progress, n_thread):
        lanes = slice(portion.first, portion.last)
        result.position[lanes], result.torque[lanes] = portion.position, portion.torque
        result.saturated[lanes] = portion.saturated
        if portion.failed is not None:
            for values in (result.position, result.torque, result.saturated):
                values[portion.last :] = np.nan
            raise BatchDiverged(f"experiment {portion.failed + 1} {portion.problem}", result)
    return result


def _travelling(batches: Sequence[ExperimentBatch]) -> Iterator[tuple[Any, ...]]:
    """Yield the arguments of `perform` of every portion."""
    codes = [
        unit(TASKS, UNIT, ((EFFECTS, entry.use) for entry in batch.robot.description.effects.values()))
        for batch in batches
    ]
    for index, first, last in portions(batches):
        yield codes[index], task(batches[index], first, last)


def _prepare(batch: ExperimentBatch) -> None:
    """Compile what the robot's laws need before threads ask for it, by two samples."""
    text, reference, angle, *_ = task(batch, 0, min(batch.n_lane, GROUP))
    simulate_experiments(text, np.zeros_like(reference[:, :2]), angle, None, 1, 1, batch.method, False)


def _threads(tasks: Tasks) -> int:
    """Return how many threads of this process a map allows; 0 where it computes elsewhere."""
    if inspect.isfunction(tasks):
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return int(getattr(tasks, "threads", 0))


def _say_nothing(done: float, total: float, note: str = "") -> None:
    """Take progress and keep quiet."""
