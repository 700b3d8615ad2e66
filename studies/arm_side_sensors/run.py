"""The study as one command, from the repository's root: `python -m studies.arm_side_sensors.run`.

Writes both tables beside this file.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from robid_core import Robot
from studies.arm_side_sensors.sensors import (
    ADDED,
    MOTOR,
    SETS,
    Study,
    amplitude_for,
    deviations,
    errors,
    experiment,
)

HERE = Path(__file__).parent
ROBOT, SEED, N_FIT = "six_axis", 20261125, 10


def main() -> None:
    """Compute and write."""
    robot = Robot.load(ROBOT)
    whole = Study(robot, experiment(robot, SEED), (MOTOR, *ADDED.values()))
    names = [whole.free.names[i] for i in whole.springs]
    alone = errors(whole.chosen(()))
    worth, checks = [], []
    for label, added in SETS.items():
        study = whole.chosen(added)
        ratio = errors(study) / alone
        amplitude = amplitude_for(study, alone)
        for name, error, share, factor in zip(names, errors(study), ratio, amplitude, strict=True):
            worth.append([label, name, f"{error:.3g}", f"{share:.3g}", f"{factor:.3g}"])
        found = np.array([deviations(study, seed) for seed in range(N_FIT)])
        checks.append([label, N_FIT, f"{np.sqrt((found**2).mean()):.3g}", f"{np.abs(found).max():.3g}"])
    write(
        "worth.csv",
        ["sensors", "spring", "relative_error", "error_to_motor_side", "amplitude_for_same_error"],
        worth,
    )
    write("check.csv", ["sensors", "fits", "rms_in_stated_errors", "largest_in_stated_errors"], checks)


def write(name: str, head: list[str], rows: list[list[object]]) -> None:
    """Write one table."""
    with (HERE / name).open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([head, *rows])


if __name__ == "__main__":
    main()
