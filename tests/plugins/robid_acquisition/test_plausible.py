"""Recordings with a slip are refused by name, and read where the channel map mends it."""

from __future__ import annotations

import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_acquisition.agreement_of_channels import dead_in_some
from robid_acquisition.plausible import slips_of
from robid_acquisition.recorded import RecordedAcquisition
from robid_core import Context, DataRejected, Record, Robot
from robid_core.stage import map_in_process
from robid_core.testing import example_record
from robid_core.testing.robots import example_robot

ROBOT = Robot.load("one_axis")
N_SAMPLE = 3000


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with the motion of an arm under two sines: angles in degrees, torques turned round."""
    time = ROBOT.sample_time_s * np.arange(N_SAMPLE)
    reference = 10 * np.sin(2 * np.pi * time) + 4 * np.sin(2 * np.pi * 3.3 * time)
    done = ROBOT.simulate(reference[None, :, None], np.array([[0.4]]), seed=1)
    path = tmp_path_factory.mktemp("lab")
    np.savez(path / "run.npz", q=np.rad2deg(done.position[0, :, 0]), tau=-done.torque[0, :, 0])
    return path


def read(folder: Path, unit: str, sign: Any, **settings: Any) -> Record:
    channels = {
        "motor_position": {"column": "q", "unit": unit},
        "motor_torque": {"column": "tau", "unit": "N m", "sign": sign},
    }
    words = {"path": "run.npz", "sample_time_s": ROBOT.sample_time_s, "channels": channels, **settings}
    stage = RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)
    logger = logging.getLogger("test")
    context = Context(np.random.default_rng(0), map_in_process, lambda *_, **__: None, logger, folder)
    return stage.run(ROBOT, context)


@pytest.mark.parametrize(
    "unit, sign, words",
    [
        ("rad", -1, ["the angles look like degrees", "motor_position: unit: deg"]),
        ("deg", 1, ["the torque of axis_1 has the opposite sign", "motor_torque: sign: -1"]),
    ],
)
def test_a_slip_is_refused_with_what_to_write(folder: Path, unit: str, sign: int, words: list[str]) -> None:
    with pytest.raises(DataRejected, match="does not fit the robot file") as refused:
        read(folder, unit, sign)
    assert all(word in str(refused.value) for word in words)


@pytest.mark.parametrize("sign", [-1, [-1]])
def test_the_channel_map_mends_it(folder: Path, sign: Any) -> None:
    """With one sign for all axes, or a list."""
    torque = read(folder, "deg", sign).run.values("motor_torque")
    assert torque.ravel() == pytest.approx(-np.load(folder / "run.npz")["tau"])


def test_it_is_taken_as_it_is_with_a_warning_or_without(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        read(folder, "deg", 1, plausibility="ignore")
        assert not caplog.messages
        read(folder, "deg", 1, plausibility="warn")
    assert ["opposite sign" in message for message in caplog.messages] == [True]


def test_a_list_of_another_length_is_refused(folder: Path) -> None:
    with pytest.raises(DataRejected, match="motor_torque.sign: 2 numbers for 1 axes"):
        read(folder, "deg", [-1, 1])


@pytest.mark.parametrize("n_config", [1, 2])
def test_no_exchange_is_named_where_the_robots_own_torques_would_fit_exchanged(n_config: int) -> None:
    """All axes move alike, and friction is most of their torque: elasticity leaves 12 % of one torque's variance.

    With two torques exchanged less would be left, and with exchanged torques of the robot itself, too.
    """
    robot = example_robot(6)
    record = example_record(robot, n_config=n_config, n_block=1, seed=1)
    assert slips_of(record, robot) == []


def test_an_exchange_is_named_where_axes_move_differently() -> None:
    robot = example_robot(6)
    record = example_record(robot, n_config=4, n_block=1, seed=1)
    torque = record.run.channels["motor_torque"]
    order = [0, 1, 2, 3, 5, 4]
    exchanged = {
        **record.run.channels,
        "motor_torque": replace(torque, values=torque.values[..., order].copy()),
    }
    (slip,) = slips_of(record.replace(runs=(replace(record.run, channels=exchanged),)), robot)
    assert "the torques of axis_5 and axis_6 are exchanged" in (slip.what, *slip.ties)


def test_a_torque_that_is_dead_in_one_file_is_named_with_it() -> None:
    robot = example_robot(2)
    record = example_record(robot, n_config=2, n_block=1, seed=1)
    torque = record.run.channels["motor_torque"]
    values = torque.values.copy()
    values[1, 0, 1, ..., 1] = 0.3
    dead = {**record.run.channels, "motor_torque": replace(torque, values=values)}
    names = {(c, 0, e): f"run_{c}{e}.csv" for c in (0, 1) for e in (0, 1)}
    broken = record.replace(runs=(replace(record.run, channels=dead),))
    words = "run_11.csv: motor_torque of axis_2 has one value only while its angle moves: the channel is dead"
    assert list(dead_in_some(broken, names)) == [words]
    assert list(dead_in_some(record, names)) == []
