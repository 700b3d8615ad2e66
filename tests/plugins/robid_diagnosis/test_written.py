"""The robot that a diagnosis writes, beside the verdict about it: what is told must be true of the file."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Context, Record, Robot
from robid_core.residual import linearise_at
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects
from robid_diagnosis.hypothesis import Case, Hypothesis

STRIBECK = {"coulomb": 0.0, "breakaway": 0.2, "stribeck_speed": 3.0, "exponent": 2.0, "viscous": 0.0}
MODEL_ERROR = 5e-4


def left(robot: Robot, record: Record) -> float:
    """Share of the torque that a robot as it is leaves, as the verdict counts it: friction with its own width."""
    case = Case((record,), robot, {}, 100.0, 0, 12, MODEL_ERROR, widths=(1.0,))
    problem = case.problem(Hypothesis(), (record,))
    point = np.zeros(problem.n_unknown)
    friction = problem.friction_size(point)
    friction[0], friction[-1] = robot.drives.coulomb, robot.drives.friction_offset
    linearise_at(problem, point, MODEL_ERROR)
    (error,), (block,) = problem.residuals(point), problem.blocks
    power = [(np.abs(one[:, :, 1:]) ** 2).sum() for one in (error, block.motion.torque_spectrum)]
    return float(np.sqrt(power[0] / power[1]))


def test_the_error_that_is_told_is_that_of_the_robot_that_is_written(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record]
) -> None:
    """Stribeck friction where the sign turns, with the width that friction has there and the file does not know.

    Functions of several widths and the law follow each other, and what a file had of them left 4 % more. Both errors
    are of the data of the fit, and differ by its last pass alone.
    """
    plant = plant_of(told, 3)
    width = plant.parameter("friction.axis_1.speed")
    assert abs(np.log(width / told.parameter("friction.axis_1.speed"))) > 0.1
    values = STRIBECK | {"speed": width}
    record = measured(plant.with_effect("hidden", "friction.stribeck", "axis_1", values=values), 4)
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    stage = Effects.model_validate({"separate": False, "response_check": (), "only": ("friction.stribeck",)})
    diagnosis = stage.run((record,), told, context)
    (finding,) = diagnosis.findings
    assert diagnosis.model is not None
    written = Robot.of_model(diagnosis.model)
    assert left(written, record) == pytest.approx(diagnosis.errors[-1].relative[0], rel=0.01)
    assert written.parameter("friction.axis_1.speed") == pytest.approx(width, rel=0.02)
    for name, value, error in zip(finding.names, finding.value, finding.standard_error, strict=True):
        if name != "viscous":  # the motor has some, too
            assert abs(value - values[name]) < 4 * error < 0.1 * values[name]
