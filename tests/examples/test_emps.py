"""The EMPS benchmark reproduces what its authors published, from the pipeline file in examples/emps."""

from __future__ import annotations

import functools
import json
import logging
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy
from ruamel.yaml import YAML

from robid_core import Context, Diagnosis, Fit, Record, Robot
from robid_core.pipeline import Pipeline
from robid_core.registry import STAGES, registry
from robid_core.residual import prescribe_record
from robid_core.stage import map_in_process

PROJECT = Path(__file__).parents[2]
EXAMPLE = PROJECT / "examples" / "emps"
DATA = Path(os.environ.get("ROBID_DATA", PROJECT.parent / "shared" / "data"))

pytestmark = pytest.mark.skipif(
    not (DATA / "emps" / "DATA_EMPS.mat").is_file(),
    reason=f"{DATA / 'emps/DATA_EMPS.mat'} is absent; get it from nonlinearbenchmark.org and set ROBID_DATA",
)


def stage(name: str) -> Any:
    node = YAML(typ="safe", pure=True).load(EXAMPLE / "pipeline.yaml")["stages"][name]
    cls = registry().load(STAGES, node["use"])
    return cls.model_validate_json(json.dumps(node.get("with", {})), strict=True)


def context_of(seed: int) -> Context:
    return Context(
        np.random.default_rng(seed),
        map_in_process,
        lambda *_: None,
        logging.getLogger("test"),
        data_root=DATA,
    )


@functools.cache
def results() -> tuple[Robot, Record, Fit, Diagnosis]:
    """Run the example's stages once."""
    context = context_of(0)
    robot = Robot.load("robot.yaml", EXAMPLE)
    record = stage("acquire").run(robot, context)
    fit = stage("fit").run((record,), robot)
    return robot, record, fit, stage("simulate").run(record, fit, robot, context)


MORE = [pytest.param(n, marks=pytest.mark.full) for n in (2, 4)]
NAMED = pytest.mark.parametrize("most", [1, *MORE])
"""Causes that the diagnosis may name; 4 in the example's file, which takes six times as long."""
EXTENDED = pytest.mark.parametrize("most", MORE)
"""Those with which the extended robot is held against the recording."""


@functools.cache
def explained(most: int) -> Diagnosis:
    """Run the stage that looks for causes."""
    robot, record, _, _ = results()
    return stage("explain").model_copy(update={"most": most}).run((record,), robot, context_of(1))


def test_the_recording_is_read_with_its_published_constants() -> None:
    _, record, _, _ = results()
    run = record.run
    assert run.sample_time_s == pytest.approx(1e-3, rel=1e-6)
    assert run.values("motor_position").shape == (1, 1, 1, 1, 24841, 1)
    assert run.channel("motor_torque").unit_symbol == "N"
    assert np.abs(run.values("motor_torque")).max() == pytest.approx(35.15 * 4.3257, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "published", "tolerance"),
    [
        ("mass.carriage", 95.11, 0.0002),
        ("friction.carriage.viscous", 203.5, 0.0005),
        ("friction.carriage.coulomb", 20.39, 0.0005),
        ("friction.carriage.offset", -3.17, 0.005),
    ],
)
def test_parameters_are_those_of_the_authors(name: str, published: float, tolerance: float) -> None:
    _, _, fit, _ = results()
    assert fit.parameters.value(name) == pytest.approx(published, rel=tolerance)


def test_the_relative_force_error_is_that_of_the_authors() -> None:
    _, _, fit, _ = results()
    assert fit.converged
    assert 100 * fit.time[0].relative_error == pytest.approx(4.08, abs=0.01)


def test_the_default_settings_give_nearly_the_same() -> None:
    robot, record, fit, _ = results()
    plain = type(stage("fit"))().run((record,), robot).parameters
    for name in ("mass.carriage", "friction.carriage.viscous", "friction.carriage.coulomb"):
        assert plain.value(name) == pytest.approx(fit.parameters.value(name), rel=0.03), name


def test_the_simulated_closed_loop_repeats_the_recording() -> None:
    _, _, _, diagnosis = results()
    position, force = diagnosis.time
    assert 100 * position.relative_error < 0.0138  # published
    assert 100 * force.relative_error < 5.85  # published
    assert "motor position within" in diagnosis.verdict


def test_the_page_shows_measured_against_simulated() -> None:
    robot, record, fit, diagnosis = results()
    page = stage("page").run(robot, record=record, fit=fit, diagnosis=diagnosis).html
    for text in ("mass.carriage", "95.11", "measured − simulated", "motor force", "4.08"):
        assert text in page
    # What four parameters leave has a memory, which standard errors count: a remark, and nothing is doubted.
    assert [(doubt.kind, doubt.degree) for doubt in fit.doubts] == [("residual colour", "remark")]
    assert not fit.is_doubted
    assert 'class="serious"' not in page
    assert page.count('<li class="mild">') == 1
    assert len(page) < 8e6


@NAMED
def test_causes_are_named_with_their_gain_and_what_is_left_is_said(most: int) -> None:
    """Friction that differs with the direction; second, a wave of 2.5 mm of the screw; each with its gain."""
    found = explained(most)
    causes = {finding.effect: finding for finding in found.findings if finding.kind != "unknown"}
    told = {name: {name, *(tie.split()[0] for tie in finding.ties)} for name, finding in causes.items()}
    directions = [name for name, alike in told.items() if {"friction.eyring", "friction.power_law"} & alike]
    assert len(directions) == 1
    assert max(causes, key=lambda name: causes[name].gain) == directions[0]
    assert all(finding.gain > 0 and finding.p_value < 1e-3 for finding in causes.values())
    assert found.findings[-1].kind == "unknown"
    assert "Left unexplained" in found.verdict
    if most > 1:
        ripple = causes["drive.torque_ripple"]
        order = ripple.value[ripple.names.index("order")]
        assert 2e3 * np.pi / order == pytest.approx(2.5, rel=2e-3)


def steady_parts(record: Record) -> list[np.ndarray]:
    """Samples at which the carriage moves steadily, at each of its six speeds: there the force is friction."""
    run = record.run
    low = scipy.signal.butter(4, 20, fs=1 / run.sample_time_s, output="sos")
    position = scipy.signal.sosfiltfilt(low, run.values("motor_position")[0, 0, 0, 0, :, 0])
    speed = np.gradient(position, run.sample_time_s)
    steady = np.abs(np.gradient(speed, run.sample_time_s)) < 0.02
    return [
        steady & (np.abs(speed - middle) < 0.005)
        for middle in (-0.125, -0.0833, -0.0417, 0.0417, 0.0833, 0.125)
    ]


@EXTENDED
def test_the_extended_robot_has_the_friction_of_each_direction(most: int) -> None:
    """Where the carriage moves steadily its friction is read off the recording, without a model.

    Backwards it takes 4 to 10 N more than forwards. One Coulomb level, one slope and an offset err by up to 2 N there,
    the extended robot by less than half of that.
    """
    robot, record, fit, _ = results()
    found = explained(most)
    assert found.model is not None
    plain = {name: fit.parameters.value(name) for name in fit.parameters.names if name in robot.layout}
    models = {"four parameters": robot.with_parameters(plain), "extended": Robot.of_model(found.model)}
    parts = steady_parts(record)
    assert all(part.sum() > 1000 for part in parts)
    measured = record.run.values("motor_torque")[0, 0, 0, 0, :, 0]
    worst = {}
    for name, model in models.items():
        predicted = prescribe_record(model, record).run.values("motor_torque")[0, 0, 0, 0, :, 0]
        worst[name] = max(abs(float((measured - predicted)[part].mean())) for part in parts)
    assert worst["four parameters"] > 1.4
    assert worst["extended"] < 0.5 * worst["four parameters"]


@pytest.mark.full
def test_blocks_left_out_are_predicted_better_than_the_authors_fit_their_own_data() -> None:
    """The authors' decimation and relative error, every block predicted from the nine others."""
    robot, record, _, _ = results()
    checked = stage("validate").run(record, robot, context_of(1), explained(4))
    before, after = checked.errors
    assert 100 * before.relative[0] == pytest.approx(4.0, abs=0.4)
    assert 100 * after.relative[0] < 2.6
    assert 1.7 * after.relative[0] < before.relative[0]
    whole = checked.time[0]
    assert whole.relative_error == pytest.approx(after.relative[0], rel=1e-9)
    assert len(whole.time_s) == 2480


def test_one_closed_loop_is_that_of_the_fit_and_one_that_of_the_extended_robot() -> None:
    """A stage that takes any diagnosis is wired to all of them where the file does not say which."""
    stages = {node.name: node for node in Pipeline.load(EXAMPLE / "pipeline.yaml").stages}
    assert not stages["simulate"].inputs.get("explained")
    assert stages["simulate_extended"].inputs["explained"] == ("explain",)


@EXTENDED
def test_the_extended_robot_follows_the_recording_closer_in_closed_loop(most: int) -> None:
    robot, record, fit, plain = results()
    found = explained(most)
    assert found.model is not None
    extended = stage("simulate_extended").run(record, fit, robot, context_of(1), (found,))
    for before, after in zip(plain.time, extended.time, strict=True):
        assert after.relative_error < 0.9 * before.relative_error
