"""The KUKA KR300: what is fitted to seven seconds of a recording predicts the three that follow."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from oracles.example_stages import PROJECT, context, needs, stage_of

from robid_core import Fit, Record, Robot
from robid_core.pipeline import Pipeline

EXAMPLE = PROJECT / "examples" / "kuka_kr300"

pytestmark = needs("kuka_kr300/trajectory_A.mat", "github JonasWeigand/Robot_Identification")


def stage(name: str) -> Any:
    return stage_of((EXAMPLE / "pipeline.yaml").read_text(), name)


@functools.cache
def recorded() -> tuple[Robot, Record, Record]:
    robot = Robot.load("robot.yaml", EXAMPLE)
    return robot, *(stage(name).run(robot, context()) for name in ("acquire", "later"))  # type: ignore[return-value]


@functools.cache
def fitted() -> Fit:
    robot, record, _ = recorded()
    fit = stage("fit").run(record, robot)
    assert isinstance(fit, Fit)
    return fit


def test_the_pipeline_file_is_whole() -> None:
    assert [entry.name for entry in Pipeline.load(EXAMPLE / "pipeline.yaml").stages][-1] == "page"


def test_the_last_three_seconds_are_predicted() -> None:
    robot, _, later = recorded()
    (picture,) = stage("predict").run((later,), robot, context(), fitted()).time
    assert picture.relative_error < 0.12
    without = fitted().replace(model=robot.model({}))
    (told,) = stage("predict").run((later,), robot, context(), without).time
    assert told.relative_error > 1.5 * picture.relative_error


def test_the_mass_matrix_is_positive_in_the_whole_workspace() -> None:
    model = fitted().model
    assert model is not None
    robot = Robot.of_model(model)
    angle = np.random.default_rng(0).uniform(-np.pi, np.pi, (500, 6))
    assert (np.linalg.eigvalsh(robot.second_order(angle).mass) > 0).all()


def test_what_the_data_do_not_carry_is_doubted() -> None:
    kinds = {doubt.kind for doubt in fitted().doubts}
    assert {"weakly seen", "residual colour"} <= kinds
