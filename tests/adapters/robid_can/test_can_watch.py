"""The host's watch and preflight, fed with handwritten frames."""

import can
import pytest

from robid_can.host.link import SEND_TIMEOUT_S
from robid_can.host.watch import OPERATIONAL, SILENCE_S
from robid_core import MotionAborted, MotionRefused


@pytest.fixture
def watched(scripted):
    """A link whose two nodes were operational a moment ago."""
    scripted.bus.arrive("701#05", "702#05")
    scripted.link.collect()
    scripted.link.watch.expected_state = OPERATIONAL
    scripted.link.moving = True
    return scripted


def test_living_nodes_raise_nothing(watched):
    for _ in range(10):
        watched.bus.arrive("701#05", "702#05")
        watched.link.wait(0.1)


def test_B07_silent_node_is_told_within_the_heartbeat_timeout(watched):
    def hear_node_1_only():
        for _ in range(20):
            watched.bus.arrive("701#05")
            watched.link.wait(0.05)

    with pytest.raises(MotionAborted, match=r"B07: axis_2 \(node 2\) has been silent for 350 ms"):
        hear_node_1_only()
    assert watched.clock.time <= SILENCE_S + 0.05 + 1e-9


@pytest.mark.parametrize("code", ["10 23", "20 32", "10 43", "30 81", "11 86"])  # 0x2310, 0x3220, ...
def test_B08_emergency_message_aborts_with_code_and_bytes(watched, code):
    watched.bus.arrive(f"081#{code} 09 01 02 03 04 05")
    low, high = code.split()
    with pytest.raises(
        MotionAborted, match=f"B08: axis_1 .node 1. sent EMCY 0x{high}{low}, error register 0x09"
    ):
        watched.link.wait(0.01)


def test_error_reset_is_no_emergency(watched):
    watched.bus.arrive("081#00 00 00 00 00 00 00 00")
    watched.link.wait(0.01)


@pytest.mark.parametrize(
    ("frame", "what"), [("701#", "heartbeat"), ("701#05 00", "heartbeat"), ("081#10", "EMCY")]
)
def test_B09_malformed_frame_stops_the_run(watched, frame, what):
    watched.bus.arrive(frame)
    with pytest.raises(MotionAborted, match=f"B09: axis_1 .* malformed {what}"):
        watched.link.wait(0.01)


def test_B15_heartbeat_of_a_stranger_or_of_a_second_host_stops_the_run(watched):
    watched.bus.arrive("709#05")
    with pytest.raises(MotionAborted, match="B15: a heartbeat of a foreign node 9"):
        watched.link.wait(0.01)
    watched.bus.arrive("77f#05")
    with pytest.raises(MotionAborted, match="B15: a heartbeat of a foreign node 127"):
        watched.link.wait(0.01)


def test_B16_node_that_leaves_operational_or_starts_again_stops_the_run(watched):
    watched.bus.arrive("701#7f")
    with pytest.raises(MotionAborted, match="B16: axis_1 .* NMT state 0x7F"):
        watched.link.wait(0.01)
    watched.bus.arrive("702#00")
    with pytest.raises(MotionAborted, match="B16: axis_2 .* started again"):
        watched.link.wait(0.01)


def test_failures_before_the_first_motion_are_refusals(watched):
    watched.link.moving = False
    watched.bus.arrive("081#10 23 01 00 00 00 00 00")
    with pytest.raises(MotionRefused, match="nothing has moved"):
        watched.link.wait(0.01)


def test_host_sends_its_own_heartbeat_every_tenth_of_a_second(scripted):
    scripted.link.start_heartbeat()
    for _ in range(100):
        scripted.link.wait(0.01)
    beats = scripted.bus.sent.count("77f#05")
    assert 9 <= beats <= 11
    scripted.link.stop_heartbeat()
    scripted.link.wait(1.0)
    assert scripted.bus.sent.count("77f#05") == beats


def test_B11_bus_that_takes_no_frames_is_an_error_and_sending_never_waits_for_ever(scripted, monkeypatch):
    waited = []

    def refuse(message, timeout=None):
        waited.append(timeout)
        raise can.CanOperationError("transmit buffer full")

    monkeypatch.setattr(scripted.bus, "send", refuse)
    with pytest.raises(MotionRefused, match="B11: the bus does not take frames"):
        scripted.link.send_message(0x601, bytes(8))
    assert waited == [SEND_TIMEOUT_S]


def test_B06_error_frame_stops_the_run(watched):
    watched.bus.inbox.append(can.Message(is_error_frame=True))
    with pytest.raises(MotionAborted, match="B06"):
        watched.link.wait(0.01)
