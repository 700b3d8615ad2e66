"""Arrays in messages of others are tables by the names of their fields, as in JSON files and bags of ROS."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2
from mcap.writer import Writer

from robid_core import DataRejected
from robid_mcap.records import McapRecords
from robid_mcap.schema import message_class_of

STEP_NS = 1_000_000
FIELD = descriptor_pb2.FieldDescriptorProto


def written(path: Path, messages: list[bytes], encoding: str, schema: tuple[str, bytes]) -> Path:
    """Write messages of the topic `/joints` at 1 kHz."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library="test")
        kind = writer.register_schema(schema[0], "jsonschema" if encoding == "json" else encoding, schema[1])
        topic = writer.register_channel("/joints", encoding, kind)
        for number, message in enumerate(messages):
            writer.add_message(topic, number * STEP_NS, message, number * STEP_NS)
        writer.finish()
    return path


def of_json(path: Path, messages: list[Any]) -> Path:
    return written(path, [json.dumps(one).encode() for one in messages], "json", ("Joints", b"{}"))


def test_arrays_of_JSON_messages_are_tables(tmp_path: Path) -> None:
    q = np.random.default_rng(1).standard_normal((40, 3))
    messages = [
        {"q": row.tolist(), "motor": {"tau": (-row).tolist()}, "on": True, "names": ["a", "b"]} for row in q
    ]
    columns = McapRecords.read(of_json(tmp_path / "a.mcap", messages))
    np.testing.assert_array_equal(columns["/joints.q"], q)
    np.testing.assert_array_equal(columns["/joints.motor.tau"], -q)
    np.testing.assert_allclose(columns["/joints.log_time_s"], 1e-3 * np.arange(40), rtol=1e-12)
    assert set(columns) == {"/joints.q", "/joints.motor.tau", "/joints.on", "/joints.log_time_s"}


def test_records_in_an_array_are_told_apart_by_their_number_and_null_is_not_measured(tmp_path: Path) -> None:
    messages = [{"axes": [{"q": 1.0 * k}, {"q": 2.0 * k}], "tau": [None, 1.0]} for k in range(5)]
    columns = McapRecords.read(of_json(tmp_path / "a.mcap", messages))
    np.testing.assert_array_equal(columns["/joints.axes.1.q"], 2.0 * np.arange(5))
    np.testing.assert_array_equal(columns["/joints.tau"], [[np.nan, 1.0]] * 5)


def test_an_array_whose_length_changes_is_told_and_is_no_column(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    messages: list[Any] = [{"q": [0.1, 0.2][: 1 + k % 2], "tau": 1.0 * k} for k in range(6)]
    path = of_json(tmp_path / "a.mcap", messages)
    columns = McapRecords.read(path)
    assert set(columns) == {"/joints.tau", "/joints.log_time_s"}
    told = "/joints.q: the length of this array changes (1, 2 values), left out"
    assert told in caplog.text
    assert told in McapRecords.describe(path)
    alone = of_json(tmp_path / "b.mcap", [{"q": one["q"]} for one in messages])
    with pytest.raises(
        DataRejected, match=r"no channel has numbers.*/joints.q: the length of this array changes"
    ):
        McapRecords.read(alone)


def test_images_are_no_columns(tmp_path: Path) -> None:
    columns = McapRecords.read(of_json(tmp_path / "a.mcap", [{"pixels": [0] * 4096, "q": 1.0}] * 3))
    assert set(columns) == {"/joints.q", "/joints.log_time_s"}


def test_repeated_fields_of_protobuf_messages_are_tables(tmp_path: Path) -> None:
    file = descriptor_pb2.FileDescriptorProto(name="of_others.proto", package="others", syntax="proto3")
    axis = file.message_type.add(name="Axis")
    axis.field.add(name="tau", number=1, type=FIELD.TYPE_DOUBLE, label=FIELD.LABEL_OPTIONAL)
    joints = file.message_type.add(name="Joints")
    joints.field.add(name="q", number=1, type=FIELD.TYPE_DOUBLE, label=FIELD.LABEL_REPEATED)
    joints.field.add(name="name", number=2, type=FIELD.TYPE_STRING, label=FIELD.LABEL_REPEATED)
    joints.field.add(
        name="axes", number=3, type=FIELD.TYPE_MESSAGE, type_name=".others.Axis", label=FIELD.LABEL_REPEATED
    )
    described = descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
    make = message_class_of(described, "others.Joints")
    q = np.random.default_rng(2).standard_normal((20, 2))
    messages = [
        make(q=row.tolist(), name=["a", "b"], axes=[{"tau": one} for one in row]).SerializeToString()
        for row in q
    ]
    path = written(tmp_path / "a.mcap", messages, "protobuf", ("others.Joints", described))
    columns = McapRecords.read(path)
    np.testing.assert_array_equal(columns["/joints.q"], q)
    np.testing.assert_array_equal(columns["/joints.axes.1.tau"], q[:, 1])
    assert set(columns) == {"/joints.q", "/joints.axes.0.tau", "/joints.axes.1.tau", "/joints.log_time_s"}
