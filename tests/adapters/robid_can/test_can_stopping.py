"""Stopping: all drives are told within one cycle, each ramps down by itself, and rest is judged together (D06, D18)."""

from __future__ import annotations

import signal

import can
import numpy as np
import pytest

from robid_can import dictionary as od
from robid_can.drive.state_machine import State
from robid_can.drives import LockStep, nameplates
from robid_can.frame import VirtualEnd
from robid_can.host.stopping import OFF_S, STOP_S, stop_all
from robid_core import MotionAborted, MotionRefused, StopNotConfirmed
from robid_core.interruption import requested, signals_as_interrupt

CYCLE_S = 1e-3  # control and sampling
RAMPS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # rad/s^2: slow ones, so that they can be seen


@pytest.fixture
def rig(loop, make_robot, make_experiment):
    """Six axes in the middle of a long run, each with a quick-stop ramp of its own."""
    robot = make_robot(6)
    plates = [
        type(plate)(**(vars(plate) | {"quick_stop_deceleration": ramp}))
        for plate, ramp in zip(nameplates(robot), RAMPS, strict=True)
    ]
    rig = loop(robot, plates=plates)
    for drive in rig.host.drives:
        object.__setattr__(drive.expected, "speed_limit", 1.9)  # 1 rad/s^2 stops that in less than 2 s
    experiment = make_experiment(robot, n_sample=4000, scale=0.25)
    rig.host.bring_up(1_000_000, 1e-3)
    rig.begin = lambda: run_until(rig, experiment, 1.3)
    rig.told = {}
    for node in rig.nodes:
        watch_orders(rig, node)
    return rig


def watch_orders(rig, node):
    """Note when a drive is told to stop first, by whatever frame."""
    command, obey = node.command, node.objects.on_write[od.CONTROLWORD]

    def by_network(data, now_us):
        if data[0] == 0x02:
            rig.told.setdefault(node.node_id, rig.system.time_s)
        command(data, now_us)

    def by_controlword(word):
        if word == 0x02:
            rig.told.setdefault(node.node_id, rig.system.time_s)
        obey(word)

    node.command, node.objects.on_write[od.CONTROLWORD] = by_network, by_controlword


def run_until(rig, experiment, seconds):
    """Start a run and leave it in the middle, as an interruption does."""

    class Leave(LockStep):
        def let_pass(self, passing):
            super().let_pass(passing)
            if rig.system.motors.run and self.now() > rig.system.motors.run.began_ns * 1e-9 + seconds:
                raise KeyboardInterrupt

    rig.link.clock = Leave(rig.system)
    with pytest.raises(KeyboardInterrupt):
        rig.host.perform(experiment)
    rig.link.clock = LockStep(rig.system)
    assert all(node.axis.speed for node in rig.nodes)
    return rig


@pytest.mark.parametrize("deaf", [(), (1,), (6,), (2, 5), (1, 2, 3, 4, 5)])
def test_D06_every_drive_is_told_within_one_cycle_whoever_disobeys(rig, deaf):
    rig.begin()
    for node in rig.nodes:
        node.deaf = node.node_id in deaf
    began = rig.system.time_s
    problems = rig.host.stop()
    assert set(rig.told) == {1, 2, 3, 4, 5, 6}
    assert max(rig.told.values()) - began < CYCLE_S
    assert rig.system.time_s - began < STOP_S + OFF_S + 0.1
    for node in rig.nodes:
        assert (node.axis.speed == 0) == (node.node_id not in deaf)
        assert (node.state is State.SWITCH_ON_DISABLED) == (node.node_id not in deaf)
    if not deaf:
        assert problems == []
        return
    turning, powered = problems
    assert "D06: 2 s after quick stop" in turning
    assert turning.endswith("USE THE EMERGENCY STOP")
    assert "shows 'operation enabled'" in powered
    for node_id in range(1, 7):
        assert (f"axis_{node_id} (node {node_id}) still turns" in turning) == (node_id in deaf)
        assert (f"axis_{node_id} (node {node_id})" in powered) == (node_id in deaf)


def test_each_axis_ramps_down_by_its_own_deceleration_from_where_it_was(rig):
    rig.begin()
    speed = np.array([node.axis.speed for node in rig.nodes])
    angle = np.array([node.axis.angle for node in rig.nodes])
    began, rest, clock = rig.system.time_s, {}, rig.link.clock

    class Look(LockStep):
        def let_pass(self, seconds):
            for _ in range(round(seconds * 1e4)):  # 0.1 ms at a time
                super().let_pass(1e-4)
                for axis, node in enumerate(rig.nodes):
                    if node.axis.speed == 0:
                        rest.setdefault(axis, self.now())
            if not seconds:
                super().let_pass(0)

    rig.link.clock = Look(rig.system)
    assert rig.host.stop() == []
    rig.link.clock = clock
    times = np.array([rest[axis] for axis in range(6)]) - began
    # Told within a cycle, looked at every 0.1 ms; frames take up to 2 ms of bus time between two looks.
    np.testing.assert_allclose(times, np.abs(speed) / RAMPS, atol=CYCLE_S + 2e-3)
    assert times.max() > 20 * times.min()  # nobody waits for another, nobody is stopped by another
    way = np.array([node.axis.angle for node in rig.nodes]) - angle
    # Way on the ramp v^2 / 2a, signed; until it is told an axis goes on for at most a cycle.
    np.testing.assert_allclose(
        way, speed * np.abs(speed) / (2 * np.array(RAMPS)), atol=2e-3 * np.abs(speed).max()
    )


def attend(rig, seconds):
    """Let time pass under the host's heartbeat."""
    for _ in range(round(seconds / 0.1)):
        rig.link.attend(0.1)


def test_an_axis_that_stops_leaves_the_others_in_their_run(rig):
    rig.begin()
    rig.nodes[0].fault(0x2310)
    attend(rig, 0.1)
    assert rig.nodes[0].trace.state is od.TraceState.ABORTED
    assert {node.trace.state for node in rig.nodes[1:]} == {od.TraceState.RUNNING}
    assert rig.nodes[0].state is State.FAULT_REACTION_ACTIVE  # 1 rad/s^2 from more than half a rad/s
    attend(rig, 15.0)
    assert rig.nodes[0].state is State.FAULT
    assert {node.trace.state for node in rig.nodes[1:]} == {od.TraceState.COMPLETE}


def test_the_broadcast_stops_a_drive_whose_sdo_server_hangs(rig):
    rig.begin()
    rig.nodes[3].request = lambda requests: None
    problems = rig.host.stop()
    assert rig.nodes[3].axis.speed == 0
    assert rig.nodes[3].state is State.SWITCH_ON_DISABLED
    assert "axis_4 (node 4) does not say whether it turns" in problems[0]  # nobody has seen it stand
    assert "axis_1" not in problems[0]


def test_the_controlword_stops_a_drive_that_ignores_the_network(rig):
    rig.begin()
    rig.nodes[2].command = lambda data, now_us: None
    assert rig.host.stop() == []
    assert rig.nodes[2].axis.speed == 0
    assert rig.nodes[2].state is State.SWITCH_ON_DISABLED


def test_a_turning_point_is_no_rest(rig):
    """A disobedient motor that swings reads zero now and then; one such reading confirms nothing."""
    rig.begin()
    rig.nodes[1].deaf = True
    readings = iter(range(10**6))
    rig.nodes[1].objects.on_read[od.VELOCITY_ACTUAL] = lambda: next(readings) % 2 * 1000
    assert "axis_2 (node 2) still turns" in rig.host.stop()[0]


def test_rest_is_what_the_speed_says_not_the_command(rig):
    rig.begin()
    rig.nodes[4].objects.on_read[od.VELOCITY_ACTUAL] = lambda: 1000
    (problem,) = rig.host.stop()
    assert "axis_5 (node 5) still turns at 0.001 rad/s: USE" in problem


def test_what_a_drive_said_before_the_stop_confirms_no_rest(rig):
    rig.begin()
    rig.nodes[3].objects.on_read[od.VELOCITY_ACTUAL] = lambda: 0
    rig.host.drives[3].send_read(od.VELOCITY_ACTUAL)
    attend(rig, 0.1)
    rig.nodes[3].request = lambda requests: None
    assert "axis_4 (node 4) does not say whether it turns" in rig.host.stop()[0]


def test_a_drive_that_holds_its_motor_after_a_quick_stop_is_switched_off(rig):
    """Its option says so (0x605A: 6), whoever has written that since the bring-up."""
    rig.begin()
    rig.nodes[2].objects.download(od.QUICK_STOP_OPTION, b"\x06\x00")
    assert rig.host.stop() == []
    assert rig.nodes[2].state is State.SWITCH_ON_DISABLED


class DeadBus:
    """Takes nothing."""

    def __init__(self, error):
        self.error, self.tried = error, []

    def send(self, message, timeout=None):
        self.tried.append((message.arbitration_id, bytes(message.data), timeout))
        raise self.error

    def recv(self, timeout=None):
        return None


@pytest.mark.parametrize("error", [can.CanOperationError("queue full"), OSError("no such device")])
def test_B11_a_bus_that_takes_nothing_is_tried_for_every_drive_and_told(rig, error):
    rig.begin()
    bus = rig.link._can = DeadBus(error)
    problems = rig.host.stop()
    assert {f"{n}: {d.hex(' ')}" for n, d, _ in bus.tried if d[:4] == b"\x2b\x40\x60\x00"} >= {
        f"{0x600 + node}: 2b 40 60 00 02 00 00 00" for node in range(1, 7)
    }
    assert (0, b"\x02\x00") in {(n, d) for n, d, _ in bus.tried}
    assert max(timeout for *_, timeout in bus.tried) <= 0.05
    assert any(str(error) in problem for problem in problems)
    assert any("axis_6 (node 6) does not say whether it turns" in problem for problem in problems)


def test_the_first_frames_of_a_stop_are_those_of_the_standards(scripted):
    """CiA 301 and 402: stop all nodes, let all be pre-operational, quick stop to each, then the questions."""
    from robid_can.dictionary import virtual_drive_dictionary
    from robid_can.host import ExpectedDrive, Host

    expected = [ExpectedDrive(f"axis_{node}", node, None, 1.0) for node in (1, 2)]
    host = Host(scripted.link, expected, virtual_drive_dictionary())
    for node in (1, 2):
        scripted.bus.expect(f"60{node}#40 6c 60 00 00 00 00 00", f"58{node}#43 6c 60 00 00 00 00 00")
    send, times = scripted.bus.send, []
    scripted.bus.send = lambda *message: (times.append(scripted.clock.time), send(*message))
    stop_all(scripted.link, host.drives)
    assert times[:6] == [0.0] * 6
    assert scripted.bus.sent[:6] == [
        "000#02 00",
        "000#80 00",
        "601#2b 40 60 00 02 00 00 00",
        "602#2b 40 60 00 02 00 00 00",
        "601#40 6c 60 00 00 00 00 00",
        "602#40 6c 60 00 00 00 00 00",
    ]


def test_D08_a_ramp_that_takes_longer_than_a_stop_may_is_refused(loop, make_robot):
    plates = [type(p)(**(vars(p) | {"quick_stop_deceleration": 100.0})) for p in nameplates(make_robot())]
    rig = loop(plates=plates)  # the speed limit is 400 rad/s
    with pytest.raises(MotionRefused, match=r"D08: axis_1 .*0x6085:00 is 100 rad/s\^2.*200 rad/s\^2 or more"):
        rig.host.bring_up(1_000_000, 1e-3)


# Signals ----------------------------------------------------------------------------------------------------


class Signals(LockStep):
    """Time in which signals come, every so often from a moment on."""

    def __init__(self, system, at_s, count):
        super().__init__(system)
        self.at_s, self.left = at_s, count

    def let_pass(self, seconds):
        if self.left and self.now() >= self.at_s:
            self.left -= 1
            self.at_s += 0.2  # the next ones come while the drives are being stopped
            signal.raise_signal((signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[self.left % 3])
        super().let_pass(seconds)


def interrupted(drives, robot, experiment, count, deaf=()):
    """Perform an experiment that is interrupted in its middle; return what came out."""
    with signals_as_interrupt(), drives:
        system = drives._system
        drives._host.link.clock = Signals(system, system.time_s + 3.0, count)  # 1.5 s after the SYNC
        for node in system.nodes:
            node.deaf = node.node_id in deaf
        drives.perform(experiment)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_D18_signals_during_the_stop_wait_until_all_drives_are_off(
    make_robot, make_experiment, open_can, count
):
    robot = make_robot()
    drives = open_can(robot)
    with pytest.raises(KeyboardInterrupt) as caught:
        interrupted(drives, robot, make_experiment(robot, n_sample=4000, scale=0.1), count)
    assert caught.value.__notes__ == ["all drives have stopped and are switched off"]
    assert {node.state for node in drives._system.nodes} == {State.SWITCH_ON_DISABLED}
    assert not requested()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_D06_an_interruption_after_which_a_motor_turns_is_no_calm_one(
    make_robot, make_experiment, open_can, count
):
    robot = make_robot()
    drives = open_can(robot)
    with pytest.raises((StopNotConfirmed, KeyboardInterrupt)) as caught:
        interrupted(drives, robot, make_experiment(robot, n_sample=9000, scale=0.1), count, deaf=(2,))
    assert caught.type is StopNotConfirmed
    caught.match(r"interrupted; D06: .*axis_2 \(node 2\).* USE THE EMERG")
    assert caught.value.exit_code == MotionAborted.exit_code == 4
    assert "axis_1" not in str(caught.value)
    assert drives._system.nodes[0].state is State.SWITCH_ON_DISABLED


def test_a_signal_that_comes_while_drives_are_stopped_at_the_end_interrupts_afterwards(
    make_robot, make_experiment, open_can, monkeypatch
):
    robot = make_robot()
    drives = open_can(robot)

    def normal_end():
        with signals_as_interrupt(), drives:
            drives.perform(make_experiment(robot))
            drives._host.link.clock = Signals(drives._system, 0.0, 1)

    with pytest.raises(KeyboardInterrupt):
        normal_end()
    assert {node.state for node in drives._system.nodes} == {State.SWITCH_ON_DISABLED}


def test_a_fault_after_which_a_motor_turns_tells_both(make_robot, make_experiment, open_can):
    robot = make_robot()
    drives = open_can(robot)

    def faulty():
        with drives:
            nodes, clock = drives._system.nodes, drives._host.link.clock
            nodes[0].deaf = True

            class Fault(LockStep):
                def let_pass(self, seconds):
                    clock.let_pass(seconds)
                    if clock.now() > 3.0 and nodes[1].state is State.OPERATION_ENABLED:
                        nodes[1].fault(0x3220)

            drives._host.link.clock = Fault(drives._system)
            drives.perform(make_experiment(robot, n_sample=9000, scale=0.1))

    with pytest.raises(
        StopNotConfirmed, match=r"B08: axis_2 .*0x3220.*; D06: .*axis_1 \(node 1\) still turns"
    ):
        faulty()


def test_a_bring_up_that_fails_says_why_and_not_that_a_silent_drive_did_not_stop(
    make_robot, open_can, monkeypatch
):
    drives = open_can(make_robot())
    connect = drives._connect

    def with_a_mute_drive():
        host = connect()
        drives._system.nodes[1].mute = True
        return host

    monkeypatch.setattr(drives, "_connect", with_a_mute_drive)
    with pytest.raises(MotionRefused, match=r"B14: .*axis_2 \(node 2\).*nothing has moved"), drives:
        raise AssertionError("never up")


def test_an_interruption_right_after_the_bring_up_tells_of_a_drive_that_stays_on(make_robot, open_can):
    """Nothing has moved yet, and still it is no calm interruption."""
    drives = open_can(make_robot())

    def interrupted_early():
        with drives:
            drives._system.nodes[1].deaf = True
            raise KeyboardInterrupt

    with pytest.raises(
        StopNotConfirmed, match=r"interrupted; D06: .*axis_2 \(node 2\) shows 'operation enabled'"
    ):
        interrupted_early()


def test_send_of_a_running_bus_may_take_its_time(rig):
    waits = []
    send = VirtualEnd.send

    def noted(end, message, timeout=None):
        waits.append(timeout)
        send(end, message, timeout)

    rig.link._can.send = lambda message, timeout=None: noted(rig.link._can, message, timeout)
    rig.host.drives[0].read(od.STATUSWORD)
    assert set(waits) == {1.0}
