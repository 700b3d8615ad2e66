"""Scales and frames, against numbers worked out by hand from the standards."""

import can
import numpy as np
import pytest

from robid_can import dictionary as od
from robid_can.frame import Burst, Frame, VirtualEnd, worst_case_bits
from robid_core import ConfigurationError


@pytest.mark.parametrize(
    ("code", "unit"),
    [
        (0xFA100300, 1e-6),  # virtual drive: 10^-6 rad/s
        (0x00B44700, 2 * np.pi / 60),  # EPOS4: revolutions per minute
        (0xFDB44700, 2 * np.pi / 60e3),  # and thousandths of it
        (0x00100300, 1.0),
    ],
)
def test_velocity_unit_is_read_from_the_drive(code, unit):
    assert od.velocity_unit(code) == pytest.approx(unit, rel=1e-12)


def test_velocity_unit_that_nobody_knows_is_refused():
    with pytest.raises(ConfigurationError, match="0x00010300"):
        od.velocity_unit(0x00010300)  # metres per second


def test_scale_of_a_drive_is_increments_per_turn_and_rated_torque():
    scale = od.Scale.read(
        {(0x608F, 1): 4096, (0x608F, 2): 1, (0x60A9, 0): 0xFA100300, (0x6076, 0): 2000, (0x2102, 5): 10_000}
    )
    assert scale.position == pytest.approx(2 * np.pi / 4096)
    assert scale.torque == pytest.approx(2e-4)  # 2 N m rated, in ten thousandths


def test_drive_that_was_never_commissioned_is_refused():
    values = dict.fromkeys(od.SCALE_OBJECTS, 0) | {od.VELOCITY_UNIT: 0xFA100300}
    with pytest.raises(ConfigurationError, match="commission"):
        od.Scale.read(values)


def test_increments_are_within_half_of_one_and_do_not_wrap_around():
    values = np.random.default_rng(1).uniform(-1, 1, 1000)
    assert np.abs(od.increments(values, 1e-3, np.int32) * 1e-3 - values).max() <= 0.5e-3 * (1 + 1e-12)
    assert od.increments(np.array([1e9, -1e9]), 1e-3, np.int16).tolist() == [32767, -32768]


def test_trace_row_is_six_bytes_without_padding():
    assert od.TRACE_ROW.itemsize == 6


def test_packaged_dictionary_has_every_object_that_the_code_names():
    dictionary = od.virtual_drive_dictionary()
    keys = [value for value in vars(od).values() if isinstance(value, tuple) and len(value) == 2]
    keys = [key for key in keys if all(isinstance(part, int) for part in key)]
    assert len(keys) > 30
    for key in keys:
        assert od.variable(dictionary, key).data_type


@pytest.mark.parametrize(("n_byte", "bits"), [(8, 135), (4, 95), (0, 55)])
def test_worst_case_bits_of_a_frame_are_those_of_the_literature(n_byte, bits):
    assert worst_case_bits(n_byte) == bits


def test_frame_reaches_ends_of_ours_and_of_python_can_unchanged(plain_bus):
    ours, other = VirtualEnd("frames"), VirtualEnd("frames")
    theirs = plain_bus("frames")
    try:
        ours.send(Frame(0x601, b"\x01\x02", 1.5))
        for end in (other, theirs):
            message = end.recv(0)
            assert (message.arbitration_id, bytes(message.data), message.dlc) == (0x601, b"\x01\x02", 2)
            assert message.timestamp == 1.5
            assert not message.is_extended_id
        assert ours.recv(0) is None
        ours.send_burst(Burst(0x602, (b"\x03", b"\x04\x05"), 2.5))
        assert other.receive() == Burst(0x602, (b"\x03", b"\x04\x05"), 2.5)
        ours.send_burst(Burst(0x602, (b"\x03", b"\x04\x05"), 2.5))
        for end in (other, theirs):
            frames = [end.recv(0) for _ in range(2 if end is other else 4)]
            assert [bytes(frame.data) for frame in frames[-2:]] == [b"\x03", b"\x04\x05"]
            assert {(frame.arbitration_id, frame.timestamp) for frame in frames} == {(0x602, 2.5)}
            assert end.recv(0) is None
        theirs.send(can.Message(arbitration_id=0x581, data=[9], is_extended_id=False))
        assert bytes(ours.recv(0).data) == b"\x09"
    finally:
        ours.shutdown()
        other.shutdown()
