"""One joint of a Kinova Gen3: a move in one direction predicts its other half, and is said to identify nothing."""

from __future__ import annotations

import logging
import re
from typing import Any

import numpy as np
import pytest
from oracles.example_stages import LOG, PROJECT, context, needs, stage_of
from pydantic import ValidationError

from robid_core import RobidError, Robot

EXAMPLE = PROJECT / "examples" / "kinova_gen3"

pytestmark = needs("kinova_gen3/joint_2_trapez.csv", "github wissem01chiha/dynamic-identification")


def stage(name: str, text: str = "") -> Any:
    return stage_of(text or (EXAMPLE / "pipeline.yaml").read_text(), name)


def robot() -> Robot:
    return Robot.load("robot.yaml", EXAMPLE)


def test_half_a_move_predicts_the_other_half_and_identifies_nothing() -> None:
    fit = stage("fit").run(stage("acquire").run(robot(), context()), robot())
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
    model = stage("all").run(record, robot()).model
    assert model is not None
    with caplog.at_level(logging.INFO, logger=LOG):
        stage("waves").run(record, Robot.of_model(model), context())
    orders = re.findall(r"cogging ripple, order ([\d.]+)", caplog.text)
    assert [float(order) for order in orders] == [166.0]
