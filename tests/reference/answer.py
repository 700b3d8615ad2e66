"""The best linear approximation of one plant and pose: from the cache as far as it is there, the rest computed.

Batches of blocks are simulated on several threads and summed in their order, until the standard error is what was asked
for; the bytes depend neither on the threads nor on how often the work was stopped.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from reference import cache
from reference.best_linear_approximation import Batch, moments_of, simulated_batch, transient_left
from reference.excitation_class import ExcitationClass
from reference.plants import BASES, SEED, ReferencePlant, reference_plant, without_sensor_errors
from reference.reference_pose import ReferencePose

SHIPPED_LABEL = "shipped"
PRECISION = 0.1
MOST = 400  # blocks: as many as a precision of 0.1 takes where distortion is everything, 4 / 0.1^2
BATCH = 8  # blocks simulated at once: 48 lanes of six axes
FEWEST = 2 * BATCH
SETTLE_S = 2.0

Tell = Callable[[str], None]


def answer(
    plant: ReferencePlant,
    pose: int,
    excitation: ExcitationClass,
    folder: Path,
    *,
    precision: float = PRECISION,
    most: int = MOST,
    batch: int = BATCH,
    settle_s: float = SETTLE_S,
    jobs: int = 2,
    tell: Tell = lambda text: None,
) -> ReferencePose:
    """Best linear approximation of one plant in pose 1, 2, ..., from the cache as far as it is there.

    Parameters
    ----------
    precision
        Standard error wanted, as a share of that of one measurement of 24 experiments.
    most
        Blocks at most; the pose's own `precision` says what was reached.
    batch
        Blocks simulated at once. Part of the question, as it decides the order of sums.
    jobs
        Threads; the bytes do not depend on them.
    tell
        Is told how far it is.
    """
    robot, angle = without_sensor_errors(plant.robot), plant.pose[pose - 1]
    base = BASES[plant.robot.name.rpartition("_")[0]]
    seed = np.random.SeedSequence(SEED, spawn_key=(base, plant.index, 100 + pose))
    question = cache.question_hash(
        plant.robot, angle, excitation, (seed.entropy, seed.spawn_key, batch, settle_s)
    )
    path = cache.path_of(folder, plant.robot, pose, question, cache.code_hash(plant.robot))

    def batches(first: int, last: int) -> Generator[Batch, None, None]:
        def one(number: int) -> Batch:
            blocks = range(number * batch, (number + 1) * batch)
            return simulated_batch(robot, angle, excitation, seed, blocks, settle_s=settle_s)

        return in_order(one, range(first, last), jobs)

    if not path.exists():
        _take_over(path, question, batches, tell)
    known = first = None
    if path.exists():
        known = cache.read(path, plant.robot)
        if done(known, precision, most):
            return known
        first = cache.first_sums(path)
    source = batches(0 if known is None else known.moments.n_batch, -(-most // batch))
    for result in source:
        moments = moments_of(result.u, result.y, result.r)
        if known is None or first is None:
            first = moments.y, moments.u
            left = transient_left(robot, angle, excitation, seed, result, moments, settle_s=settle_s)
            known = ReferencePose(
                plant.robot,
                angle,
                excitation,
                moments,
                result.speed_rms,
                result.sine_speed,
                result.saturated,
                left,
            )
        else:
            known = known.with_more(moments, result.saturated)
        tell(f"{plant.robot.name} pose {pose}: {known.moments.n_realization} blocks, {known.precision:.3f}")
        if done(known, precision, most):
            break
    source.close()
    if known is None or first is None:
        raise ValueError(f"most = {most}: not one block is allowed")
    cache.write(path, known, first)
    return known


def done(known: ReferencePose, precision: float, most: int) -> bool:
    """Tell whether a pose is known well enough, or was worked on long enough."""
    n = known.moments.n_realization
    return n >= most or (n >= FEWEST and known.precision <= precision)


def in_order(task: Callable[[int], Any], numbers: range, jobs: int) -> Generator[Any, None, None]:
    """Results of the task in the order of the numbers, `jobs` of them at work ahead of who takes them."""
    with ThreadPoolExecutor(jobs) as pool:
        ahead: list[Future[Any]] = [pool.submit(task, number) for number in numbers[:jobs]]
        try:
            for number in numbers[jobs:]:
                yield ahead.pop(0).result()
                ahead.append(pool.submit(task, number))
            while ahead:
                yield ahead.pop(0).result()
        finally:
            for future in ahead:
                future.cancel()


def _take_over(
    path: Path, question: str, batches: Callable[[int, int], Generator[Batch, None, None]], tell: Tell
) -> None:
    """Rename a file of older code whose first batch comes out the same with the present one."""
    older = sorted(path.parent.glob(f"{path.name.partition('-')[0]}-{question}-*.npz"))
    if not older:
        return
    batch = next(batches(0, 1))
    now = moments_of(batch.u, batch.y, batch.r)
    for file in older:
        then = cache.first_sums(file)
        if all(
            np.allclose(a, b, rtol=0, atol=1e-9 * np.abs(b).max())
            for a, b in zip((now.y, now.u), then, strict=True)
        ):
            tell(f"{file.name}: the code changed, the first batch did not; taken over")
            file.replace(path)
            return
        tell(f"{file.name}: no longer what the code computes; built again")


def load(
    index: int, pose: int, folder: Path, *, base: str = "six_axis", label: str = SHIPPED_LABEL
) -> ReferencePose:
    """Read what the bench holds of a plant in a pose (1, 2, ...)."""
    robot = reference_plant(index, base).robot
    return cache.read(cache.the_file(folder / label, robot, pose), robot)
