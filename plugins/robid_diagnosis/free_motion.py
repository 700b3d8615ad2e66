"""How far models move from the recorded motion in closed loop: what a user of the simulation sees.

Each moves by itself under the recorded reference, with the controllers of its file, as the robot was told, with its
values refitted, and extended by what was found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from robid_core import FloatArray, PredictionErrors, Record, Robot, simulate_record
from robid_core.residual import parts_by_variant
from robid_diagnosis.comparison import TOLD, Comparison, errors_of_models, still_axes
from robid_diagnosis.hypothesis import Case
from robid_diagnosis.results import model_of
from robid_diagnosis.steps import Outcome

SHARE = 0.1  # of an experiment at each end that is not compared, at most


def closed_loop_errors(
    case: Case,
    records: Sequence[Record],
    tests: bool,
    outcome: Outcome,
    generator: np.random.Generator,
    progress: Callable[[int, int, str], None],
) -> tuple[tuple[PredictionErrors, ...], FloatArray]:
    """Speed errors of the robot as told, refitted and extended, and what the last gains on the first, interval (2,).

    Parameters
    ----------
    case
        What was diagnosed.
    records
        Experiments, whole, with references.
    tests
        Whether they were kept from the diagnosis.
    outcome
        Of the selection.
    generator
        Draws blocks for the intervals.
    progress
        Told (done, all, what).

    Raises
    ------
    ConfigurationError
        If record and drives are not sampled alike.
    SimulationDiverged
        Where a model leaves all bounds.
    """
    parts = [part for record in records for part in parts_by_variant(record)]
    shortest = min(run.n_period * len(run.time_s) * run.sample_time_s for _, one in parts for run in one.runs)
    comparison = Comparison("diagnosis.effects", case.highest_hz, min(Comparison.skip_s, SHARE * shortest))

    def robots_of(variant: str) -> Mapping[str, Robot]:
        told = case.variants.robot_of(variant)
        return {TOLD: told} | {
            name: Robot.of_model(model_of(told, fit)) for name, fit in outcome.models.items()
        }

    robots = {variant: robots_of(variant) for variant in dict.fromkeys(variant for variant, _ in parts)}
    speeds: dict[str, list[FloatArray]] = {name: [] for name in (TOLD, *outcome.models)}
    for number, (name, speed) in enumerate(speeds.items()):
        progress(number, len(speeds), f"closed loop, {name}")
        for variant, part in parts:
            speed += comparison.speed(simulate_record(robots[variant][name], part, "motion"))
    progress(len(speeds), len(speeds), "")
    whole = [part for _, part in parts]
    where = "experiments of the role test" if tests else "the data of the fit"
    measured = [values for one in whole for values in comparison.speed(one)]
    rows, gain = errors_of_models(
        f"speed in closed loop in {where}",
        f"{whole[0].runs[0].channel('motor_position').unit_symbol}/s",
        *comparison.sums(whole, measured, speeds),
        whole[0],
        still_axes(case.told, whole),
        generator,
    )
    return tuple(rows), gain
