"""Columns exchanged, bare counts and a wrong clock are refused by name, and what to write then is read."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.rigid_arm import ARM, STEP, loaded, record_of, recording

from robid_acquisition.plausible import slips_of
from robid_acquisition.recorded import RecordedAcquisition
from robid_core import Context, DataRejected, Record, Robot
from robid_core.stage import map_in_process

SLOW = {**ARM, "sample_time_s": 2 * STEP}


def moved(robot: Robot, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Angle and torque of the motors, by pinocchio, (n_sample, n_axis) each."""
    run = recording(robot, seed, seconds=10.0, noise=0.02).run
    return run.values("motor_position")[0, 0, 0, 0], run.values("motor_torque")[0, 0, 0, 0]


def read(folder: Path, robot: Robot, angle: dict[str, Any], **words: Any) -> Record:
    words = {
        "path": "run.npz",
        "sample_time_s": STEP,
        "channels": {"motor_position": angle, "motor_torque": {"column": "torque", "unit": "N m"}},
    } | words
    stage = RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)
    logger = logging.getLogger("test")
    return stage.run(
        robot, Context(np.random.default_rng(0), map_in_process, lambda *_, **__: None, logger, folder)
    )


@pytest.mark.parametrize("axes", [(0,), (2,), (0, 1, 2)])
def test_angles_in_the_place_of_torques_are_named(tmp_path: Path, axes: tuple[int, ...]) -> None:
    """Of one axis or of all, as they are or taken for degrees."""
    robot = loaded(tmp_path, ARM)
    angle, torque = moved(robot)
    there = np.isin(np.arange(3), axes)
    names = ", ".join(f"j{a + 1}" for a in axes)
    words = "and its torque" if len(axes) == 1 else "and their torques"
    for unit in (1.0, np.pi / 180):
        record = record_of(
            robot, np.where(there, unit * torque, angle), np.where(there, angle / unit, torque)
        )
        (found,) = [slip.what for slip in slips_of(record, robot)]
        assert found == f"the angle{'s' if len(axes) > 1 else ''} of {names} {words} are exchanged"


def test_angles_and_torques_of_joints_that_were_exchanged_are_named(tmp_path: Path) -> None:
    """Of an arm without coupling: the map took each for that of the joint, through the gear."""
    robot = loaded(tmp_path, {**ARM, "name": "plain", "coupling": np.diag([0.02, -0.025, 1.0]).tolist()})
    angle, torque = moved(robot)
    gear = np.diag(robot.drives.gear)
    at_joint, driven = angle * gear, torque / gear  # what the columns hold
    record = record_of(robot, driven / gear, at_joint * gear)
    assert [slip.what for slip in slips_of(record, robot)] == [
        "the angles of j1, j2, j3 and their torques are exchanged"
    ]


def test_exchanged_channels_of_an_arm_that_other_motors_move_are_named(tmp_path: Path) -> None:
    """The first motor moves the second joint, and the second the first: no side of a gear is one number."""
    coupling = [[0.0, 0.02, 0.0], [-0.025, 0.0, 0.0], [0.0, 0.0, 1.0]]
    robot = loaded(tmp_path, {**ARM, "name": "crossed", "coupling": coupling})
    angle, torque = moved(robot)
    record = record_of(robot, torque, angle)
    assert [slip.what for slip in slips_of(record, robot)] == [
        "the angles of j1, j2, j3 and their torques are exchanged"
    ]
    assert not slips_of(record_of(robot, angle, torque), robot)


def test_counts_are_named_with_those_of_a_turn_and_the_advice_is_read(tmp_path: Path) -> None:
    """Weight and inertia distinguish 4096 from 4000. The third axis is a slide, whose drive gives lengths."""
    robot = loaded(tmp_path, ARM)
    angle, torque = moved(robot)
    scale = np.array([2 * np.pi / 4096, 2 * np.pi / 4096, 1.0])
    np.savez(tmp_path / "run.npz", j=np.where(scale < 1, np.round(angle / scale), angle), torque=torque)
    with pytest.raises(DataRejected) as refused:
        read(tmp_path, robot, {"column": "j", "unit": "rad"})
    assert "the angles of j1, j2 look like counts of encoders, 4096 a turn" in str(refused.value)
    advice = {"unit": "counts", "unit_to": "rad", "scale": 0.00153398079}
    assert ", ".join(f"{key}: {value}" for key, value in advice.items()) in str(refused.value)
    advice["scale"] = scale.tolist()
    record = read(tmp_path, robot, {"column": "j", **advice})
    np.testing.assert_allclose(
        record.run.values("motor_position")[0, 0, 0, 0], angle, atol=1.01 * np.pi / 4096
    )


def test_a_clock_that_is_not_the_drives_is_named_and_the_advice_is_read(tmp_path: Path) -> None:
    """Time stamps twice as far apart: accelerations a quarter of what the torques say."""
    robot = loaded(tmp_path, ARM)
    angle, torque = moved(robot)
    np.savez(tmp_path / "run.npz", t=2 * STEP * np.arange(len(angle)), angle=angle, torque=torque)
    column = {"column": "angle", "unit": "rad"}
    with pytest.raises(
        DataRejected, match="0.001 s apart, as those of the robot's drives, and not 0.002 s"
    ) as no:
        read(tmp_path, robot, column, time_column="t", sample_time_s=None)
    assert "sample_time_s: 0.001, without time_column" in str(no.value)
    assert read(tmp_path, robot, column).run.sample_time_s == STEP


def test_drives_that_are_sampled_otherwise_are_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The record is right, and fits that simulate its drives need the robot file mended."""
    robot = loaded(tmp_path, SLOW)
    angle, torque = moved(robot)
    np.savez(tmp_path / "run.npz", angle=angle, torque=torque)
    assert read(tmp_path, robot, {"column": "angle", "unit": "rad"}).run.sample_time_s == STEP
    assert "set sample_time_s in the robot file (0.001 where it states none)" in caplog.text


@pytest.mark.parametrize("seed", range(3))
def test_what_is_right_or_otherwise_wrong_is_none_of_these(tmp_path: Path, seed: int) -> None:
    """A right recording, one of drives that are sampled otherwise, and bodies a half heavier."""
    robot, slow = loaded(tmp_path, ARM), loaded(tmp_path, {**SLOW, "name": "slow"})
    heavy = [{**body, "mass": 1.5 * body["mass"]} for body in ARM["bodies"]]
    angle, torque = moved(robot, seed)
    record = record_of(robot, angle, torque)
    assert not slips_of(record, robot)
    assert not slips_of(record, slow)
    for other in (
        loaded(tmp_path, {**ARM, "name": "heavy", "bodies": heavy}),
        loaded(tmp_path, {**SLOW, "name": "heavy_slow", "bodies": heavy}),
    ):
        assert not slips_of(record, other)
