"""Bags of ROS 1 and ROS 2 hold the same columns; joints are found by their names, not by their places."""

from __future__ import annotations

import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags")

from faults.fault import fault
from fuzz.samples import write_bag_mcap
from rosbags.rosbag1 import Writer as OlderWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from robid_core import DataRejected
from robid_mcap.records import McapRecords
from robid_rosbag.records import RosbagRecords

START_S, LATE_S, STEP_NS = 1_700_000_000, 1_700_000_003, 10_000_000
KINDS = ("bag", "db3", "mcap")
Names = tuple[str, ...]


def written(folder: Path, kind: str, names: list[Names], stamped: bool = True) -> Path:
    """Write a bag: joint states at 100 Hz whose values are 10 i and the number of the joint, wrenches beside them."""
    types = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    of = types.types
    state, wrench = of["sensor_msgs/msg/JointState"], of["geometry_msgs/msg/Wrench"]
    header, time, vector = (
        of["std_msgs/msg/Header"],
        of["builtin_interfaces/msg/Time"],
        of["geometry_msgs/msg/Vector3"],
    )
    path = folder / ("run.bag" if kind == "bag" else f"run_{kind}")
    storage = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer: Any = OlderWriter(path) if kind == "bag" else Writer(path, version=9, storage_plugin=storage)
    encode = types.serialize_ros1 if kind == "bag" else types.serialize_cdr
    with writer:
        joints = writer.add_connection("/joint_states", state.__msgtype__, typestore=types)
        forces = writer.add_connection("/wrench", wrench.__msgtype__, typestore=types)
        for i, order in enumerate(names):
            stamp = time(sec=START_S * stamped, nanosec=i * STEP_NS * stamped)
            further = {"seq": i} if kind == "bag" else {}
            values = np.array([10.0 * i + int(name[-1]) for name in order])
            message = state(
                header=header(stamp=stamp, frame_id="", **further),
                name=list(order),
                position=values,
                velocity=np.array([]),
                effort=-values,
            )
            late = LATE_S * 10**9 + i * STEP_NS
            writer.write(joints, late, encode(message, state.__msgtype__))
            push = wrench(force=vector(x=1.0, y=2.0, z=float(i)), torque=vector(x=0.0, y=0.0, z=0.0))
            writer.write(forces, late, encode(push, wrench.__msgtype__))
    return path if kind == "bag" else next(path.glob(f"*.{kind}"))


def test_bags_that_are_read_in_turn_are_read_as_each_is_alone(tmp_path: Path) -> None:
    """Decoders are kept from one bag to the next: headers of ROS 1 have a number that those of ROS 2 lack."""
    paths = [written(tmp_path, kind, [("joint_1", "joint_2")] * 3) for kind in KINDS]
    alone = [RosbagRecords.read(path) for path in paths]
    for one in (0, 0, 1, 2, 2, 0, 1):
        again = RosbagRecords.read(paths[one])
        assert again.keys() == alone[one].keys()
        for name, values in again.items():
            np.testing.assert_array_equal(values, alone[one][name])
            assert np.isfinite(values).all()


@pytest.mark.parametrize("kind", KINDS)
def test_joint_states_are_columns_by_joint_whatever_their_order(tmp_path: Path, kind: str) -> None:
    orders: list[Names] = [("joint_1", "joint_2"), ("joint_2", "joint_1")] * 20
    columns = RosbagRecords.read(written(tmp_path, kind, orders))
    for joint in (1, 2):
        values = 10.0 * np.arange(40) + joint
        np.testing.assert_array_equal(columns[f"/joint_states.position[joint_{joint}]"], values)
        np.testing.assert_array_equal(columns[f"/joint_states.effort[joint_{joint}]"], -values)
    assert not any("velocity" in name for name in columns)  # absent, never zero
    # Seconds since 1970 as float64 are 2.4e-7 s apart.
    np.testing.assert_allclose(columns["/joint_states.time_s"], START_S + 0.01 * np.arange(40), atol=5e-7)
    np.testing.assert_allclose(columns["/joint_states.log_time_s"], LATE_S + 0.01 * np.arange(40), atol=5e-7)
    np.testing.assert_array_equal(columns["/wrench.force.z"], np.arange(40.0))
    np.testing.assert_array_equal(columns["/wrench.time_s"], columns["/joint_states.log_time_s"])


@pytest.mark.parametrize("kind", KINDS)
def test_joints_of_different_messages_have_times_of_their_own(tmp_path: Path, kind: str) -> None:
    path = written(tmp_path, kind, [("joint_1", "joint_2"), ("finger_3",)] * 10)
    columns = RosbagRecords.read(path)
    assert len(columns["/joint_states.time_s"]) == 20
    for joint, first in (("joint_1", 0), ("finger_3", 1)):
        times = columns[f"/joint_states.time_s[{joint}]"]
        assert len(times) == len(columns[f"/joint_states.position[{joint}]"]) == 10
        np.testing.assert_allclose(times, START_S + 0.01 * (first + 2 * np.arange(10)), atol=5e-7)
    assert any("in 10 of 20 messages" in line for line in RosbagRecords.describe(path))


def test_headers_without_stamps_give_the_time_of_recording_and_that_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, "db3", [("joint_1",)] * 5, stamped=False)
    np.testing.assert_allclose(
        RosbagRecords.read(path)["/joint_states.time_s"], LATE_S + 0.01 * np.arange(5), atol=5e-7
    )
    assert any("headers have no stamps" in line for line in RosbagRecords.describe(path))


def test_a_bag_is_named_by_its_file_its_folder_or_its_metadata(tmp_path: Path) -> None:
    file = written(tmp_path, "db3", [("joint_1",)] * 5)
    whole = RosbagRecords.read(file)
    for path in (file.parent, file.parent / "metadata.yaml"):
        for name, values in RosbagRecords.read(path).items():
            np.testing.assert_array_equal(values, whole[name])


def test_units_of_joint_states_are_known(tmp_path: Path) -> None:
    units = RosbagRecords.units(written(tmp_path, "bag", [("joint_1",)] * 5))
    assert units["/joint_states.position"] == "rad"
    assert units["/joint_states.effort"] == "N m"


def test_the_reader_of_mcap_says_who_reads_messages_of_ros(tmp_path: Path) -> None:
    path = written(tmp_path, "mcap", [("joint_1",)] * 5)
    with pytest.raises(
        DataRejected, match="no channel has numbers.*; --format rosbag, or format: rosbag, reads it"
    ):
        McapRecords.read(path)


def test_what_is_no_bag_is_rejected(tmp_path: Path) -> None:
    for name in ("text.bag", "text.db3"):
        path = tmp_path / name
        path.write_bytes(b"no bag at all\n" * 100)
        with pytest.raises(DataRejected, match=f"{name}: cannot be read as a bag of ROS"):
            RosbagRecords.read(path)


def with_checksum(content: bytes) -> bytes:
    """Put the checksum of its only chunk into a bag, as ros2 bag does and rosbags does not."""
    place = len(b"\x89MCAP0\r\n")
    while content[place] != 0x06:
        place += 9 + int.from_bytes(content[place + 1 : place + 9], "little")
    size = int.from_bytes(content[place + 25 : place + 33], "little")
    data = content[place + 49 : place + 49 + size]  # no compression: a name of no letters, then a length
    return content[: place + 33] + zlib.crc32(data).to_bytes(4, "little") + content[place + 37 :]


@fault(
    "A02",
    sees="exit 5: a checksum of the bag does not fit; copy the bag again",
    mutant=(
        "adapters/robid_rosbag/records.py",
        "    unchecked = _check_chunks(path)\n",
        "    unchecked = []\n",
    ),
)
def test_a_checksum_that_does_not_fit_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, "mcap", [("joint_1",)] * 5)
    sound = RosbagRecords.read(path)
    content = with_checksum(path.read_bytes())
    path.write_bytes(content)
    assert RosbagRecords.read(path).keys() == sound.keys()
    place = content.index(np.float64(31.0).tobytes())  # a position
    path.write_bytes(content[: place + 6] + b"\x0f" + content[place + 7 :])
    with pytest.raises(DataRejected, match=rf"A02: .*{path.name}: a checksum does not fit"):
        RosbagRecords.read(path)
    path.write_bytes(content[:-100])
    with pytest.raises(DataRejected, match=rf"A01: .*{path.name}: damaged, or cut"):
        RosbagRecords.read(path.parent / "metadata.yaml")


def test_messages_that_the_summary_counts_and_are_not_there_are_told(tmp_path: Path) -> None:
    """Statistics begin with their opcode, 11, and their length; the number of messages follows."""
    file = tmp_path / "log.mcap"
    write_bag_mcap(file)
    assert any("1 of 1 chunks have no checksum" in line for line in RosbagRecords.describe(file))
    few, many = (n.to_bytes(8, "little") for n in (30, 40))
    content, found = re.subn(rb"(?s)(\x0b.{8})" + few, lambda m: m[1] + many, file.read_bytes())
    assert found == 1
    file.write_bytes(content)
    with pytest.raises(DataRejected, match=r"A01: .*log.mcap: holds 30 messages, its summary counts 40"):
        RosbagRecords.describe(file)
