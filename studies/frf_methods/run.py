"""The study as one command, from the repository's root: `python -m studies.frf_methods.run PART`.

Each part writes its table beside this file; work is kept in the folder of the reference bench and goes on where it was
interrupted.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported: measurements are dealt to processes here

import numpy as np  # noqa: E402

from studies.frf_methods import accuracy, amplitude, coverage, estimates, iterations, stiffness, variants  # noqa: E402
from studies.frf_methods.methods import METHODS, Method  # noqa: E402
from studies.frf_methods.page import study_page  # noqa: E402
from studies.frf_methods.scenes import POSES, jobs_of, scenes  # noqa: E402
from studies.frf_methods.tables import write_table  # noqa: E402

from reference.cache import default_folder  # noqa: E402  isort: skip

COMMAND = "python -m studies.frf_methods.run"


def tell(what: str) -> estimates.Callable[[int, int], None]:
    """Progress on one line of the terminal."""
    return lambda done, total: print(f"\r{what}: {done} of {total}   ", end="", file=sys.stderr, flush=True)


def run_accuracy(arguments: argparse.Namespace) -> None:
    """Table of errors of all methods."""
    _errors("accuracy", METHODS, arguments)


def run_iterations(arguments: argparse.Namespace) -> None:
    """Table of errors of local fits with and without iterations."""
    _errors("iterations", iterations.methods(), arguments)


def _errors(part: str, methods: Mapping[str, Method], arguments: argparse.Namespace) -> None:
    places = list(scenes(POSES[: arguments.poses], arguments.cache))
    seeds = range(1, arguments.seeds + 1)
    folder = arguments.cache / "frf_methods" / estimates.code_hash() / part
    jobs = [job for scene in places for job in jobs_of(scene, seeds, folder, methods)]
    paths = iter(estimates.work_all(jobs, arguments.jobs, tell("measurements")))
    by_variant: dict[estimates.Variant, list[accuracy.PoseErrors]] = {}
    for scene in places:
        found = [estimates.read(next(paths)) for _ in seeds]
        for variant in found[0]:
            kept = accuracy.pose_errors(scene.truth, [one[variant] for one in found])
            by_variant.setdefault(variant, []).append(kept)
    complete = {variant: poses for variant, poses in by_variant.items() if len(poses) == len(places)}
    titles = {key: method.title for key, method in methods.items()}
    rows = accuracy.table(complete, titles, np.random.default_rng(0))
    command = f"{COMMAND} {part} --poses {len(places)} --seeds {arguments.seeds}"
    print(f"\n{write_table(part, rows, command)}")


def run_coverage(arguments: argparse.Namespace) -> None:
    """Table of coverage on one pose: own means over all seeds, regions of the first hundred."""
    scene = next(scenes(POSES[:1], arguments.cache))
    methods = {key: replace(one, counts=(24,)) for key, one in METHODS.items() if 24 in one.counts}
    chosen = coverage.lines(len(scene.truth.frequency_hz))
    folder = arguments.cache / "frf_methods" / "coverage" / estimates.code_hash()
    seeds = range(2001, 2001 + arguments.seeds)
    jobs = [replace(job, lines=chosen) for job in jobs_of(scene, seeds, folder, methods)]
    paths = estimates.work_all(jobs, arguments.jobs, tell("measurements"))
    runs = [estimates.read(path) for path in paths]
    rows = [
        coverage.row(scene, METHODS[key].title, [one[key, 24] for one in runs], min(100, len(runs)))
        for key in methods
        if all((key, 24) in one for one in runs)
    ]
    print(f"\n{write_table('coverage', rows, f'{COMMAND} coverage --seeds {arguments.seeds}')}")


def run_stiffness(arguments: argparse.Namespace) -> None:
    """Table of stiffness errors over plants."""
    numbers = range(1, arguments.plants + 1)
    folder = arguments.cache / "frf_methods" / "stiffness" / estimates.code_hash()
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    with ProcessPoolExecutor(arguments.jobs, multiprocessing.get_context("spawn")) as pool:
        for done, errors in enumerate(pool.map(stiffness.kept, numbers, [folder] * len(numbers))):
            found.append(errors)
            tell("plants")(done + 1, len(numbers))
    bounds = [stiffness.bounds(number, arguments.cache) for number in numbers]
    rows = stiffness.table(found, bounds, np.random.default_rng(0))
    print(f"\n{write_table('stiffness', rows, f'{COMMAND} stiffness --plants {arguments.plants}')}")


def run_amplitude(arguments: argparse.Namespace) -> None:
    """Table of resonances over the amplitude."""
    del arguments
    print(write_table("amplitude", amplitude.rows(), f"{COMMAND} amplitude"))


def run_variants(arguments: argparse.Namespace) -> None:
    """Table of the same robots otherwise."""
    folder = arguments.cache / "frf_methods" / estimates.code_hash() / "variants"
    places = {key: list(variants.scenes_of(key, arguments.cache)) for key in variants.SETTINGS}
    jobs = [job for key, some in places.items() for job in variants.jobs(key, some, arguments.seeds, folder)]
    paths = iter(estimates.work_all(jobs, arguments.jobs, tell("measurements")))
    found: dict[str, dict[estimates.Variant, list[accuracy.PoseErrors]]] = {}
    for key, some in places.items():
        by_variant = found.setdefault(key, {})
        for scene, shipped in zip(some, places["shipped"], strict=True):
            read = [estimates.read(next(paths)) for _ in range(arguments.seeds)]
            for variant, errors in variants.errors(scene, read, shipped.excitation.line).items():
                by_variant.setdefault(variant, []).append(errors)
    rows = variants.rows(found, np.random.default_rng(0))
    print(f"\n{write_table('variants', rows, f'{COMMAND} variants --seeds {arguments.seeds}')}")


def run_page(arguments: argparse.Namespace) -> None:
    """The page, from one measurement and the tables that are there."""
    scene = next(scenes(POSES[:1], arguments.cache))
    arguments.out.mkdir(parents=True, exist_ok=True)
    print(study_page(arguments.out / "page.html", scene))


PARTS = {
    "accuracy": run_accuracy,
    "iterations": run_iterations,
    "coverage": run_coverage,
    "stiffness": run_stiffness,
    "amplitude": run_amplitude,
    "variants": run_variants,
    "page": run_page,
}


def main() -> None:
    """Run one part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--cache", type=Path, default=default_folder(), help="folder of the reference bench")
    parser.add_argument("--poses", type=int, default=len(POSES), help="so many of the poses")
    parser.add_argument("--seeds", type=int, default=2, help="measurements of each pose")
    parser.add_argument("--plants", type=int, default=20, help="plants of the stiffness part")
    parser.add_argument("--out", type=Path, default=Path("runs/frf_methods"), help="folder of the page")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    arguments = parser.parse_args()
    PARTS[arguments.part](arguments)


if __name__ == "__main__":
    main()
