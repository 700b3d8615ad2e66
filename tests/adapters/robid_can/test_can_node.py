"""One virtual drive, spoken to in bytes: NMT, heartbeat, EMCY, and its objects."""

import pytest
from hypothesis import given, settings, strategies as st

from robid_can.drive import DriveNode
from robid_can.drive.state_machine import State


class StillAxis:
    """A motor that only notes what it is asked."""

    def __init__(self):
        self.angle, self.speed, self.moving, self.asked = 0.0, 0.0, False, []

    def move_to(self, angle, speed):
        self.asked.append((angle, speed))

    def halt(self):
        self.asked.append("halt")


@pytest.fixture
def node(nameplate):
    return make_node(nameplate)


def make_node(nameplate):
    said = []
    node = DriveNode(5, nameplate, StillAxis(), 1e-3, lambda i, ps: said.extend((i, p.hex(" ")) for p in ps))
    node.said = said
    return node


def write(node, request):
    node.said.clear()
    node.request([bytes.fromhex(request)])
    return node.said[-1]


OK = (0x585, "60")


def obey(node, *controlwords):
    for controlword in controlwords:
        identifier, answer = write(node, f"2b 40 60 00 {controlword:02x} 00 00 00")
        assert (identifier, answer[:2]) == OK


def test_boot_up_message_is_a_heartbeat_of_zero(node):
    assert node.said == [(0x705, "00")]


@pytest.mark.parametrize(
    ("command", "state"),
    [("01 05", "05"), ("01 00", "05"), ("80 05", "7f"), ("02 05", "04"), ("01 06", "7f")],
)
def test_heartbeat_shows_the_state_that_network_management_commands(node, command, state):
    write(node, "2b 17 10 00 64 00 00 00")  # every 100 ms
    node.command(bytes.fromhex(command), 0)
    node.said.clear()
    for now_us in range(0, 1_000_000, 10_000):
        node.act(now_us)
    assert node.said == [(0x705, state)] * 10


def test_reset_of_communication_boots_again_without_heartbeat(node):
    write(node, "2b 17 10 00 64 00 00 00")
    node.said.clear()
    node.command(bytes.fromhex("82 00"), 0)
    node.act(1_000_000)
    assert node.said == [(0x705, "00")]


def test_stopped_node_answers_no_sdo(node):
    node.command(bytes.fromhex("02 00"), 0)
    node.said.clear()
    node.request([bytes.fromhex("40 41 60 00 00 00 00 00")])
    assert node.said == []


def test_controlword_walks_the_drive_up_and_the_statusword_shows_it(node):
    assert write(node, "40 41 60 00 00 00 00 00")[1].startswith("4b 41 60 00 40")
    obey(node, 0x06)
    assert write(node, "40 41 60 00 00 00 00 00")[1].startswith("4b 41 60 00 21")
    obey(node, 0x07, 0x0F)
    assert write(node, "40 41 60 00 00 00 00 00")[1].startswith("4b 41 60 00 37")  # voltage enabled
    assert node.state is State.OPERATION_ENABLED


def test_set_point_is_taken_on_the_rising_edge_of_bit_4_only(node):
    write(node, "2f 60 60 00 01 00 00 00")  # profile position
    write(node, "23 81 60 00 40 42 0f 00")  # 1e6 units of 1e-6 rad/s
    write(node, "23 7a 60 00 00 10 00 00")  # 4096 increments: one turn
    obey(node, 0x06, 0x07, 0x0F, 0x1F, 0x1F, 0x0F, 0x1F)
    moves = [asked for asked in node.axis.asked if asked != "halt"]
    assert moves == [pytest.approx((2 * 3.141592653589793, 1.0))] * 2


def test_mode_that_the_drive_does_not_have_is_refused(node):
    assert write(node, "2f 60 60 00 03 00 00 00")[1] == "80 60 60 00 30 00 09 06"


def test_sampling_time_that_the_drive_does_not_have_is_refused(node):
    assert write(node, "2f c2 60 01 02 00 00 00")[1] == "80 c2 60 01 30 00 09 06"
    assert write(node, "2f c2 60 01 01 00 00 00")[1][:2] == "60"


def test_reference_faster_than_the_limit_is_refused_by_the_drive_too(node):
    write(node, "23 7f 60 00 64 00 00 00")  # at most 100 units
    node.trace._load((100).to_bytes(4, "little"))
    write(node, "21 00 21 00 04 00 00 00")
    assert write(node, "07 65 00 00 00 00 00 00")[1] == "80 00 21 00 31 00 09 06"  # 101 units


def test_fault_stops_the_motor_and_is_reset_by_an_edge(node):
    obey(node, 0x06, 0x07, 0x0F)
    node.said.clear()
    node.fault(0x2310)
    assert node.said == [(0x085, "10 23 01 00 00 00 00 00")]
    assert node.axis.asked[-1] == "halt"
    obey(node, 0x0F, 0x06)
    assert node.state is State.FAULT
    obey(node, 0x80)
    assert node.state is State.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("option", "state"),
    [
        (0, State.OPERATION_ENABLED),
        (1, State.FAULT),
        (2, State.SWITCH_ON_DISABLED),
        (3, State.SWITCH_ON_DISABLED),
    ],
)
def test_D09_drive_that_no_longer_hears_its_host_reacts_as_configured(node, option, state):
    write(node, "23 16 10 01 c8 00 7f 00")  # node 0x7F within 200 ms
    write(node, f"2b 07 60 00 {option:02x} 00 00 00")
    obey(node, 0x06, 0x07, 0x0F)
    node.hear_heartbeat(0x7F, 0)
    node.act(150_000)
    node.hear_heartbeat(0x7F, 150_000)
    node.act(349_000)
    assert node.state is State.OPERATION_ENABLED
    node.said.clear()
    node.act(350_000)
    assert node.state is state
    assert [identifier for identifier, _ in node.said] == [0x085]
    assert node.said[0][1].startswith("30 81")  # EMCY 0x8130: heartbeat error


def test_quick_stop_stays_only_where_asked(node):
    obey(node, 0x06, 0x07, 0x0F, 0x02)
    assert node.state is State.SWITCH_ON_DISABLED  # option 2: ramp, then off
    write(node, "2b 5a 60 00 06 00 00 00")
    obey(node, 0x06, 0x07, 0x0F, 0x02)
    assert node.state is State.QUICK_STOP_ACTIVE


@settings(max_examples=100, deadline=None)
@given(frames=st.lists(st.tuples(st.sampled_from("nsh"), st.binary(max_size=8)), max_size=30))
def test_no_frame_breaks_a_drive_or_enables_it_by_chance(frames, nameplate_once):
    node = make_node(nameplate_once)
    for now, (kind, data) in enumerate(frames):
        if kind == "n":
            node.command(data, now)
        elif kind == "s":
            node.request([data])
        else:
            node.hear_heartbeat(len(data), now)
        node.act(now)
    if not any(kind == "s" and data[1:4] == b"\x40\x60\x00" for kind, data in frames):
        assert node.state is State.SWITCH_ON_DISABLED


@pytest.fixture(scope="module")
def nameplate_once():
    from robid_can.drive import Nameplate

    return Nameplate(serial_number=7, encoder_increments=4096, rated_torque_mnm=2000, saturated_torque_nm=5.0)
