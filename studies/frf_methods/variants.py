"""The same robots otherwise: without friction and ripple, on a grid of all odd bins, with n + 1 experiments a block.

Few poses, the methods that the question is about. Errors are against the best linear approximation of the variant, at
the lines that all variants have; ratios against LOG with 24 experiments as they are shipped, and in the robots
without friction and ripple against their own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robid_core import BoolArray, ComplexArray, FloatArray, IntArray
from studies.frf_methods import accuracy
from studies.frf_methods.estimates import Estimated, Job, Variant
from studies.frf_methods.methods import METHODS, Method
from studies.frf_methods.scenes import Scene, jobs_of, scenes

from reference.answer import answer  # isort: skip
from reference.excitation_class import shipped_class  # isort: skip
from reference.plants import ReferencePlant, reference_plant, without_effects  # isort: skip

POSES = tuple((plant, 1) for plant in range(1, 7))
AVERAGING = ("h1", "ari", "log", "harmonic", "jio", "indirect", "spectral_jio")
LOCAL = ("lrm_mimo", "lrm_mimo_jio", "lrm_mimo_chosen")
SEED = 300_002  # beside the seeds of the other parts


@dataclass(frozen=True)
class Setting:
    """How a variant differs: its robot, settings of its excitation, experiments of a block beyond the axes."""

    title: str
    methods: tuple[str, ...]
    counts: tuple[int, ...]
    smooth: bool = False
    excitation: dict[str, Any] = field(default_factory=dict)
    more: int = 0


SETTINGS = {
    "shipped": Setting("as shipped", (*AVERAGING, *LOCAL, "friction_lrm"), (1, 6, 24)),
    "smooth": Setting("without friction and ripple", (*AVERAGING, *LOCAL), (6, 24), smooth=True),
    "dense": Setting(
        "all odd bins excited",
        ("log", *LOCAL, "friction_lrm", "lrm_prior_poles"),
        (1, 6, 24),
        excitation={"grid": "full", "lines": None},
    ),
    "more": Setting(
        "n + 1 experiments", ("h1", "log", "jio", "lrm_mimo_chosen", "friction_lrm"), (7, 28), more=1
    ),
}


def without_friction(plant: ReferencePlant) -> ReferencePlant:
    """The plant without ripple and without Coulomb friction; viscous friction stays."""
    return dataclasses.replace(plant, robot=without_effects(plant.robot).without_friction())


def scenes_of(key: str, folder: Path) -> Iterator[Scene]:
    """Scenes of a variant; what the bench does not know of them is computed, half a minute each."""
    setting = SETTINGS[key]
    if not setting.smooth and not setting.excitation:
        yield from scenes(POSES, folder)
        return
    place = folder / key
    place.mkdir(parents=True, exist_ok=True)
    for number, pose in POSES:
        plant = reference_plant(number)
        excitation = shipped_class(plant, **setting.excitation)
        if setting.smooth:
            plant = without_friction(plant)
        truth = answer(plant, pose, excitation, place)
        yield Scene(number, pose, plant.robot, plant.nominal, plant.pose[pose - 1], excitation, truth)


def methods_of(key: str) -> dict[str, Method]:
    """Methods with the numbers of experiments they are tried with."""
    setting = SETTINGS[key]
    kept = {}
    for name in setting.methods:
        most = METHODS[name].counts
        counts = tuple(n for n in setting.counts if setting.more or n in most)
        if counts:
            kept[name] = dataclasses.replace(METHODS[name], counts=counts)
    return kept


def jobs(key: str, places: list[Scene], n_seed: int, folder: Path) -> list[Job]:
    """Measurements of a variant."""
    seeds, methods = range(SEED, SEED + n_seed), methods_of(key)
    more = SETTINGS[key].more
    return [
        job
        for scene in places
        for job in jobs_of(scene, seeds, folder / key, methods, len(scene.angle) + more)
    ]


@dataclass(frozen=True)
class CommonTruth:
    """What is known of a scene at the bins that all variants excite."""

    response: ComplexArray
    seen: BoolArray
    frequency_hz: FloatArray


def errors(
    scene: Scene, seeds: list[dict[Variant, Estimated]], line: IntArray
) -> dict[Variant, accuracy.PoseErrors]:
    """Errors of all methods of a variant in one pose, at some of its bins."""
    at, truth = np.searchsorted(scene.excitation.line, line), scene.truth
    common = CommonTruth(truth.response[at], truth.seen[at], truth.frequency_hz[at])

    def there(one: Estimated) -> Estimated:
        return Estimated(one.response[at], one.variance[at], one.freedom[at], one.covers)

    return {
        variant: accuracy.pose_errors(common, [there(one[variant]) for one in seeds])
        for variant in seeds[0]
        if all(variant in one for one in seeds)
    }


def rows(
    found: Mapping[str, Mapping[Variant, list[accuracy.PoseErrors]]], generator: np.random.Generator
) -> list[accuracy.Row]:
    """One table of all variants."""
    titles = {name: method.title for name, method in METHODS.items()}
    table: list[accuracy.Row] = []
    for key, by_variant in found.items():
        complete = {v: poses for v, poses in by_variant.items() if len(poses) == len(POSES)}
        judge = (found["smooth"] if SETTINGS[key].smooth else found["shipped"])[accuracy.JUDGE]
        table.extend(
            {"variant": SETTINGS[key].title, **row}
            for row in accuracy.table(complete, titles, generator, judge)
        )
    return table
