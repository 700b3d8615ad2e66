"""One joint of a Kinova Gen3: a move in one direction predicts its other half, and is said to identify nothing."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from oracles.example_stages import LOG, PROJECT, context, needs, stage_of
from pydantic import ValidationError

from robid_core import Diagnosis, Record, RobidError, Robot

DOUBTED = "cannot be distinguished from what the model lacks"
EXAMPLE = PROJECT / "examples" / "kinova_gen3"

pytestmark = [
    needs(f"kinova_gen3/joint_{joint}_trapez.csv", "github wissem01chiha/dynamic-identification")
    for joint in (2, 4)
]


def stage(name: str, text: str = "") -> Any:
    return stage_of(text or (EXAMPLE / "pipeline.yaml").read_text(), name)


def joint_4(name: str) -> Any:
    return stage(name, (EXAMPLE / "joint_4.yaml").read_text())


def robot() -> Robot:
    return Robot.load("robot.yaml", EXAMPLE)


def test_half_a_move_predicts_the_other_half_and_identifies_nothing() -> None:
    fit = stage("fit").run((stage("acquire").run(robot(), context()),), robot())
    (picture,) = stage("predict").run((stage("later").run(robot(), context()),), robot(), context(), fit).time
    assert picture.relative_error < 0.43
    assert {"residual colour"} < {doubt.kind for doubt in fit.doubts}
    assert fit.base is not None
    known = fit.base.standard_error < 0.1 * np.abs(fit.base.estimate)
    assert known.sum() <= 1


def test_a_torque_of_a_model_is_no_measurement() -> None:
    text = (EXAMPLE / "pipeline.yaml").read_text()
    swapped = text.replace("motor_torque: {column: TorqueCur2, unit: N m}                #", "#").replace(
        "motor_torque_of_the_controller:", "motor_torque:"
    )
    assert swapped != text
    with pytest.raises((RobidError, ValidationError), match="computed"):
        stage("acquire", swapped).run(robot(), context())


def test_both_halves_show_one_wave(caplog: pytest.LogCaptureFixture) -> None:
    record = stage("whole").run(robot(), context())
    model = stage("all").run((record,), robot()).model
    assert model is not None
    with caplog.at_level(logging.INFO, logger=LOG):
        stage("waves").run(record, Robot.of_model(model), context())
    orders = re.findall(r"cogging ripple, order ([\d.]+)", caplog.text)
    assert [float(order) for order in orders] == [166.0]


def explained(told: Robot, asked: Callable[[str], Any]) -> Diagnosis:
    first, later = (asked(name).run(told, context()) for name in ("acquire", "later"))
    model = asked("fit").run((first,), told).model
    assert model is not None
    found: Diagnosis = asked("explain").run((first, later), Robot.of_model(model), context())
    return found


def refuses(found: Diagnosis) -> bool:
    """Whether nothing is claimed: no cause, no wrong value, no delay."""
    lines = found.verdict.split("\n")
    claims = [line for line in lines if line.startswith(("Timing", "Values")) and DOUBTED not in line]
    return not (found.findings or claims)


def test_a_move_in_one_direction_carries_no_cause() -> None:
    found = explained(robot(), stage)
    assert refuses(found)
    assert "cannot be distinguished from what the model lacks" in found.verdict
    assert "experiments of the role test" in found.verdict


def test_joint_4_is_predicted_from_its_first_half_and_carries_no_cause_nor_wave(
    caplog: pytest.LogCaptureFixture,
) -> None:
    told = Robot.load("robot_joint_4.yaml", EXAMPLE)
    fit = joint_4("fit").run((joint_4("acquire").run(told, context()),), told)
    (picture,) = joint_4("predict").run((joint_4("later").run(told, context()),), told, context(), fit).time
    assert picture.relative_error < 0.3
    assert refuses(explained(told, joint_4))
    record: Record = joint_4("whole").run(told, context())
    model = joint_4("all").run((record,), told).model
    assert model is not None
    with caplog.at_level(logging.INFO, logger=LOG):
        joint_4("waves").run(record, Robot.of_model(model), context())
    assert "no significant ripple" in caplog.text
