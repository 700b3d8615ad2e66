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
from ruamel.yaml import YAML

from robid_core import Context, Diagnosis, Fit, Record, Robot
from robid_core.registry import STAGES, registry
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


@functools.cache
def results() -> tuple[Robot, Record, Fit, Diagnosis]:
    """Run the example's stages once."""
    context = Context(
        np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"), data_root=DATA
    )
    robot = Robot.load("robot.yaml", EXAMPLE)
    record = stage("acquire").run(robot, context)
    fit = stage("fit").run(record, robot)
    return robot, record, fit, stage("simulate").run(record, fit, robot, context)


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
    plain = type(stage("fit"))().run(record, robot).parameters
    np.testing.assert_allclose(plain.estimate[:3], fit.parameters.estimate[:3], rtol=0.03)


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
    assert 'class="banner red"' not in page
    assert len(page) < 8e6
