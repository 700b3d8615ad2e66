"""Motions that are not for a frequency response: measured, kept and judged without lines."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_acquisition.batch import SimulatedAcquisition
from robid_acquisition.drives import DriveAcquisition, reject_drift
from robid_acquisition.simulated import SimulatedDrives
from robid_can.drives import CanDrives
from robid_core import Configurations, Context, DataRejected, Drives, Excitation, Record, Robot
from robid_core.estimation.excitation.velocity_sweep import plateaus
from robid_core.stage import map_in_process
from robid_excitation.constant_velocity import ConstantVelocity
from robid_mcap.records import McapRecords

PLANT = "one_axis_true"
SETTLING: dict[str, Any] = {"settle_s": 0.05, "settle_rad": 0.1}
SWEEP = ConstantVelocity(
    steps=2, lowest_share=0.02, highest_share=0.1, plateau_s=0.2, longest_s=0.5, **SETTLING
)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("one_axis")


@pytest.fixture(scope="module")
def standing(robot: Robot) -> Configurations:
    return Configurations(robot.axis_names, np.array([[0.2]]))


@pytest.fixture(scope="module")
def excitation(robot: Robot, standing: Configurations) -> Excitation:
    return SWEEP.run(standing, robot, context())


def context(scratch: Path | None = None) -> Context:
    log = logging.getLogger("robid.acquire")
    generator = np.random.default_rng(1)
    return Context(generator, map_in_process, lambda done, total, note="": None, log, scratch=scratch)


def acquire(
    drives: Drives,
    robot: Robot,
    standing: Configurations,
    excitation: Excitation,
    scratch: Path | None = None,
) -> Record:
    stage = DriveAcquisition(periods=1, settle_periods=0)
    return stage.run(standing, excitation, robot, drives, context(scratch))


def assert_no_lines(record: Record) -> None:
    assert record.line is None
    with pytest.raises(DataRejected, match="it has no excited lines"):
        record.spectra()
    with pytest.raises(DataRejected, match="it has no excited lines"):
        _ = record.frequency_hz
    # Spectra at bins that are asked for are still there.
    assert record.period_spectra("motor_torque", line=np.array([1, 2])).shape[4] == 2


def test_excitations_and_records_without_lines_survive_their_files(
    robot: Robot, standing: Configurations, excitation: Excitation, tmp_path: Path
) -> None:
    excitation.write(tmp_path / "excitation.h5")
    again = Excitation.read(tmp_path / "excitation.h5")
    assert again.line.shape == (0,)
    np.testing.assert_array_equal(again.reference, excitation.reference)
    record = acquire(SimulatedDrives(plant=PLANT), robot, standing, excitation)
    assert_no_lines(record)
    record.write(tmp_path / "record.h5")
    assert Record.read(tmp_path / "record.h5").line is None


def test_batches_give_the_record_of_the_drives(
    robot: Robot, standing: Configurations, excitation: Excitation
) -> None:
    drives = acquire(SimulatedDrives(plant=PLANT), robot, standing, excitation)
    stage = SimulatedAcquisition(plant=PLANT, periods=1, settle_periods=0)
    batch = stage.run(standing, excitation, robot, context())
    assert_no_lines(batch)
    for name, channel in batch.run.channels.items():
        np.testing.assert_array_equal(channel.values, drives.run.values(name))


def test_the_raw_log_gives_the_same_record(
    robot: Robot, standing: Configurations, excitation: Excitation, tmp_path: Path
) -> None:
    record = acquire(SimulatedDrives(plant=PLANT), robot, standing, excitation, tmp_path)
    (log,) = tmp_path.glob("*.mcap")
    again = McapRecords.read_record(log)
    assert_no_lines(again)
    for name, channel in record.run.channels.items():
        np.testing.assert_array_equal(channel.values, again.run.values(name))


def test_over_the_bus_the_plateaus_are_found_in_what_the_drives_applied(
    robot: Robot, standing: Configurations, excitation: Excitation
) -> None:
    record = acquire(CanDrives(plant=PLANT), robot, standing, excitation)
    assert_no_lines(record)
    applied = record.run.values("speed_reference")[0, 0, 0, 0]
    asked = plateaus(excitation.reference[0, 0, 0], robot.sample_time_s, **SETTLING)
    found = plateaus(applied, robot.sample_time_s, **SETTLING)
    assert len(found) == len(asked) == 4
    for one, other in zip(asked, found, strict=True):
        # The drive's increments of 1e-6 rad/s; rounding adds a few equal samples where a plateau has no whole turn.
        assert other.speed == pytest.approx(one.speed, abs=1e-6)
        assert abs(other.first - one.first) <= 2
        assert abs(other.last - one.last) <= 2


def test_periods_that_drift_are_told_where_there_are_no_lines_and_rejected_where_there_are() -> None:
    position = np.zeros((2, 10, 1))
    position[1] += 0.1
    (note,) = reject_drift("experiment 1", position, ("axis_1",), 0.05, has_lines=False)
    assert note == (
        "experiment 1: axis_1: the motor angle drifts by 0.1 rad per period, more than 0.05 rad; "
        "the periods do not repeat"
    )
    with pytest.raises(DataRejected, match="what depends on the angle does not repeat"):
        reject_drift("experiment 1", position, ("axis_1",), 0.05)
    position[1] = np.nan
    with pytest.raises(DataRejected, match="drifts by nan rad"):
        reject_drift("experiment 1", position, ("axis_1",), 0.05, has_lines=False)
    assert reject_drift("experiment 1", np.zeros((2, 10, 1)), ("axis_1",), 0.05, has_lines=False) == []
