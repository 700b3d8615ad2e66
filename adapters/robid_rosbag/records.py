"""Bags of ROS 1 (`.bag`) and ROS 2 (`.db3`, `.mcap` with CDR, or their folder) as a format of records.

`/joint_states.position[elbow]` is the position of one joint, `/joint_states.time_s` its time from the headers' stamps,
in seconds since 1970 as ROS counts them. Other messages are flattened: `/wrench.wrench.force.x`.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any, ClassVar

from mcap.records import Chunk, Message, Statistics
from mcap.stream_reader import CRCValidationError, StreamReader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from robid_core import DataRejected, FloatArray, files_of
from robid_rosbag.messages import JOINT_STATE, OF_JOINTS, Topic

METADATA = "metadata.yaml"  # of a ROS 2 bag; it stands for the folder
JOINT_UNITS = ("rad", "rad/s", "N m")  # of revolute joints, as sensor_msgs/JointState says


def read_topics(path: Path) -> tuple[list[Topic], list[str]]:
    """Return the topics of a bag, and what cannot be decoded.

    Raises
    ------
    DataRejected
        If the file is no bag, or is damaged.
    """
    topics: dict[str, Topic] = {}
    failed: dict[str, str] = {}
    unchecked = _check_chunks(path)
    try:
        with _opened(path) as reader:
            for connection, time_ns, content in reader.messages():
                name = connection.topic
                if name in failed:
                    continue
                try:
                    message = reader.deserialize(content, connection.msgtype)
                except Exception as error:  # rosbags raises whatever its decoders meet
                    failed[name] = f"{connection.msgtype} cannot be decoded ({type(error).__name__}: {error})"
                    continue
                topics.setdefault(name, Topic(name, connection.msgtype)).take(message, time_ns)
    except DataRejected as error:
        raise DataRejected(f"{path}: {error}") from error
    except Exception as error:
        raise DataRejected(
            f"{path}: cannot be read as a bag of ROS ({type(error).__name__}: {error})"
        ) from error
    return list(topics.values()), [*(f"{name}: {why}, left out" for name, why in failed.items()), *unchecked]


def _check_chunks(path: Path) -> list[str]:
    """Read the MCAP files of a bag to the end with their checksums, which rosbags does not look at.

    Returns what could not be checked, as some writers leave checksums out. Raises DataRejected where a file is cut, a
    checksum does not fit, or messages are missing that the file counts.
    """
    remarks = []
    for file in (one for one in files_of(path) if one.suffix == ".mcap"):
        try:
            with file.open("rb") as stream:
                records = StreamReader(stream, validate_crcs=True).records
                n_message, counted = 0, None
                for record in records:
                    n_message += isinstance(record, Message)
                    counted = record.message_count if isinstance(record, Statistics) else counted
                stream.seek(0)
                chunks = StreamReader(stream, emit_chunks=True).records
                bare = [not chunk.uncompressed_crc for chunk in chunks if isinstance(chunk, Chunk)]
        except CRCValidationError as error:
            raise DataRejected(f"A02: {file}: a checksum does not fit; copy the bag again") from error
        except Exception as error:  # mcap raises whatever its decoders meet
            raise DataRejected(
                f"A01: {file}: damaged, or cut ({type(error).__name__}); copy the bag again, or run ros2 bag reindex"
            ) from error
        if counted is not None and counted != n_message:
            raise DataRejected(
                f"A01: {file}: holds {n_message} messages, its summary counts {counted}; copy the bag again"
            )
        if any(bare):
            remarks.append(f"A03: {sum(bare)} of {len(bare)} chunks have no checksum and were not checked")
    return remarks


class _Bag(AnyReader):
    """A bag that is read with the decoders of the one before, where both have the same types of messages.

    rosbags compiles decoders for each bag anew, which takes longer than to read a small one.
    """

    _before: ClassVar[Typestore] = get_typestore(Stores.EMPTY)

    def open(self) -> None:
        """Open the bag."""
        super().open()
        if self.typestore.fielddefs == _Bag._before.fielddefs:
            self.typestore = _Bag._before
        _Bag._before = self.typestore


def _opened(path: Path) -> AnyReader:
    # Bags of ROS 2 before Iron do not say what their messages look like; the common ones are the same since.
    known = get_typestore(Stores.ROS2_HUMBLE)
    return _Bag([path.parent if path.name == METADATA else path], default_typestore=known)


class RosbagRecords:
    """Reader of ROS bags, registered as `rosbag` in the group `robid.records`."""

    @staticmethod
    def describe(path: Path) -> list[str]:
        """Return a line for each topic, one for each column, and what cannot be decoded."""
        topics, problems = read_topics(path)
        lines = []
        for topic in topics:
            lines.append(f"{topic.name}: {topic.n_message} messages of {topic.kind}")
            lines += [f"{name}: {values.shape}" for name, values in topic.columns().items()]
        return [*lines, *(remark for topic in topics for remark in topic.remarks), *problems]

    @staticmethod
    def read(path: Path) -> dict[str, FloatArray]:
        """Return the columns of all topics by name; DataRejected where there are none."""
        topics, problems = read_topics(path)
        for unchecked in (problem for problem in problems if problem.startswith("A03")):
            logging.getLogger("robid").warning("%s: %s", path, unchecked)
        columns: dict[str, Any] = {}
        for topic in topics:
            found = topic.columns()
            if set(found) - {f"{topic.name}.time_s", f"{topic.name}.log_time_s"}:
                columns |= found
        if not columns:
            why = f" ({problems[0]})" if problems else ""
            raise DataRejected(f"{path}: no topic holds numbers that can be decoded{why}")
        return columns

    @staticmethod
    def units(path: Path) -> dict[str, str]:
        """Return the units of joint states, by the names of their columns without the joints."""
        with _opened(path) as reader:
            topics = [one.topic for one in reader.connections if one.msgtype == JOINT_STATE]
        units = dict(zip(OF_JOINTS, JOINT_UNITS, strict=True))
        return {f"{topic}.{name}": unit for topic in topics for name, unit in units.items()}
