"""Measurements simulated in batches are those of simulated drives, on as many cores as there are."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_acquisition import batch as batch_module
from robid_acquisition.batch import SimulatedAcquisition, record_of, reference_numbers
from robid_acquisition.drives import DriveAcquisition
from robid_acquisition.simulated import SimulatedDrives
from robid_core import (
    BatchPortion,
    ConfigurationError,
    Context,
    DataRejected,
    MotionRefused,
    NotTrustworthy,
    Record,
    Robot,
)
from robid_core.executors import process_executor
from robid_core.robot import RobotDescription
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_core.testing.inputs import example_configurations, example_excitation


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("one_axis")


def context(tasks: Any = map_in_process) -> tuple[Context, list[tuple[float, float, str]]]:
    steps: list[tuple[float, float, str]] = []

    def progress(done: float, total: float, note: str = "") -> None:
        steps.append((done, total, note))

    log = logging.getLogger("robid.acquire")
    return Context(np.random.default_rng(5), tasks, progress, log), steps


def measure(robot: Robot, stage: Any, tasks: Any = map_in_process, scale: float = 1.0, **lent: Any) -> Record:
    where = example_configurations(robot, n_config=5)
    excitation = example_excitation(robot, example_configurations(robot, n_config=3))  # realizations repeat
    excitation = replace(excitation, reference=scale * excitation.reference)
    record: Record = stage.run(where, excitation, robot, context=context(tasks)[0], **lent)
    return record


def test_the_record_is_that_of_simulated_drives(robot: Robot) -> None:
    settings: dict[str, Any] = {"periods": 2, "settle_periods": 1}
    whole = measure(robot, SimulatedAcquisition(plant="one_axis_true", **settings))
    drives = measure(robot, DriveAcquisition(**settings), drives=SimulatedDrives(plant="one_axis_true"))
    assert whole.source == "simulated in batches, plant 'one_axis_true'"
    assert (whole.axis_names, whole.torque_hold) == (drives.axis_names, drives.torque_hold)
    for name in ("angle", "line", "frequency_hz"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(drives, name))
    assert whole.run.channels.keys() == drives.run.channels.keys()
    np.testing.assert_array_equal(whole.run.valid, drives.run.valid)
    np.testing.assert_array_equal(whole.run.time_s, drives.run.time_s)
    for name, ours in whole.run.channels.items():
        theirs = drives.run.channels[name]
        assert (ours.side, ours.unit_symbol) == (theirs.side, theirs.unit_symbol)
        np.testing.assert_array_equal(ours.values, theirs.values)
    moved = np.ptp(whole.run.values("motor_position"), axis=4)
    assert (moved > 1e-2).all()


def test_bytes_do_not_depend_on_who_computes(robot: Robot, tmp_path: Path) -> None:
    stage = SimulatedAcquisition(plant="one_axis_true", periods=1, settle_periods=0)
    measure(robot, stage).write(tmp_path / "here.h5")
    with process_executor(jobs=1) as one:
        measure(robot, stage, one).write(tmp_path / "one.h5")
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "here.h5").read_bytes()


@pytest.mark.parametrize("n_axis", [1, 6])
def test_the_contract_of_stages_is_kept(n_axis: int) -> None:
    plant = {1: "one_axis", 6: "six_axis"}[n_axis]
    check_stage(SimulatedAcquisition, for_axes=(n_axis,), plant=plant, periods=1, settle_periods=0)


def test_the_reference_stands_in_memory_once(robot: Robot) -> None:
    where, excitation = (
        example_configurations(robot),
        example_excitation(robot, example_configurations(robot)),
    )
    shape = (2, 2, 1, 7, excitation.n_sample, 1)
    record = record_of("x", where, excitation, np.zeros(shape), np.zeros(shape))
    values = record.run.values("speed_reference")
    assert values.shape == shape
    assert np.shares_memory(values, excitation.reference)
    np.testing.assert_array_equal(values[1, 0, 0, 6], excitation.reference[1, 0, 0])


def test_configurations_beyond_the_realizations_use_them_again() -> None:
    assert reference_numbers(3, (2, 2, 2, 9, 1)).tolist() == [0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3]


def test_progress_counts_experiments(robot: Robot) -> None:
    where = example_configurations(robot)
    lent, steps = context()
    SimulatedAcquisition(plant="one_axis_true", periods=1, settle_periods=0).run(
        where, example_excitation(robot, where), robot, lent
    )
    assert [step[:2] for step in steps] == [(0, 4), (4, 4)]
    assert {step[2] for step in steps} == {"simulating experiments"}


def test_it_says_that_nothing_moves_and_what_it_depends_on(tmp_path: Path) -> None:
    assert SimulatedAcquisition(plant="six_axis_true").plan_lines({}) == [
        "simulates 'six_axis_true', nothing moves; 2 periods after 1 to settle"
    ]
    plant = tmp_path / "plant.yaml"
    plant.write_text(
        "robid_robot: 1\nbase: one_axis\neffects:\n"
        "  stick: {use: friction.lugre, on: axis_1}\n  ripple: {use: drive.torque_ripple, on: axis_1}\n"
    )
    stage = SimulatedAcquisition(plant=str(plant))
    assert stage.uses() == [("robid.effects", "drive.torque_ripple"), ("robid.effects", "friction.lugre")]


def test_what_a_robot_would_be_refused_is_not_simulated_either(robot: Robot) -> None:
    stage = SimulatedAcquisition(plant="one_axis_true")
    with pytest.raises(MotionRefused, match=r"configuration 1, block 1, experiment 1: D03"):
        measure(robot, stage, scale=1e3)
    with pytest.raises(
        ConfigurationError, match="plant 'six_axis_true' has 6 motors, robot 'one_axis' has 1"
    ):
        measure(robot, SimulatedAcquisition(plant="six_axis_true"))


def changed_plant(path: Path, speed_gain: float, torque_limit: float) -> str:
    """Write a robot file like one_axis_true with another gain and limit."""
    described = Robot.load("one_axis_true").description.model_dump(mode="json")
    described["axes"]["axis_1"]["torque_limit"] = torque_limit
    described["axes"]["axis_1"]["controller"]["speed_gain"] = speed_gain
    path.write_text(Robot(RobotDescription.model_validate(described)).to_yaml())
    return str(path)


def test_saturated_and_drifting_data_are_rejected_by_name(robot: Robot, tmp_path: Path) -> None:
    weak = changed_plant(tmp_path / "weak.yaml", speed_gain=0.08, torque_limit=1.0)
    with pytest.raises(
        DataRejected, match=r"D02: configuration \d, block \d, experiment 1: axis_1: the torque"
    ):
        measure(robot, SimulatedAcquisition(plant=weak))
    with pytest.raises(
        DataRejected, match=r"configuration 1, block 1, experiment 1: axis_1: the motor angle drifts"
    ):
        measure(robot, SimulatedAcquisition(plant="one_axis_true", drift_limit_rad=1e-12))


def test_an_experiment_that_diverges_is_named(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverging(tasks: Any, batches: Any, progress: Any) -> Any:
        none = np.zeros((0, 0, 0))
        return [
            BatchPortion(0, 0, 8, none, none, none, "left all bounds at 0.1 s, coordinate 'axis_1' first", 3)
        ]

    monkeypatch.setattr(batch_module, "simulate_portions", diverging)
    with pytest.raises(
        NotTrustworthy, match=r"^configuration 2, block 2, experiment 1 left all bounds at 0\.1 s"
    ):
        measure(robot, SimulatedAcquisition(plant="one_axis_true"))
    wild = changed_plant(tmp_path / "wild.yaml", speed_gain=50.0, torque_limit=1e12)
    monkeypatch.undo()
    with pytest.raises(ConfigurationError, match="controller is unstable"):
        measure(robot, SimulatedAcquisition(plant=wild))
