"""Every method on every measurement, kept: a file for each plant, pose and seed, outside the repository.

A file is named by what was measured and by a hash of the code that measures and estimates, so that nothing stale is
summed up; work that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robid_core import ComplexArray, FloatArray, Record, RobidError, Robot
from studies.frf_methods.measurement import (
    BLOCKS,
    ExcitationClass,
    chance,
    first_experiments,
    measure,
    quiet,
    references,
)
from studies.frf_methods.methods import Method

ROOT = Path(__file__).parents[2]
CODE = (
    "robid_core/estimation/**/*.py",
    "robid_core/mechanics/*.py",
    "robid_core/artifacts/*.py",
    "plugins/robid_frf/*.py",
    "plugins/robid_compensation/*.py",
    "tests/reference/plants.py",
    "tests/reference/excitation_class.py",
    "studies/frf_methods/measurement.py",
    "studies/frf_methods/methods.py",
)


@dataclass(frozen=True, eq=False)
class Estimated:
    """What one method said of one measurement: response, variance of each entry, its complex degrees of freedom.

    Shapes (n_freq, n_out, n_in), the same, and (n_freq,). Variance is NaN where none is stated. `covers` is what the
    regions are about, in the words of `Frf`.
    """

    response: ComplexArray
    variance: FloatArray
    freedom: FloatArray
    covers: str = ""


Variant = tuple[str, int]
"""A method's key and the number of experiments it was given."""


def code_hash() -> str:
    """Hash of the code that measures and estimates."""
    digest = hashlib.sha256()
    for pattern in CODE:
        for path in sorted(ROOT.glob(pattern)):
            digest.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def estimate(record: Record, nominal: Robot, methods: Mapping[str, Method]) -> dict[Variant, Estimated]:
    """Every method, with the first so many experiments of a record of one configuration as it is tried with.

    A method that refuses (too few lines for its unknowns, say) is left out.
    """
    context, found = quiet(), {}
    for count in sorted({count for method in methods.values() for count in method.counts}):
        part = first_experiments(record, count)
        known: dict[tuple[str, ...], Record] = {}
        for key, method in methods.items():
            if count not in method.counts:
                continue
            try:
                prepared = method.prepare(part, nominal, context, known)
                frf = method.estimate(prepared, nominal, context)
            except RobidError:
                continue
            shape = frf.response.shape[1:]
            variance = frf.variance()[0] if frf.has_covariance else np.full(shape, np.nan)
            freedom = (
                np.full(shape[0], np.inf) if frf.degrees_of_freedom is None else frf.degrees_of_freedom[0]
            )
            found[key, count] = Estimated(frf.response[0], variance, freedom, frf.covers)
    return found


def write(
    path: Path, found: Mapping[Variant, Estimated], lines: npt.NDArray[np.int64] | slice = slice(None)
) -> None:
    """Keep estimates in single precision (their errors are percents), at some lines; whole or not at all."""
    arrays = {}
    for (key, count), one in found.items():
        arrays[f"{key}|{count}|response"] = one.response[lines].astype(np.complex64)
        arrays[f"{key}|{count}|variance"] = one.variance[lines].astype(np.float32)
        arrays[f"{key}|{count}|freedom"] = one.freedom[lines].astype(np.float32)
        arrays[f"{key}|{count}|covers"] = np.array(one.covers)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(f".{os.getpid()}.partial")
    with partial.open("wb") as file:
        np.savez(file, **arrays)
    partial.replace(path)


def read(path: Path) -> dict[Variant, Estimated]:
    """Estimates as `write` kept them."""
    with np.load(path) as stored:
        variants = dict.fromkeys(tuple(name.split("|")[:2]) for name in stored.files)
        return {
            (key, int(count)): Estimated(
                stored[f"{key}|{count}|response"].astype(np.complex128),
                stored[f"{key}|{count}|variance"].astype(np.float64),
                stored[f"{key}|{count}|freedom"].astype(np.float64),
                str(stored[f"{key}|{count}|covers"]),
            )
            for key, count in variants
        }


@dataclass(frozen=True, eq=False)
class Job:
    """One measurement to be estimated from."""

    path: Path
    robot: Robot
    nominal: Robot
    angle: FloatArray
    excitation: ExcitationClass
    key: tuple[int, int, int]
    methods: Mapping[str, Method]
    lines: npt.NDArray[np.int64] | None = None
    n_exp: int | None = None


def work(job: Job) -> Path:
    """Measure and estimate, unless it is there."""
    if not job.path.exists():
        generator = chance(*job.key)
        reference = references(job.excitation, BLOCKS, generator, job.n_exp)
        record = measure(job.robot, job.angle, job.excitation, reference, int(generator.integers(2**62)))
        found = estimate(record, job.nominal, job.methods)
        write(job.path, found, slice(None) if job.lines is None else job.lines)
    return job.path


def work_all(jobs: list[Job], processes: int, tell: Callable[[int, int], None]) -> list[Path]:
    """All jobs on several processes; `tell` hears how many of how many are done."""
    missing = [job for job in jobs if not job.path.exists()]
    if missing and processes <= 1:
        for done, job in enumerate(missing):
            work(job)
            tell(done + 1, len(missing))
    elif missing:
        with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
            for done, _ in enumerate(pool.map(work, missing)):
                tell(done + 1, len(missing))
    return [job.path for job in jobs]
