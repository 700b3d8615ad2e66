"""Faults of the bus and of drives: what the user is told, and that every other motor stops."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from faults.fault import fault

from robid_can import dictionary as od
from robid_can.drive import DriveSystem
from robid_can.drive.state_machine import State
from robid_can.drives import LockStep, nameplates
from robid_can.frame import Frame, VirtualEnd
from robid_can.host.watch import SILENCE_S
from robid_core import DataRejected, MotionAborted, MotionRefused


class Incident(LockStep):
    """Lock-step time in which something happens at a moment."""

    def __init__(self, system, after_s, happen):
        super().__init__(system)
        self.when, self.happen = system.time_s + after_s, happen
        self.happened_at = None

    def let_pass(self, seconds):
        super().let_pass(seconds)
        if self.happened_at is None and self.now() >= self.when:
            self.happened_at = self.now()
            self.happen()


def run_with(rig, experiment, happen, after_s=1.5):
    """Perform an experiment of 3 s in which something happens, then stop as a leaving host does."""
    rig.host.bring_up(1_000_000, 1e-3)
    incident = Incident(rig.system, after_s, happen)
    rig.link.clock = incident
    try:
        rig.host.perform(experiment)
    finally:
        noticed = incident.now()
        problems = rig.host.stop()
        rig.noticed_after_s = noticed - incident.happened_at
        rig.problems = problems


@pytest.fixture
def long_experiment(make_robot, make_experiment):
    return make_experiment(make_robot(), n_sample=1000, scale=0.1)


def assert_all_off(rig, but=()):
    for node in rig.nodes:
        if node.node_id not in but:
            assert node.state in (State.SWITCH_ON_DISABLED, State.FAULT)
            assert not node.axis.moving
            assert node.axis.speed == 0


def test_B07_drive_silent_in_the_middle_stops_all_others_within_the_heartbeat_timeout(loop, long_experiment):
    rig = loop()

    def fall_silent():
        rig.nodes[1].mute = True

    with pytest.raises(MotionAborted, match=r"B07: axis_2 \(node 2\).*all axes get a quick stop"):
        run_with(rig, long_experiment, fall_silent)
    assert rig.noticed_after_s <= SILENCE_S + 0.11  # the host looks every 0.1 s
    assert_all_off(rig)
    assert any("axis_2" in problem for problem in rig.problems)


def test_B08_drive_fault_in_the_middle_stops_all_others(loop, long_experiment):
    rig = loop()
    with pytest.raises(MotionAborted, match=r"B08: axis_1 \(node 1\) sent EMCY 0x3220"):
        run_with(rig, long_experiment, lambda: rig.nodes[0].fault(0x3220))
    assert_all_off(rig)
    assert rig.nodes[0].state is State.FAULT  # and nobody resets it


def test_B16_network_command_of_another_master_stops_the_run(loop, long_experiment):
    rig = loop()
    intruder = VirtualEnd(rig.channel)
    with pytest.raises(MotionAborted, match="B16"):
        run_with(rig, long_experiment, lambda: intruder.send(Frame(0, bytes.fromhex("80 01"), 0.0)))
    intruder.shutdown()
    assert_all_off(rig)


def test_D07_statusword_that_shows_no_state_stops_the_run(loop, long_experiment):
    rig = loop()

    def corrupt():
        rig.nodes[0].objects.on_read[od.STATUSWORD] = lambda: 0x0001

    with pytest.raises(MotionAborted, match="D07: axis_1 .* statusword 0x0001, which is no state"):
        run_with(rig, long_experiment, corrupt)
    assert_all_off(rig)


def test_D07_drive_that_leaves_operation_without_an_emergency_message_stops_the_run(loop, long_experiment):
    rig = loop()

    def leave():
        rig.nodes[1].state = State.SWITCHED_ON

    with pytest.raises(MotionAborted, match="D07: axis_2 .* left operation: it shows 'switched on'"):
        run_with(rig, long_experiment, leave)
    assert_all_off(rig)


def test_D06_motor_that_does_not_obey_the_quick_stop_is_told_by_its_speed(loop, long_experiment):
    rig = loop()

    def run_away():
        rig.nodes[1].objects.on_read[od.VELOCITY_ACTUAL] = lambda: 1000
        rig.nodes[0].fault(0x2310)

    with pytest.raises(MotionAborted, match="B08"):
        run_with(rig, long_experiment, run_away)
    assert any("D06" in problem and "USE THE EMERGENCY STOP" in problem for problem in rig.problems)
    assert_all_off(rig)


def test_drives_that_stay_in_quick_stop_are_switched_off_too(loop):
    rig = loop()
    rig.host.bring_up(1_000_000, 1e-3)
    for node in rig.nodes:
        node.objects.values[od.QUICK_STOP_OPTION] = 6
    assert rig.host.stop() == []
    assert_all_off(rig)


def test_D09_drives_stop_by_themselves_when_the_host_is_gone(loop, long_experiment):
    rig = loop()
    rig.host.bring_up(1_000_000, 1e-3)
    rig.host.move_to(np.array([1.0, 2.0]))
    assert {node.state for node in rig.nodes} == {State.OPERATION_ENABLED}
    rig.system.advance(SILENCE_S + 0.1)  # the host was killed: nobody speaks
    assert_all_off(rig)


def stalled_before(rig, n_frame):
    """Let the host's computer stand still for longer than the watchdogs wait, just before it sends a frame."""
    bus, log = rig.link._can, SimpleNamespace(sent=0, lost=None, moved=[])
    send, motors = bus.send, rig.system.motors
    track, move = motors.track, motors.move

    def late(frame, timeout=None):
        log.sent += 1
        if log.sent == n_frame:
            watched = any(node._heard_us is not None for node in rig.nodes)
            rig.system.advance(SILENCE_S + 0.1)
            log.lost = rig.system.time_s if watched else None
        send(frame, timeout)

    bus.send = late
    motors.track = lambda *what: (log.moved.append(rig.system.time_s), track(*what))
    motors.move = lambda *what: (log.moved.append(rig.system.time_s), move(*what))
    return log


@fault(
    "D10",
    sees="exit 4 (or 3 before the first motion): this computer stood still for so long; nothing moves any more",
    mutant=(
        "adapters/robid_can/drive/node.py",
        "            return\n        self.trace.disarm()\n",
        "            return\n",
    ),
)
@fault(
    "D10",
    sees="the same in the bring-up: drives that have stopped by themselves are not moved to a start",
    mutant=(
        "adapters/robid_can/host/link.py",
        "        self.keep_alive()\n        self.check()\n",
        "        self.keep_alive()\n",
    ),
)
@fault(
    "D10",
    sees="that this computer stood still, and for how long, not only that drives have stopped",
    mutant=(
        "adapters/robid_can/host/link.py",
        "            if silent_s >= SILENCE_S:",
        "            if False:",
    ),
)
@fault(
    "D10",
    sees="exit 3, nothing has moved: up to the command that moves the first motor",
    mutant=(
        "adapters/robid_can/host/host.py",
        "        self.link.supervise()  # what has gone wrong until here is refused, for nothing has moved\n",
        "",
    ),
)
def test_D10_a_host_that_goes_on_after_its_drives_have_missed_it_moves_nothing(
    loop, make_robot, make_experiment
):
    """At every frame of bring-up and motion in turn, the host's computer stands still for 0.45 s before it is sent."""
    experiment = make_experiment(make_robot(1), n_sample=50, periods=1, traced=1)
    outcomes, doubts = [], 0
    for n_frame in itertools.count(1):
        rig = loop(make_robot(1))
        log, outcome = stalled_before(rig, n_frame), ""
        try:
            rig.host.bring_up(1_000_000, 1e-3)
            rig.host.perform(experiment)
        except (MotionRefused, MotionAborted) as error:
            outcome = str(error)
        if log.sent < n_frame:
            break
        if log.lost is not None:
            assert [time for time in log.moved if time >= log.lost] == [], n_frame
            assert rig.nodes[0].state in (State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON), n_frame
            assert all(outcomes), n_frame  # who went on all the same had nothing left to send
            outcomes.append(outcome)
            doubts += not log.moved and "nothing has moved" not in outcome
    assert doubts == 1  # the command itself came too late: a host cannot know that
    assert len(outcomes) > 40  # frames or bursts
    assert not outcomes.pop()  # the last frame, which ends the upload of the trace
    stood = [outcome.startswith("D10: this computer stood still for 0.4") for outcome in outcomes]
    assert np.mean(stood) > 0.7  # in the others a drive was the first to tell


def test_D11_start_that_was_not_reached_is_told(loop, long_experiment):
    rig = loop()
    rig.host.bring_up(1_000_000, 1e-3)
    rig.nodes[0].objects.on_read[od.POSITION_ACTUAL] = lambda: 12
    with pytest.raises(MotionAborted, match="D11: axis_1 .* its start is 10 rad"):
        rig.host.perform(long_experiment)


def test_A08_drives_whose_clocks_differ_give_no_record(loop, make_experiment, make_robot):
    rig = loop()
    rig.host.bring_up(1_000_000, 1e-3)
    rig.nodes[1].objects.on_read[od.TRACE_CLOCK] = lambda: 77
    with pytest.raises(DataRejected, match="A08"):
        rig.host.perform(make_experiment(rig.robot))


def test_A11_trace_that_is_too_short_gives_no_record(loop, make_experiment):
    rig = loop()
    rig.host.bring_up(1_000_000, 1e-3)
    rig.nodes[1].objects.on_read[od.TRACE_MEMORY] = lambda: bytes(6 * 299)
    with pytest.raises(DataRejected, match="A11: test: axis_2 .* kept 299 samples, 300 are wanted"):
        rig.host.perform(make_experiment(rig.robot))


def test_references_that_do_not_fit_together_are_a_fault_of_the_drives(loop, make_experiment):
    rig = loop()
    rig.host.bring_up(1_000_000, 1e-3)
    write = rig.host.drives[1].write
    rig.host.drives[1].write = lambda key, value: write(key, value + (key == od.TRACE_PERIODS))
    with pytest.raises(MotionAborted, match="B08.*0x6320"):
        rig.host.perform(make_experiment(rig.robot))


@pytest.mark.parametrize("identifier", [0x601, 0x581])  # while a reference goes down, a trace comes up
def test_D18_interruption_in_the_middle_of_a_transfer_still_switches_every_drive_off(
    loop, make_experiment, monkeypatch, identifier
):
    rig = loop()
    rig.host.bring_up(1_000_000, 1e-3)
    send, counted = VirtualEnd.send, []

    def interrupt(end, message, timeout=None):
        if message.arbitration_id == identifier and message.data[0] == 0x20:  # the 32nd segment of a block
            counted.append(1)
            if len(counted) == 1:
                raise KeyboardInterrupt
        send(end, message, timeout)

    monkeypatch.setattr(VirtualEnd, "send", interrupt)
    monkeypatch.setattr(VirtualEnd, "send_burst", lambda end, burst: [end.send(f) for f in burst.frames()])
    with pytest.raises(KeyboardInterrupt):
        rig.host.perform(make_experiment(rig.robot))
    assert rig.host.stop() == []
    assert_all_off(rig)


# Preflight: nothing has moved


def refused(rig, match):
    with pytest.raises(MotionRefused, match=match):
        rig.host.bring_up(1_000_000, 1e-3)
    assert {node.state for node in rig.nodes} <= {State.SWITCH_ON_DISABLED, State.FAULT}
    assert not rig.system.motors.moves


def test_B14_dead_bus_is_refused_after_a_second(loop):
    rig = loop()
    for node in rig.nodes:
        node.mute = True
    refused(rig, "B14: no sign of life from anyone at 1000000 bit/s.*nothing has moved")
    assert rig.system.time_s < 1.2
    assert rig.host.stop() == []  # who was never there is not blamed for not stopping


def test_B14_missing_drive_is_named(loop):
    rig = loop()
    rig.nodes[1].mute = True
    refused(rig, r"B14: no sign of life from axis_2 \(node 2\)")


def test_B12_two_drives_with_one_node_id_are_refused(loop, make_robot):
    rig = loop(make_robot(1))
    end = VirtualEnd(rig.channel)
    twin = DriveSystem(end, make_robot(1).plant(), nameplates(make_robot(1)), (1,))
    rig.link.clock = Both(rig.system, twin)
    refused(rig, "B12: more than one node answers as axis_1")
    end.shutdown()


class Both(LockStep):
    """Two drive systems on one bus."""

    def __init__(self, system, other):
        super().__init__(system)
        self.other = LockStep(other)

    def let_pass(self, seconds):
        super().let_pass(seconds)
        self.other.let_pass(seconds)


def test_B12_swapped_drives_are_told_by_their_serial_numbers(loop, make_robot):
    plates = nameplates(make_robot())
    refused(loop(plates=plates[::-1]), "B12: axis_1 .* serial number 2 .* wanted is 1")


@pytest.mark.parametrize(("subindex", "what"), [(1, "vendor id"), (2, "product code"), (3, "revision")])
def test_B12_drive_of_another_make_is_refused(loop, subindex, what):
    rig = loop()
    rig.nodes[1].objects.values[0x1018, subindex] = 0x99
    refused(rig, f"B12: axis_2 .* {what} 153 .0x99., wanted")


@pytest.mark.parametrize("key", [od.ABORT_CONNECTION_OPTION, od.CONSUMER_HEARTBEAT, od.FAULT_REACTION_OPTION])
def test_D08_drive_that_cannot_be_set_to_stop_on_lost_communication_is_refused(loop, key):
    rig = loop()
    rig.nodes[0].objects.on_read[key] = lambda: 0
    refused(rig, f"D08: axis_1 .*: object 0x{key[0]:04X}:{key[1]:02X} is 0 after")


def test_D05_drive_in_fault_is_not_reset_by_the_host(loop):
    rig = loop()
    boot = rig.nodes[1].boot

    def boot_into_fault(now_us):
        boot(now_us)
        rig.nodes[1].state = State.FAULT
        rig.nodes[1].objects.values[od.ERROR_CODE] = 0x7121

    rig.nodes[1].boot = boot_into_fault
    refused(rig, r"D05: axis_2 .* is in fault \(0x7121\).*by hand")
    assert rig.nodes[1].state is State.FAULT


def test_drive_that_refuses_an_object_is_told_with_object_and_reason(loop):
    rig = loop()

    def refuse(value):
        from robid_can.drive.objects import SdoAbort

        raise SdoAbort(0x08000022)

    rig.nodes[0].objects.on_write[od.MODE] = refuse
    refused(rig, "axis_1 .* refused writing 0x6060:00 .*0x08000022")


def test_failed_bring_up_leaves_no_drive_switched_on_and_closes_the_bus(open_can, make_robot, monkeypatch):
    from robid_can.host import bring_up

    seen = []

    def fail(link, drive):
        seen.append(drive)
        if len(seen) == 2:
            raise link.failure("D07: made up")
        enable(link, drive)

    enable = bring_up.enable
    monkeypatch.setattr(bring_up, "enable", fail)
    drives = open_can(make_robot())
    with pytest.raises(MotionRefused, match="made up"), drives:
        raise AssertionError("never up")
    assert {node.state for node in drives._system.nodes} == {State.SWITCH_ON_DISABLED}
    from can.interfaces.virtual import channels

    assert not [name for name in channels if str(name).startswith("robid")]


def test_random_frames_of_a_stranger_disturb_no_drive(loop):
    rig = loop()
    rig.host.bring_up(1_000_000, 1e-3)
    stranger = VirtualEnd(rig.channel)
    generator = np.random.default_rng(3)
    for number in range(3000):
        identifier = int(generator.integers(0x180, 0x580))  # no services of ours
        stranger.send(Frame(identifier, generator.bytes(int(generator.integers(0, 9))), 0.0))
        if number % 500 == 0:  # 500 frames keep the bus busy for 60 ms
            rig.link.wait(0.1)
    for drive in rig.host.drives:
        assert drive.state()[0] == "operation enabled"
    stranger.shutdown()
