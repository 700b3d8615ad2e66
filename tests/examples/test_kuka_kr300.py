"""The KUKA KR300: what is fitted to seven seconds of a recording predicts the three that follow."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from oracles.example_stages import PROJECT, context, needs, stage_of

from robid_core import Diagnosis, Fit, Record, Robot
from robid_core.pipeline import Pipeline
from robid_diagnosis.deflection import GearDeflection

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
    fit = stage("fit").run((record,), robot)
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


def bounds(diagnosis: Diagnosis, name: str) -> tuple[float, float]:
    """Both ends of an interval of 95 %."""
    assert diagnosis.values is not None
    i = diagnosis.values.names.index(name)
    value, half = diagnosis.values.estimate[i], 1.96 * diagnosis.values.standard_error[i]
    return float(value - half), float(value + half)


@functools.cache
def both_encoders() -> tuple[Robot, Record]:
    model = fitted().model
    assert model is not None
    return Robot.of_model(model), stage("both").run(recorded()[0], context())


def half(record: Record, part: slice) -> Record:
    """Cut all channels, (..., n_sample, n_axis)."""
    run = record.run
    channels = {name: one.replace(values=one.values[..., part, :]) for name, one in run.channels.items()}
    cut = run.replace(channels=channels, time_s=run.time_s[part], valid=run.valid[..., part])
    return record.replace(runs=(cut,))


@pytest.mark.full
def test_encoders_tell_a_time_shift_and_hardly_a_stiffness() -> None:
    """The link's channel is 2.9 ms late on all three axes; only axis 3 bends surely."""
    robot, record = both_encoders()
    found = stage("encoders").run(record, robot)
    for axis in (1, 2, 3):
        low, high = bounds(found, f"time_shift.axis_{axis}")
        assert 2.5e-3 < low < 2.9e-3 < high < 3.3e-3
        assert 4e6 < 1 / bounds(found, f"gear_compliance.axis_{axis}")[1] < 7e6
    sure = [bounds(found, f"gear_compliance.axis_{axis}")[0] > 0 for axis in (1, 2, 3)]
    assert sure == [False, False, True]
    assert "axis_4, axis_5, axis_6: no encoder behind the gear" in found.verdict


def test_halves_of_the_recording_do_not_contradict_each_other_nor_the_whole() -> None:
    robot, record = both_encoders()
    middle = len(record.run.time_s) // 2
    parts = [record, half(record, slice(0, middle)), half(record, slice(middle, None))]
    found = [GearDeflection().run(part, robot) for part in parts]
    for name in ("gear_compliance", "time_shift", "reversal"):
        for axis in (1, 2, 3):
            ends = [bounds(one, f"{name}.axis_{axis}") for one in found]
            assert max(low for low, _ in ends) < min(high for _, high in ends), (name, axis)


def test_a_link_angle_that_is_the_motor_angle_is_refused() -> None:
    robot, record = both_encoders()
    run = record.run
    link = run.channels["joint_position"]
    copied = np.full_like(link.values, np.nan)
    copied[..., :3] = robot.joint_angle(run.values("motor_position"))[..., :3]
    swapped = run.replace(channels=dict(run.channels) | {"joint_position": link.replace(values=copied)})
    found = stage("encoders").run(record.replace(runs=(swapped,)), robot)
    assert found.verdict.count("says nothing of the gear") == 3
