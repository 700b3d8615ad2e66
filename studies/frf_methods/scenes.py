"""Where the methods are tried: plants and poses of the reference bench whose best linear approximation is known.

The excitation is that of the worked example; G_BLA is known to a tenth of the standard error of 24 experiments
(`python tests/reference/build.py --plants 1-3 --poses 1-3`, `--plants 4-9 --poses 1-2`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from robid_core import FloatArray, Robot
from studies.frf_methods.estimates import Job
from studies.frf_methods.measurement import ExcitationClass  # also puts the bench on the path
from studies.frf_methods.methods import Method

from reference.answer import SHIPPED_LABEL, answer  # isort: skip
from reference.cache import default_folder  # isort: skip
from reference.excitation_class import shipped_class  # isort: skip
from reference.plants import reference_plant  # isort: skip
from reference.reference_pose import ReferencePose  # isort: skip

POSES = tuple((plant, pose) for plant in range(1, 10) for pose in ((1, 2, 3) if plant <= 3 else (1, 2)))
"""(plant, pose), counted from one."""


@dataclass(frozen=True, eq=False)
class Scene:
    """One plant in one pose under one excitation, with what is known of it."""

    plant: int
    pose: int
    robot: Robot
    nominal: Robot
    angle: FloatArray
    excitation: ExcitationClass
    truth: ReferencePose


def scenes(poses: tuple[tuple[int, int], ...] = POSES, folder: Path | None = None) -> Iterator[Scene]:
    """Scenes one after another; what is missing in the bench's cache is computed (a minute or two each)."""
    folder = (folder or default_folder()) / SHIPPED_LABEL
    folder.mkdir(parents=True, exist_ok=True)
    for number in dict.fromkeys(plant for plant, _ in poses):
        plant = reference_plant(number)
        excitation = shipped_class(plant)
        for pose in (pose for other, pose in poses if other == number):
            truth = answer(plant, pose, excitation, folder)
            yield Scene(number, pose, plant.robot, plant.nominal, plant.pose[pose - 1], excitation, truth)


def jobs_of(
    scene: Scene, seeds: range, folder: Path, methods: Mapping[str, Method], n_exp: int | None = None
) -> list[Job]:
    """Measurements of one scene, a file for each seed in the folder; `n_exp` experiments a block, as many as axes."""
    return [
        Job(
            folder / f"plant_{scene.plant:02d}_pose_{scene.pose}_seed_{seed:04d}.npz",
            scene.robot,
            scene.nominal,
            scene.angle,
            scene.excitation,
            (scene.plant, scene.pose, seed),
            methods,
            n_exp=n_exp,
        )
        for seed in seeds
    ]
