"""Cut, damaged, hostile and foreign MCAP files: what can be trusted is read, the rest is told, never a traceback."""

import io
import json
import logging
import struct
import zlib

import lz4.frame
import numpy as np
import pytest
import zstandard
from faults.fault import fault
from mcap.records import Chunk
from mcap.writer import CompressionType, Writer

from robid_core import DataRejected, RecordPlan, RobidError, Trace, assemble_record
from robid_mcap.reader import MOST_BYTES, unpack
from robid_mcap.records import McapRecords


def plan_and_trace():
    plan = RecordPlan(("a", "b"), "test", 1e-3, 1, 1, 2, 3000, np.zeros((1, 2)), np.array([5]))
    generator = np.random.default_rng(2)
    unit = np.full(2, 1e-3)
    position = generator.integers(-(2**20), 2**20, (2, 3000, 2)) * unit
    torque = generator.integers(-1000, 1000, (2, 3000, 2)) * unit
    reference = generator.integers(-1000, 1000, (3000, 2)) * unit
    trace = Trace(position, torque, np.ones((2, 3000), bool), np.zeros(2), reference, 0.0, unit, unit, unit)
    return plan, trace


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A log of one experiment and its bytes."""
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    plan, trace = plan_and_trace()
    log = McapRecords.create(path)
    log.attach("robot.yaml", "application/yaml", b"name: test\n")
    log.plan(plan)
    log.trace((0, 0, 0), "x", trace)
    log.close(complete=True)
    return path.read_bytes(), assemble_record(plan, {(0, 0, 0): trace})


def read(path, data, caplog):
    path.write_bytes(data)
    caplog.clear()
    with caplog.at_level(logging.WARNING, logger="robid.mcap"):
        record = McapRecords.read_record(path)
    return record, caplog.text


def assert_no_wrong_sample(record, truth):
    """Whatever counts as valid is what was measured."""
    valid = record.run.valid
    for name in truth.run.channels:
        np.testing.assert_array_equal(record.run.values(name)[valid], truth.run.values(name)[valid])


def test_A01_file_cut_anywhere_gives_every_whole_chunk_and_says_what_is_missing(whole, tmp_path, caplog):
    data, truth = whole
    counts, refused = [], 0
    for cut in sorted({*range(0, len(data), 997), *range(0, 400, 7), *range(len(data) - 60, len(data), 5)}):
        try:
            record, told = read(tmp_path / "cut.mcap", data[:cut], caplog)
        except DataRejected:
            refused = cut
            continue
        assert_no_wrong_sample(record, truth)
        counts.append(int(record.run.valid.sum()))
        if counts[-1] < truth.run.valid.sum():
            assert f"recovered {counts[-1]} of 6000 samples" in told
        assert "A01" in told or cut > len(data) - 10  # the end mark's last bytes carry nothing
    assert refused < 1000  # only where the plan itself is cut off
    (tmp_path / "cut.mcap").write_bytes(data[:refused])
    with pytest.raises(DataRejected, match="A01"):
        McapRecords.read_record(tmp_path / "cut.mcap")
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[-1] == 6000
    assert len(set(counts)) > 3  # chunk by chunk


def test_A02_flipped_bits_never_pass_as_samples(whole, tmp_path, caplog):
    data, truth = whole
    generator = np.random.default_rng(4)
    outcomes = set()
    for _ in range(150):
        damaged = bytearray(data)
        damaged[generator.integers(8, len(data))] ^= 1 << generator.integers(8)
        try:
            record, told = read(tmp_path / "flip.mcap", bytes(damaged), caplog)
        except RobidError:
            outcomes.add("refused")
            continue
        assert_no_wrong_sample(record, truth)
        complete = bool(record.run.valid.all())
        outcomes.add(complete)
        assert complete or told
    assert False in outcomes  # chunks were rejected


def test_A02_rejected_chunk_is_told_with_its_times_and_costs_only_itself(whole, tmp_path, caplog):
    data, truth = whole
    chunks = [i for i in range(len(data)) if data[i] == 6 and data[i + 3 : i + 9] == bytes(6)]
    start = next(i for i in chunks if 2000 < struct.unpack_from("<Q", data, i + 1)[0] < 70_000 and i > 5000)
    damaged = bytearray(data)
    damaged[start + 600] ^= 0x10
    record, told = read(tmp_path / "flip.mcap", bytes(damaged), caplog)
    assert_no_wrong_sample(record, truth)
    assert "A02: chunk" in told
    assert " s to " in told
    assert 0 < record.run.valid.sum() < 6000


def test_A02_damage_outside_the_chunks_is_seen_by_the_checksum_over_all(whole, tmp_path):
    data, _ = whole
    where = data.index(b"application/yaml")
    damaged = data[:where] + b"a" + b"q" + data[where + 2 :]
    (tmp_path / "x.mcap").write_bytes(damaged)
    assert any("A02" in line for line in McapRecords.describe(tmp_path / "x.mcap"))


@fault(
    "A02",
    sees="the checksum over the summary does not fit; nothing is taken from the summary, so that numbers are right",
    mutant=(
        "adapters/robid_mcap/reader.py",
        "                    _check_summary(file.read(MOST_BYTES), problems)",
        "                    continue",
    ),
)
def test_damage_behind_the_data_is_told_and_changes_nothing(whole, tmp_path, caplog):
    """Found by `tests/fuzz/run.py mcap_log`: a channel of the summary with another schema changed what was read."""
    data, truth = whole
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    sound = McapRecords.read(path)
    start = data.rindex(b"robid.AxisSample")  # the schema, once more
    for place in range(start - 20, len(data) - 8, 131):
        damaged = data[:place] + bytes([data[place] ^ 0x01]) + data[place + 1 :]
        record, told = read(path, damaged, caplog)
        assert_no_wrong_sample(record, truth)
        assert record.run.valid.all()
        assert "A02: the checksum over the summary does not fit" in told
        assert McapRecords.read(path).keys() == sound.keys()


@fault(
    "A02",
    sees="exit 5: the plan of the record is damaged, in `robid records recover` too; bring the file back from a copy",
    mutant=("adapters/robid_mcap/records.py", 'raise ValueError("it does not fit its hash")', "pass"),
)
def test_a_damaged_plan_is_refused(whole, tmp_path):
    data, _ = whole
    place = data.index(b'"n_period": 2')
    path = tmp_path / "x.mcap"
    path.write_bytes(data[: place + 12] + b"1" + data[place + 13 :])
    with pytest.raises(DataRejected, match=r"A02: .*x\.mcap: the plan of the record is damaged"):
        McapRecords.read_record(path)


def record_bytes(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def chunk_bytes(content, size, compression=b"zstd", crc=1):
    head = struct.pack("<QQQI", 0, 0, size, crc) + struct.pack("<I", len(compression)) + compression
    return record_bytes(6, head + struct.pack("<Q", len(content)) + content)


MAGIC = b"\x89MCAP0\r\n"


def hostile_files():
    bomb = zstandard.compress(bytes(3 * MOST_BYTES))
    small = zstandard.compress(bytes(1000))
    return {
        "chunk that states an enormous size": chunk_bytes(bomb, 2**40),
        "chunk that unpacks to more than it states": chunk_bytes(bomb, 1000),
        "chunk that unpacks to less than it states": chunk_bytes(small, 2000),
        "chunk of noise": chunk_bytes(b"\x17" * 500, 500),
        "chunk with an unknown compression": chunk_bytes(small, 1000, b"rar"),
        "chunk with a record that is longer than itself": chunk_bytes(
            record_bytes(5, bytes(40))[:30], 30, b"", zlib.crc32(record_bytes(5, bytes(40))[:30])
        ),
        "record of an enormous length": struct.pack("<BQ", 5, 2**60),
        "string of an enormous length": record_bytes(3, struct.pack("<HI", 1, 2**31) + b"abc"),
        "metadata of an enormous length": record_bytes(
            12, struct.pack("<I", 1) + b"x" + struct.pack("<I", 2**31)
        ),
        "attachment of an enormous length": record_bytes(9, struct.pack("<QQI", 0, 0, 2**32 - 1)),
        "record that nobody knows": record_bytes(200, b"abc"),
        "empty record of every kind": b"".join(record_bytes(kind, b"") for kind in range(1, 16)),
    }


@pytest.mark.parametrize("name", list(hostile_files()))
def test_A04_hostile_file_is_told_and_not_followed(name, tmp_path):
    path = tmp_path / "hostile.mcap"
    path.write_bytes(MAGIC + hostile_files()[name])
    lines = McapRecords.describe(path)
    assert any(line.startswith("A0") for line in lines)
    with pytest.raises(DataRejected):
        McapRecords.read_record(path)


@pytest.mark.parametrize(
    ("compress", "name"), [(zstandard.compress, "zstd"), (lz4.frame.compress, "lz4"), (bytes, "")]
)
@pytest.mark.parametrize("stated", [999, 1001, MOST_BYTES + 1, 2**60])
def test_A04_chunk_is_unpacked_to_the_size_that_it_states_or_not_at_all(compress, name, stated):
    content = compress(bytes(1000))
    assert unpack(Chunk(name, content, 0, 0, 0, 1000)) == bytes(1000)
    with pytest.raises(ValueError, match="A04" if stated > MOST_BYTES else "bytes, it states"):
        unpack(Chunk(name, content, 0, 0, 0, stated))


def test_traces_that_are_not_in_the_plan_are_told_and_left_out(tmp_path, caplog):
    plan, trace = plan_and_trace()
    log = McapRecords.create(tmp_path / "a.mcap")
    log.plan(plan)
    log.trace((0, 0, 0), "x", trace)
    log.trace((0, 3, 0), "y", trace)
    log.close(complete=True)
    with caplog.at_level(logging.WARNING, logger="robid.mcap"):
        record = McapRecords.read_record(tmp_path / "a.mcap")
    assert record.run.valid.all()
    assert "experiment (0, 3, 0) is not in the plan" in caplog.text


def test_A03_foreign_file_without_checksums_is_read_with_a_warning(tmp_path):
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file, enable_crcs=False, compression=CompressionType.LZ4)
        writer.start()
        schema = writer.register_schema("thing", "jsonschema", b"{}")
        channel = writer.register_channel("/thing", "json", schema)
        for k in range(3):
            data = json.dumps({"a": {"b": k, "text": "x"}, "on": True}).encode()
            writer.add_message(channel, k * 10**9, data, 0)
        writer.finish()
    assert any("A03" in line for line in McapRecords.describe(path))
    channels = McapRecords.read(path)
    np.testing.assert_array_equal(channels["/thing.a.b"], [0, 1, 2])
    np.testing.assert_array_equal(channels["/thing.log_time_s"], [0, 1, 2])
    np.testing.assert_array_equal(channels["/thing.on"], [1, 1, 1])


def test_foreign_protobuf_with_imports_and_nested_messages_is_decoded(tmp_path):
    from google.protobuf import descriptor_pb2, timestamp_pb2

    file = descriptor_pb2.FileDescriptorProto(name="p.proto", package="p", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    message = file.message_type.add(name="Joint")
    message.field.add(name="stamp", number=1, type=11, label=1, type_name=".google.protobuf.Timestamp")
    message.field.add(name="angle", number=2, type=1, label=1)
    message.field.add(name="many", number=3, type=1, label=3)
    imported = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(imported)
    schema_data = descriptor_pb2.FileDescriptorSet(file=[file, imported]).SerializeToString()
    # field 1: message {field 1: varint 7}; field 2: fixed64 1.5; field 3: packed doubles
    wire = b"\x0a\x02\x08\x07" + b"\x11" + struct.pack("<d", 1.5) + b"\x1a\x08" + struct.pack("<d", 9.0)
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start()
        channel = writer.register_channel(
            "/j", "protobuf", writer.register_schema("p.Joint", "protobuf", schema_data)
        )
        odd = writer.register_channel(
            "/odd", "protobuf", writer.register_schema("p.No", "protobuf", b"\xff\xff")
        )
        raw = writer.register_channel("/raw", "ros1", 0)
        writer.add_message(channel, 10**9, wire, 0)
        writer.add_message(channel, 2 * 10**9, b"\xff\xff", 0)  # cannot be decoded
        writer.add_message(odd, 0, b"abc", 0)
        writer.add_message(raw, 0, b"abc", 0)
        writer.finish()
    channels = McapRecords.read(path)
    assert set(channels) == {"/j.log_time_s", "/j.stamp.seconds", "/j.stamp.nanos", "/j.angle", "/j.many"}
    assert channels["/j.stamp.seconds"].tolist() == [7.0]
    assert channels["/j.angle"].tolist() == [1.5]
    assert channels["/j.many"].tolist() == [[9.0]]


def test_file_without_any_number_is_refused(tmp_path):
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start()
    writer.finish()
    (tmp_path / "empty.mcap").write_bytes(stream.getvalue())
    with pytest.raises(DataRejected, match="no channel has numbers"):
        McapRecords.read(tmp_path / "empty.mcap")
    with pytest.raises(DataRejected, match="plan of a record is not in the file"):
        McapRecords.read_record(tmp_path / "empty.mcap")


@pytest.mark.full
def test_A01_file_cut_at_every_byte(whole, tmp_path, caplog):
    data, truth = whole
    for cut in range(len(data)):
        try:
            record, _ = read(tmp_path / "cut.mcap", data[:cut], caplog)
        except DataRejected:
            continue
        assert_no_wrong_sample(record, truth)
