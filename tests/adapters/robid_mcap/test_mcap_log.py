"""The raw log: what is written is read back the same, the same input gives the same bytes, others can open it."""

import gzip
import io
import os

import numpy as np
import pytest
from mcap.reader import make_reader

from robid_core import DataRejected, MotionAborted, RecordPlan, StoreError, Trace, assemble_record
from robid_mcap.arrays import Packed, pack, unpack
from robid_mcap.records import McapRecords
from robid_mcap.schema import message_class
from robid_mcap.writer import CHUNK_BYTES, MESSAGE_BYTES

UNIT = 2 * np.pi / 2**20


@pytest.fixture
def plan():
    return RecordPlan(
        axis_names=("axis_1", "axis_2"),
        source="test",
        sample_time_s=1e-3,
        n_block=1,
        n_exp=2,
        n_period=2,
        n_sample=700,
        angle=np.array([[0.1, -0.2], [1 / 3, np.pi]]),
        line=np.array([3, 7], dtype=np.int64),
    )


def traces_of(plan, *, increments=True, seed=0):
    generator = np.random.default_rng(seed)
    shape = (plan.n_period, plan.n_sample, len(plan.axis_names))
    found = {}
    for place in np.ndindex(len(plan.angle), plan.n_block, plan.n_exp):
        position = generator.integers(-(2**30), 2**30, shape)
        torque = generator.integers(-(2**15), 2**15, shape)
        reference = generator.integers(-(2**30), 2**30, shape[1:])
        valid = generator.random(shape[:2]) > 0.01
        units = np.array([UNIT, 2 * UNIT]), np.array([1e-4, 3e-4]), np.array([1e-6, 1e-6])
        time_s = 10.0 * sum(place)
        if increments:
            values = (count * unit for count, unit in zip((position, torque, reference), units, strict=True))
            q, u, v = values
            found[place] = Trace(q, u, valid, np.zeros(2), v, time_s, *units)
        else:
            values = (generator.standard_normal(x.shape) for x in (position, torque, reference))
            q, u, v = values
            found[place] = Trace(q, u, valid, np.zeros(2), v, time_s)
    return found


def write(path, plan, traces, complete=True):
    log = McapRecords.create(path)
    log.attach("robot.yaml", "application/yaml", b"name: test\n")
    log.plan(plan)
    log.event(0.0, "2 drives are enabled")
    for place, trace in traces.items():
        log.frame(trace.time_s, 0x701, b"\x05")
        log.bulk(trace.time_s, "upload", 12, 84)
        log.trace(place, f"experiment {place}", trace)
    log.close(complete)
    return path


def assert_same_record(left, right):
    assert left.axis_names == right.axis_names
    assert (left.source, left.torque_hold) == (right.source, right.torque_hold)
    np.testing.assert_array_equal(left.angle, right.angle)
    np.testing.assert_array_equal(left.line, right.line)
    np.testing.assert_array_equal(left.run.valid, right.run.valid)
    assert sorted(left.run.channels) == sorted(right.run.channels)
    for name, channel in left.run.channels.items():
        assert channel.values.tobytes() == right.run.channels[name].values.tobytes()  # to the bit


@pytest.mark.parametrize("increments", [True, False])
def test_record_made_from_the_log_is_the_one_that_was_measured(tmp_path, plan, increments):
    traces = traces_of(plan, increments=increments)
    path = write(tmp_path / "a.mcap", plan, traces)
    assert_same_record(McapRecords.read_record(path), assemble_record(plan, traces))


def test_written_files_of_both_records_are_identical(tmp_path, plan):
    traces = traces_of(plan)
    path = write(tmp_path / "a.mcap", plan, traces)
    McapRecords.read_record(path).write(tmp_path / "again.h5")
    assemble_record(plan, traces).write(tmp_path / "first.h5")
    assert (tmp_path / "again.h5").read_bytes() == (tmp_path / "first.h5").read_bytes()


def test_same_motion_gives_the_same_bytes(tmp_path, plan):
    first = write(tmp_path / "a.mcap", plan, traces_of(plan)).read_bytes()
    assert write(tmp_path / "b.mcap", plan, traces_of(plan)).read_bytes() == first
    assert write(tmp_path / "c.mcap", plan, traces_of(plan, seed=1)).read_bytes() != first


def test_increments_take_six_bytes_a_sample_and_values_sixteen(tmp_path, plan):
    n_sample = 4 * plan.n_period * plan.n_sample * 2
    packed = write(tmp_path / "a.mcap", plan, traces_of(plan)).stat().st_size
    plain = write(tmp_path / "b.mcap", plan, traces_of(plan, increments=False)).stat().st_size
    assert packed < plain < 30 * n_sample
    assert packed < 10 * n_sample + 30_000  # random increments do not compress; scalars for plots beside


def test_file_is_a_part_until_it_is_complete(tmp_path, plan):
    path = tmp_path / "log" / "a.mcap"
    log = McapRecords.create(path)
    assert [file.name for file in path.parent.iterdir()] == ["a.mcap.part"]
    log.plan(plan)
    log.close(complete=True)
    log.close(complete=False)  # closing twice does nothing
    assert [file.name for file in path.parent.iterdir()] == ["a.mcap"]


def test_broken_off_log_keeps_its_part_and_is_readable(tmp_path, plan):
    traces = traces_of(plan)
    first = dict(list(traces.items())[:1])
    path = write(tmp_path / "a.mcap", plan, first, complete=False)
    assert not path.exists()
    record = McapRecords.read_record(path.with_name("a.mcap.part"))
    assert_same_record(record, assemble_record(plan, first))
    assert np.isnan(record.run.values("motor_position")[1]).all()
    assert not record.run.valid[1].any()


def test_whole_chunks_are_in_the_file_before_it_is_closed(tmp_path, plan):
    log = McapRecords.create(tmp_path / "a.mcap")
    log.plan(plan)
    traces = traces_of(plan)
    for place, trace in traces.items():
        log.trace(place, "x", trace)
    # The run is killed here: nothing of this process reaches the file any more.
    record = McapRecords.read_record(tmp_path / "a.mcap.part")
    whole = assemble_record(plan, traces)
    missing = (~record.run.valid & whole.run.valid).sum()
    assert missing * 6 * 2 <= CHUNK_BYTES + MESSAGE_BYTES  # at most what the open chunk held
    log.close(complete=True)


def test_chunks_stay_below_64_kib(tmp_path, plan):
    path = write(tmp_path / "a.mcap", plan, traces_of(plan, increments=False))
    summary = make_reader(io.BytesIO(path.read_bytes())).get_summary()
    assert len(summary.chunk_indexes) > 3
    assert max(index.uncompressed_size for index in summary.chunk_indexes) <= 64 * 1024


def test_readers_of_others_find_scalars_with_their_unit_in_the_name(tmp_path, plan):
    traces = traces_of(plan)
    path = write(tmp_path / "a.mcap", plan, traces)
    reader = make_reader(io.BytesIO(path.read_bytes()), validate_crcs=True)
    cls = message_class("robid.AxisSample")
    samples = [
        (message.log_time, cls.FromString(message.data))
        for schema, channel, message in reader.iter_messages(topics=["/axis_2"])
    ]
    assert len(samples) == 4 * 70  # 1400 samples at 1 kHz, shown at 50 Hz, of each of 4 experiments
    first = traces[0, 0, 0]
    time_ns, sample = samples[1]
    assert time_ns == 20_000_000
    assert sample.position_rad == first.position[0, 20, 1]
    assert sample.torque_nm == first.torque[0, 20, 1]
    assert sample.speed_reference_rad_s == first.reference[20, 1]
    assert [a.name for a in reader.iter_attachments()] == ["robot.yaml"]


def test_plain_channels_are_read_by_name_with_their_times(tmp_path, plan):
    traces = traces_of(plan)
    channels = McapRecords.read(write(tmp_path / "a.mcap", plan, traces))
    assert {"/axis_1.position_rad", "/axis_1.torque_nm", "/axis_1.log_time_s", "/can/bulk.frames"} <= set(
        channels
    )
    assert channels["/axis_1.log_time_s"].shape == channels["/axis_1.position_rad"].shape
    np.testing.assert_array_equal(
        channels["/axis_1.position_rad"][:70], traces[0, 0, 0].position.reshape(-1, 2)[::20, 0]
    )
    assert set(channels["/can/frames.identifier"].tolist()) == {0x701}


def test_description_tells_channels_attachments_and_nothing_wrong(tmp_path, plan):
    lines = McapRecords.describe(write(tmp_path / "a.mcap", plan, traces_of(plan)))
    assert any(line.startswith("/axis_1: 280 messages, 0.000 s to") for line in lines)
    assert "attachment robot.yaml: 11 bytes, application/yaml" in lines
    assert not any(line.startswith("A0") for line in lines)


def test_A14_disk_that_is_full_stops_the_run_with_a_line(tmp_path, plan, monkeypatch):
    log = McapRecords.create(tmp_path / "a.mcap")
    log.plan(plan)

    def full(data):
        raise OSError(28, "No space left on device")

    traces = traces_of(plan)

    def write_all():
        for place, trace in traces.items():
            log.trace(place, "x", trace)

    write_all()
    monkeypatch.setattr(log._sink, "write", full)
    with pytest.raises(
        MotionAborted, match=r"A14: the raw log .*a\.mcap\.part cannot be written \(No space left"
    ):
        write_all()
    log.close(complete=False)  # what broke it off is told, not that it cannot be finished either
    record = McapRecords.read_record(tmp_path / "a.mcap.part")
    assert record.run.valid[0, 0, 0].sum() > 0  # what was written stays readable


def test_complete_log_that_cannot_be_finished_is_told(tmp_path, plan, monkeypatch):
    log = McapRecords.create(tmp_path / "a.mcap")
    log.plan(plan)
    monkeypatch.setattr(log._sink, "write", lambda data: (_ for _ in ()).throw(OSError(28, "No space left")))
    with pytest.raises(StoreError, match="A14"):
        log.close(complete=True)
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.skipif(os.name != "posix", reason="folders without permission are made differently elsewhere")
def test_folder_that_cannot_be_written_is_a_store_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="A14"):
        McapRecords.create(tmp_path / "file" / "a.mcap")


def test_values_are_packed_as_increments_only_where_nothing_is_lost():
    unit = np.array([0.1, 1e-3])
    exact = np.array([[3, -5], [2, 70_000]]) * unit
    assert pack(exact, unit).type == "<i4"
    assert pack(exact[:1], unit).type == "<i2"
    assert unpack(pack(exact, unit), 2).tobytes() == exact.tobytes()
    for values in (
        exact + 1e-18 * np.array([[0, 0], [1, 1]]) + 1e-9,
        np.array([[np.nan, 0.0]]),
        1e12 * exact,
    ):
        packed = pack(values, unit)
        assert packed.type == "<f8"
        np.testing.assert_array_equal(unpack(packed, 2), values)


@pytest.mark.parametrize(
    "packed", [Packed("<O8", b"", ()), Packed("<i2", b"\0" * 6, ()), Packed("<i2", b"\0" * 4, (1.0,))]
)
def test_packed_values_that_do_not_fit_are_refused(packed):
    with pytest.raises(ValueError, match=r"unknown type|reshape|units"):
        unpack(packed, 2)


def test_file_that_is_no_raw_log_is_refused_as_a_record(tmp_path):
    (tmp_path / "x.mcap").write_bytes(b"not an MCAP file")
    packed = tmp_path / "packed.mcap"
    packed.write_bytes(gzip.compress(b"anything"))
    with pytest.raises(DataRejected, match="packed with gzip; unpack it first"):
        McapRecords.read_record(packed)
    with pytest.raises(DataRejected, match="no MCAP file"):
        McapRecords.read_record(tmp_path / "x.mcap")
    with pytest.raises(StoreError, match="cannot be read"):
        McapRecords.read_record(tmp_path / "absent.mcap")
