"""Bags of ROS 2 are folders: as one recording, by a pattern, in a table, and with the hash of their files."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags")

from fuzz.samples import write_bag_folder

from robid_acquisition.recorded import RecordedAcquisition
from robid_core import ConfigurationError, Context, DataRejected, Record, Robot, guarded_reader
from robid_core.stage import map_in_process

CHANNELS = {
    name: {"column": [f"/joint_states.{of}[{axis}]" for axis in ("a", "b")], "unit": unit}
    for name, of, unit in (("motor_position", "position", "rad"), ("motor_torque", "effort", "N m"))
}
AXIS = {"gear_ratio": 1.0, "rotor_inertia": 1e-3, "torque_limit": 10.0, "speed_limit": 100.0}
ROBOT = {
    "robid_robot": 1,
    "name": "two",
    "bodies": [{"joint": "a", "mass": 1.0}, {"joint": "b", "parent": "a", "mass": 1.0}],
    "axes": {name: AXIS | {"controller": {"speed_gain": 0.1}} for name in ("a", "b")},
}


def stage(**source: Any) -> RecordedAcquisition:
    settings = {"time_column": "/joint_states.time_s", "plausibility": "ignore", "channels": CHANNELS}
    return RecordedAcquisition.model_validate_json(json.dumps(settings | source), strict=True)


def read(root: Path, **source: Any) -> Record:
    context = Context(
        np.random.default_rng(0), map_in_process, lambda done, total, note="": None, logging.getLogger(), root
    )
    (root / "robot.yaml").write_text(json.dumps(ROBOT))
    return stage(**source).run(Robot.load("robot.yaml", root), context)


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_the_folder_of_a_bag_is_read_as_its_file_is(tmp_path: Path, storage: str) -> None:
    write_bag_folder(tmp_path / "lab" / "bag_2", storage)
    file = next(one for one in (tmp_path / "lab" / "bag_2").iterdir() if one.suffix in (".db3", ".mcap"))
    whole = read(tmp_path, path=f"lab/bag_2/{file.name}", format="rosbag")
    for path in ("lab/bag_2", "lab/bag_2/"):
        found = read(tmp_path, path=path)
        for name in CHANNELS:
            np.testing.assert_array_equal(found.run.values(name), whole.run.values(name))
    assert "rosbag" in found.source
    assert ("robid.records", "rosbag") in stage(path="lab/bag_2").uses()


def test_a_pattern_and_a_table_name_bags(tmp_path: Path) -> None:
    for number in (1, 2):
        write_bag_folder(tmp_path / "lab" / f"run_{number}")
    (tmp_path / "lab" / "runs.csv").write_text("file,role\nrun_1,train\nrun_2,test\n")
    assert read(tmp_path, pattern="lab/run_{exp}").run.valid.shape[:3] == (1, 1, 2)
    listed = read(tmp_path, index="lab/runs.csv").run
    assert listed.test is not None
    assert listed.test.ravel().tolist() == [False, True]


def test_a_bag_counts_by_the_hash_of_its_files(tmp_path: Path) -> None:
    write_bag_folder(tmp_path / "bag")
    with pytest.raises(DataRejected, match="A13: .*its sha256 is ([0-9a-f]{64})") as first:
        read(tmp_path, path="bag", sha256="0" * 64)
    sha256 = str(first.value).partition("its sha256 is ")[2][:64]
    read(tmp_path, path="bag", sha256=sha256)
    (tmp_path / "bag" / "further.db3").write_bytes(b"more")
    with pytest.raises(DataRejected, match="A13"):
        read(tmp_path, path="bag", sha256=sha256)


def test_a_folder_that_is_no_bag_is_called_so(tmp_path: Path) -> None:
    (tmp_path / "lab").mkdir()
    with pytest.raises(ConfigurationError, match=r"lab is a folder, and no bag of ROS 2 .*name a file of it"):
        read(tmp_path, path="lab", format="rosbag")


def test_a_damaged_file_of_a_bag_is_told(tmp_path: Path) -> None:
    write_bag_folder(tmp_path / "bag", "MCAP")
    file = next((tmp_path / "bag").glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(DataRejected, match=rf"A01: .*{file.name}: damaged, or cut"):
        guarded_reader("rosbag").read(tmp_path / "bag")
