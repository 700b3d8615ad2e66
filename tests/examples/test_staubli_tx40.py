"""The Staubli TX40: laws of friction and the ripple of a gear come out of five seconds of motion."""

from __future__ import annotations

import functools
import logging
import re
from typing import Any

import numpy as np
import pytest
from oracles.example_stages import LOG, PROJECT, context, needs, stage_of

from robid_core import Fit, Record, Robot

EXAMPLE = PROJECT / "examples" / "staubli_tx40"

pytestmark = needs("staubli_tx40/motor_torque.csv", "the examples of FIGAROH")


def stage(name: str) -> Any:
    return stage_of((EXAMPLE / "pipeline.yaml").read_text(), name)


@functools.cache
def recorded() -> tuple[Robot, Record]:
    robot = Robot.load("robot_friction.yaml", EXAMPLE)
    return robot, stage("acquire").run(robot, context())


@functools.cache
def rough() -> Fit:
    robot, record = recorded()
    fit = stage("rough").run((record,), robot)
    assert isinstance(fit, Fit)
    return fit


def left(fit: Fit) -> np.ndarray:
    (time,) = fit.time
    return np.linalg.norm(time.measured - time.modelled, axis=0) / np.linalg.norm(time.measured, axis=0)


def test_only_the_third_axis_rubs_with_its_load() -> None:
    table, found = rough().parameters, rough()
    assert found.converged
    rows = [table.names.index(f"effect.load_{i}.load_coulomb") for i in range(1, 7)]
    size, error = table.estimate[rows], table.standard_error[rows]
    assert size[2] > 10 * error[2]
    assert (np.delete(size, 2) < 3 * np.delete(error, 2)).all()


def test_the_gear_of_the_fourth_axis_has_a_wave_that_both_halves_of_the_motion_show(
    caplog: pytest.LogCaptureFixture,
) -> None:
    _, record = recorded()
    assert rough().model is not None
    with caplog.at_level(logging.INFO, logger=LOG):
        clean = stage("smooth").run(record, Robot.of_model(rough().model), context())
    waves = re.findall(r"axis_4: cogging ripple, order ([\d.]+), amplitude ([\d.]+)", caplog.text)
    orders = np.array([float(order) for order, _ in waves])
    assert np.abs(orders - 0.640).min() < 0.003
    assert np.abs(orders - 2 * 0.640).min() < 0.006
    before, after = record.run.values("motor_torque"), clean.run.values("motor_torque")
    assert np.abs(before - after)[..., 3].max() > 0.011
    assert np.array_equal(before[..., :3], after[..., :3])  # no wave stands out there


@pytest.mark.full
def test_each_tenth_is_predicted_by_the_others() -> None:
    robot, record = recorded()
    assert rough().model is not None
    clean = stage("smooth").run(record, Robot.of_model(rough().model), context())
    fit = stage("fit").run((clean,), robot)
    told = [float(number) for number in re.findall(r"axis_\d ([\d.]+) %", fit.status)]
    assert (np.array(told[:4]) < [3.6, 3.6, 6.5, 6.5]).all()
    assert left(fit)[3] < 0.7 * left(rough())[3]


@pytest.mark.full
def test_the_verdict_names_friction_that_curves_a_wave_of_the_motor_and_no_delay() -> None:
    """Two laws with one fingerprint are one class; axes 4 and 5 gain in the unseen second, no other loses."""
    text = (EXAMPLE / "explain.yaml").read_text()
    robot = Robot.load("robot.yaml", EXAMPLE)
    first, later = (stage_of(text, name).run(robot, context()) for name in ("acquire", "later"))
    model = stage_of(text, "fit").run((first,), robot).model
    assert model is not None
    found = stage_of(text, "explain").run((first, later), Robot.of_model(model), context())
    causes = {one.on: one for one in found.findings if one.kind != "unknown"}
    assert set(causes) == {"axis_4", "axis_5"}
    curved, wave = (" ".join((causes[on].effect, *causes[on].ties)) for on in ("axis_4", "axis_5"))
    assert "friction.power_law" in curved
    assert "friction.eyring" in curved
    assert "friction.angle_dependent" in wave
    assert "drive.torque_ripple" in wave
    values = dict(zip(causes["axis_5"].names, causes["axis_5"].value.tolist(), strict=True))
    assert next(value for name, value in values.items() if name.endswith("order")) == pytest.approx(
        1, abs=0.01
    )
    assert "cannot be distinguished from what the model lacks" in found.verdict
    assert "its angle by" not in found.verdict
    before, after = (one.relative for one in found.errors)
    assert "role test" in found.errors[0].quantity
    assert after[3] < 0.85 * before[3]
    assert after[4] < 0.65 * before[4]
    assert (after < 1.02 * before).all()
