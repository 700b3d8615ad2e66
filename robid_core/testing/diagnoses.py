"""What a diagnosis owes: silence where nothing is wrong, and a sign of a cause that was planted.

The null case is a record of the very robot that the stage is told; the planted one is of the same robot whose first
motor has more friction forwards than backwards, which no value of the file expresses and which a short record shows.
Both stand in two poses near each other: what repeats with the angle is then looked for over a short travel.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_core.artifacts import Artifact, Diagnosis, Record
from robid_core.robot import Robot
from robid_core.stage import DiagnosisStage
from robid_core.testing.broken import ContractBroken
from robid_core.testing.fits import Data
from robid_core.testing.inputs import example_of, example_record
from robid_core.testing.known_plant import made_of

CAUSE = "friction.asymmetric"
FORWARDS = 0.3  # of the motor's Coulomb level, on top of it
NEAR = (0.49, 0.51)  # of each axis' range: a search over the travel between poses far apart takes seconds
GROWTH = 1.2  # of an error that a cause must show in, where a stage tells errors and no findings


def with_cause(robot: Robot) -> Robot:
    """Return the robot with the planted cause at its first motor."""
    axis, values = robot.axis_names[0], robot.parameters()
    level = values.get(f"friction.{axis}.coulomb", 0.0) or 0.1 * float(robot.drives.torque_limit[0])
    settings = {"coulomb_forwards": FORWARDS * level, "coulomb_backwards": 0.0}
    if (speed := f"friction.{axis}.speed") in values:
        settings["speed"] = values[speed]
    return robot.with_effect("planted", CAUSE, axis, "motor", settings)


def check_null_and_cause(stage: DiagnosisStage, robot: Robot, data: Data | None) -> None:
    """Check that a diagnosis says nothing of a right model and something of a wrong one.

    Parameters
    ----------
    stage
        The diagnosis with its settings.
    robot
        What it is told.
    data
        What is measured of a plant, by its seed; None: a record as the examples have.

    Raises
    ------
    ContractBroken
        Where it alarms without a cause, or neither finds the cause nor shows an error that grows by it.
    """
    name = type(stage).__name__
    right, wrong = (
        _diagnosed(
            stage, robot, data(plant, 1) if data else {Record: example_record(plant, seed=1, within=NEAR)}
        )
        for plant in (robot, with_cause(robot))
    )
    if right.findings:
        found = right.findings[0]
        raise ContractBroken(
            f"{name}: with a record of the very robot that it is given it finds {found.effect} at {found.where}: "
            "a false alarm"
        )
    if wrong.findings:
        return
    before, after = errors_of(right), errors_of(wrong)
    cause = f"{CAUSE} at {robot.axis_names[0]}, {FORWARDS:g} of its Coulomb level forwards"
    if not before and not after:
        raise ContractBroken(
            f"{name}: a planted cause ({cause}) is not found, and the diagnosis states no error either; put what "
            f"it finds "
            "into Diagnosis.findings, or how far the model is off into `time` or `errors`"
        )
    if not any(late > GROWTH * early for early, late in zip(before, after, strict=False)):
        raise ContractBroken(
            f"{name}: a planted cause ({cause}) is not found, and no error grows by it: they are "
            f"{', '.join(f'{one:.3g}' for one in after)} beside {', '.join(f'{one:.3g}' for one in before)} without it"
        )


def errors_of(diagnosis: Diagnosis) -> list[float]:
    """Return all relative errors that a diagnosis tells."""
    found = [one.relative_error for one in diagnosis.time]
    found += [float(value) for one in diagnosis.errors for value in one.relative]
    return [value for value in found if np.isfinite(value)]


def _diagnosed(stage: DiagnosisStage, robot: Robot, data: Mapping[type[Artifact], Artifact]) -> Diagnosis:
    needed = {
        entry.name: [data[entry.artifact] if entry.artifact in data else example_of(entry.artifact, robot)]
        for entry in stage.inputs()
        if entry.artifact in data or not entry.optional
    }
    return made_of(stage, robot, needed, Diagnosis)
