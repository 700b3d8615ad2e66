"""A small sound file of each format that is read, written anew by the library that writes it."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import scipy.io

N = 200
TIME = np.arange(N) * 0.001
ANGLE = np.sin(2 * np.pi * 5 * TIME)[:, None] * np.array([1.0, 0.5])
TORQUE = 3.0 * np.cos(2 * np.pi * 5 * TIME)


def write_csv(path: Path) -> None:
    """A table with a header."""
    rows = (f"{t:.3f},{q:.6f},{u:.6f}" for t, q, u in zip(TIME, ANGLE[:, 0], TORQUE, strict=True))
    path.write_text("\n".join(["time,q,torque", *rows]) + "\n")


def write_json(path: Path) -> None:
    """A log whose entries stand beside constants."""
    entries = [
        {"t": t, "q": q, "u": u}
        for t, q, u in zip(TIME.tolist(), ANGLE.tolist(), TORQUE.tolist(), strict=True)
    ]
    path.write_text(json.dumps({"mass": 0.5, "entries": entries}))


def write_npz(path: Path) -> None:
    """Plain arrays, one of them packed."""
    np.savez_compressed(path, t=TIME, q=ANGLE, counts=np.arange(7, dtype=np.int16))


def write_npz_plain(path: Path) -> None:
    """Plain arrays as they are."""
    np.savez(path, t=TIME, q=ANGLE, u=TORQUE)


def _variables() -> dict[str, object]:
    return {
        "t": TIME,
        "q": ANGLE,
        "gain": 2.5,
        "name": "robot",
        "rec": {"u": TORQUE, "drive": {"on": np.ones(5)}},
    }


def write_mat_packed(path: Path) -> None:
    """A MATLAB file (v7) with packed variables, a structure among them."""
    scipy.io.savemat(path, _variables(), do_compression=True)


def write_mat_plain(path: Path) -> None:
    """A MATLAB file (v6), as it is."""
    scipy.io.savemat(path, _variables(), do_compression=False)


def write_mat_hdf5(path: Path) -> None:
    """A MATLAB file (v7.3): HDF5 with a structure, and an array of structures by references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"t": TIME[None], "q": ANGLE.T}.items():
            file[name] = values
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        group = file.create_group("rec")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        group.create_dataset("u", data=TORQUE[None], chunks=(1, 50), compression="gzip")
        group["u"].attrs["MATLAB_class"] = np.bytes_("double")
        references = file.create_group("#refs#")
        cells = file.create_dataset("cells", (2, 1), dtype=h5py.ref_dtype)
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
        for index in range(2):
            references[f"{index}"] = np.arange(4.0)[None]
            references[f"{index}"].attrs["MATLAB_class"] = np.bytes_("double")
            cells[index, 0] = references[f"{index}"].ref


def write_hdf5(path: Path) -> None:
    """Data sets as a logger leaves them: plain, packed with a checksum, a table, a text of variable length."""
    with h5py.File(path, "w") as file:
        file["drive/position"] = ANGLE
        file.create_dataset("drive/torque", data=TORQUE, chunks=(64,), compression="gzip", fletcher32=True)
        table = np.zeros(20, dtype=[("t", "f8"), ("q", "f4")])
        file["table"] = table
        file["note"] = "a text of variable length"


def write_parquet(path: Path) -> None:
    """Columns with a list among them."""
    import pyarrow
    import pyarrow.parquet

    table = pyarrow.table({"t": TIME, "q": ANGLE.tolist(), "u": TORQUE})
    pyarrow.parquet.write_table(table, path, write_page_checksum=True, row_group_size=100)


def _joint_states(
    writer: object, store: object, add: Callable[[object, int, bytes], None], connection: object
) -> None:
    types = store.types  # type: ignore[attr-defined]
    header, time, state = (
        types[f"{name}"]
        for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "sensor_msgs/msg/JointState")
    )
    for index in range(30):
        fields = {"stamp": time(sec=index // 1000, nanosec=index * 1_000_000), "frame_id": ""}
        if "seq" in header.__dataclass_fields__:
            fields["seq"] = index
        message = state(
            header=header(**fields),
            name=["a", "b"],
            position=ANGLE[index].copy(),
            velocity=np.zeros(2),
            effort=np.ones(2),
        )
        add(connection, index * 1_000_000 + 1, message)  # type: ignore[arg-type]


def write_bag_1(path: Path) -> None:
    """A bag of ROS 1 with joint states."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        connection = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        _joint_states(
            writer,
            store,
            lambda one, at, message: writer.write(
                one, at, store.serialize_ros1(message, "sensor_msgs/msg/JointState")
            ),  # type: ignore[arg-type]
            connection,
        )


def write_bag_folder(folder: Path, storage: str = "SQLITE3") -> None:
    """A bag of ROS 2 as it is recorded: a folder, its description and one file of messages."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        connection = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        _joint_states(
            writer,
            store,
            lambda one, at, message: writer.write(
                one, at, store.serialize_cdr(message, "sensor_msgs/msg/JointState")
            ),  # type: ignore[arg-type]
            connection,
        )


def _write_bag_2(path: Path, storage: str) -> None:
    import shutil

    folder = path.with_name(path.name + ".folder")
    shutil.rmtree(folder, ignore_errors=True)
    write_bag_folder(folder, storage)
    made = next(file for file in folder.iterdir() if file.suffix in (".db3", ".mcap"))
    if storage == "SQLITE3":
        with sqlite3.connect(made) as database:
            database.execute("PRAGMA user_version")
    shutil.copyfile(made, path)
    shutil.rmtree(folder)


def write_bag_2(path: Path) -> None:
    """The data base of a bag of ROS 2."""
    _write_bag_2(path, "SQLITE3")


def write_bag_mcap(path: Path) -> None:
    """The MCAP file of a bag of ROS 2."""
    _write_bag_2(path, "MCAP")


def write_mcap_foreign(path: Path) -> None:
    """A log of another writer: JSON messages, a protobuf schema that is ours."""
    from mcap.writer import CompressionType, Writer

    from robid_mcap.schema import descriptor_set, message_class

    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4, chunk_size=2000, enable_data_crcs=True)
        writer.start()
        channel = writer.register_channel(
            "/thing", "json", writer.register_schema("thing", "jsonschema", b"{}")
        )
        schema = writer.register_schema("robid.AxisSample", "protobuf", descriptor_set().SerializeToString())
        axis = writer.register_channel("/axis", "protobuf", schema)
        for k in range(60):
            writer.add_message(channel, k * 10**6, json.dumps({"a": {"b": k}, "on": True}).encode(), 0)
            content = message_class("robid.AxisSample")(
                position_rad=0.1 * k, torque_nm=1.0
            ).SerializeToString()
            writer.add_message(axis, k * 10**6, content, 0)
        writer.finish()


def write_mcap_log(path: Path) -> None:
    """A raw log of ours with a plan and two experiments."""
    from robid_core import RecordPlan, Trace
    from robid_mcap.records import McapRecords

    generator = np.random.default_rng(3)
    plan = RecordPlan(
        axis_names=("a", "b"), source="test", sample_time_s=0.001, n_block=1, n_exp=2, n_period=2, n_sample=100,
        angle=np.zeros((1, 2)), line=np.array([1, 3]),
    )  # fmt: skip
    log = McapRecords.create(path)
    log.attach("robot.yaml", "application/yaml", b"name: x\n" * 20)
    log.plan(plan)
    for experiment in range(2):
        shape = (2, 100, 2)
        trace = Trace(
            position=generator.normal(size=shape), torque=generator.normal(size=shape), valid=np.ones(shape[:2], bool),
            saturated=np.zeros(2), reference=generator.normal(size=shape[1:]), time_s=float(experiment),
        )  # fmt: skip
        log.trace((0, 0, experiment), f"experiment {experiment}", trace)
    log.close(complete=True)


# name: suffix, reader, writer; `True` where checksums let no damage pass that nobody tells
SAMPLES: dict[str, tuple[str, str, Callable[[Path], None], bool]] = {
    "csv": (".csv", "csv", write_csv, False),
    "json": (".json", "json", write_json, False),
    "npz": (".npz", "npz", write_npz, True),
    "npz_plain": (".npz", "npz", write_npz_plain, True),
    "mat_packed": (".mat", "mat", write_mat_packed, True),
    "mat_plain": (".mat", "mat", write_mat_plain, False),
    "mat_hdf5": (".mat", "mat", write_mat_hdf5, False),
    "hdf5": (".h5", "hdf5", write_hdf5, False),
    "parquet": (".parquet", "parquet", write_parquet, False),
    "bag_1": (".bag", "rosbag", write_bag_1, False),
    "bag_2": (".db3", "rosbag", write_bag_2, False),
    "bag_mcap": (".mcap", "rosbag", write_bag_mcap, True),
    "mcap_foreign": (".mcap", "mcap", write_mcap_foreign, True),
    "mcap_log": (".mcap", "mcap", write_mcap_log, True),
}
