"""Host and virtual drives on one bus, against the same plant asked directly."""

import dataclasses

import numpy as np
import pytest

from robid_can import dictionary as od
from robid_can.drive.state_machine import State
from robid_can.drives import CanDrives
from robid_can.frame import VirtualEnd
from robid_core import ConfigurationError, MotionRefused, Robot, clear_motion


def direct(robot, experiment):
    """What the plant does, without a bus: (position, torque) of the traced periods."""
    plant = robot.plant()
    plant.rest(experiment.start)
    reference = np.tile(experiment.reference, (experiment.periods, 1))
    position, torque = plant.track(reference, experiment.seed)
    shape = (experiment.traced, *experiment.reference.shape)
    kept = slice(-shape[0] * shape[1], None)
    return position[kept].reshape(shape), torque[kept].reshape(shape)


@pytest.mark.parametrize("n_axis", [1, 2, 6])
def test_trace_through_the_bus_is_the_direct_one_within_half_an_increment(
    n_axis, make_robot, make_experiment, open_can
):
    robot = make_robot(n_axis, position_noise=2e-5, torque_noise=0.01)
    experiment = make_experiment(robot)
    increment = 2 * np.pi / robot.encoder_counts
    start = np.rint(experiment.start / increment) * increment  # whole increments: the same rest for both
    clearance = clear_motion(start, experiment.reference, 1e-3, 3, robot.limits)
    experiment = dataclasses.replace(experiment, start=start, clearance=clearance)
    with open_can(robot) as drives:
        trace = drives.perform(experiment)
    position, torque = direct(robot, experiment)
    # The reference is whole increments, the plant and its noise are the same: only rounding is left.
    np.testing.assert_allclose(trace.position, position, rtol=0, atol=0.5001 * increment)
    rated = np.ceil(1e3 * robot.torque_limit / 3) * 1e-3
    np.testing.assert_allclose(trace.torque, torque, rtol=0, atol=0.5001 * rated / 10_000)
    np.testing.assert_array_equal(trace.reference, experiment.reference)
    assert np.abs(trace.position - position).max() > 0.3 * increment  # and rounding there is
    assert trace.valid.all()


def test_reference_that_is_not_whole_increments_is_recorded_as_the_drives_applied_it(
    make_robot, make_experiment, open_can
):
    robot = make_robot()
    experiment = make_experiment(robot, unit=1e-9)
    with open_can(robot) as drives:
        trace = drives.perform(experiment)
    error = np.abs(trace.reference - experiment.reference)
    assert 0 < error.max() <= 0.5e-6 * (1 + 1e-9)
    np.testing.assert_allclose(trace.reference / 1e-6, np.rint(trace.reference / 1e-6), atol=1e-6)


def test_time_goes_on_however_little_is_left_to_wait(loop):
    rig = loop()
    rig.system.advance(0.5)
    rig.link.wait(1e-16)  # what is left of the end of a run after rounding
    assert rig.link.clock.now() > 0.5


def test_experiments_follow_one_another_from_where_the_motors_stand(make_robot, make_experiment, open_can):
    robot = make_robot()
    experiment = make_experiment(robot)
    with open_can(robot) as drives:
        first = drives.perform(experiment)
        again = drives.perform(experiment)
    np.testing.assert_array_equal(first.position, again.position)
    assert again.time_s > first.time_s + 3 * 0.15  # on the drives' clock


def test_two_runs_of_the_same_are_the_same_to_the_bit(make_robot, make_experiment, open_can):
    traces = []
    for _ in range(2):
        robot = make_robot(position_noise=1e-4, torque_noise=0.1)
        with open_can(robot) as drives:
            traces.append(drives.perform(make_experiment(robot)))
    np.testing.assert_array_equal(traces[0].position, traces[1].position)
    np.testing.assert_array_equal(traces[0].torque, traces[1].torque)
    assert traces[0].time_s == traces[1].time_s


def test_D02_share_of_saturated_samples_is_the_one_of_the_plant(make_robot, make_experiment, open_can):
    robot = make_robot(torque_limit=1.0, clip=True)
    experiment = make_experiment(robot, scale=3.0)
    with open_can(robot) as drives:
        trace = drives.perform(experiment)
    _, torque = direct(robot, experiment)
    expected = (np.abs(torque) >= 1.0).mean(axis=(0, 1))
    assert expected.max() > 0.01
    np.testing.assert_allclose(trace.saturated, expected, atol=1e-12)


def test_torque_at_its_limit_fits_the_trace(make_robot, make_experiment, open_can):
    robot = make_robot(torque_limit=1.0, clip=True)
    with open_can(robot) as drives:
        trace = drives.perform(make_experiment(robot, scale=30.0))
    assert np.abs(trace.torque).max() == pytest.approx(1.0, abs=1e-3)


def test_transfers_take_the_time_that_their_frames_occupy_the_bus(make_robot, make_experiment, open_can):
    robot = make_robot(1)
    experiment = make_experiment(robot, n_sample=3000, periods=1, traced=1)
    seconds = []
    for bitrate in (1_000_000, 500_000):
        with open_can(robot, bitrate=bitrate) as drives:
            drives.perform(experiment)
            before = drives._system.time_s
            drives.perform(experiment)
            seconds.append(drives._system.time_s - before)
    # (4 + 6) bytes a sample, 7 in a frame of 135 bits; the run itself takes 3 s, small talk a few per cent
    expected = 3000 * 10 / 7 * 135e-6
    assert seconds[1] - seconds[0] == pytest.approx(expected, rel=0.1)


def test_D03_commands_that_were_not_cleared_are_not_sent(make_robot, make_experiment, open_can):
    robot = make_robot()
    experiment = make_experiment(robot)
    reference = experiment.reference.copy()
    reference[7, 0] += 1e-6
    with open_can(robot) as drives:
        with pytest.raises(MotionRefused, match="D03"):
            drives.perform(dataclasses.replace(experiment, reference=reference))
        assert all(node.trace.state == od.TraceState.EMPTY for node in drives._system.nodes)


def test_lost_frame_of_a_bulk_transfer_is_sent_again(loop, make_robot, make_experiment, monkeypatch):
    robot = make_robot(1, position_noise=1e-3)
    experiment = make_experiment(robot)
    rig = loop(robot)
    rig.host.bring_up(1_000_000, 1e-3)
    rig.system.seed = experiment.seed
    clean = rig.host.perform(experiment)
    counts = {0x601: 0, 0x581: 0}
    send = VirtualEnd.send

    def lossy(end, message, timeout=None):
        bulk = len(message.data) == 8 and 2 <= message.data[0] & 0x7F <= 0x1F
        if message.arbitration_id in counts and bulk:
            counts[message.arbitration_id] += 1
            if counts[message.arbitration_id] == 30:
                return  # B01: this one never arrives
        send(end, message, timeout)

    monkeypatch.setattr(VirtualEnd, "send", lossy)
    monkeypatch.setattr(VirtualEnd, "send_burst", lambda end, burst: [end.send(f) for f in burst.frames()])
    lossy_trace = rig.host.perform(experiment)
    assert min(counts.values()) > 30
    np.testing.assert_array_equal(lossy_trace.position, clean.position)
    np.testing.assert_array_equal(lossy_trace.reference, clean.reference)


def test_every_frame_is_a_legal_classic_one_and_a_third_party_sees_them_all(
    loop, make_robot, make_experiment, plain_bus
):
    rig = loop(make_robot(1))
    third = plain_bus(rig.channel)
    rig.host.bring_up(1_000_000, 1e-3)
    rig.host.perform(make_experiment(rig.robot))
    rig.host.stop()
    seen = []
    while (message := third.recv(0)) is not None:
        message._check()
        seen.append(message)
    services = {message.arbitration_id & 0x780 for message in seen}
    assert services == {0x000, 0x080, 0x580, 0x600, 0x700}
    assert len(seen) > 150 * 10 / 7
    assert next(bytes(m.data) for m in seen if m.arbitration_id == 0) == b"\x82\x00"
    times = [message.timestamp for message in seen]
    assert times == sorted(times)


def test_leaving_in_any_way_switches_every_drive_off(make_robot, make_experiment, open_can):
    robot = make_robot()
    drives = open_can(robot)

    def interrupted():
        with drives:
            assert {node.state for node in drives._system.nodes} == {State.OPERATION_ENABLED}
            drives.perform(make_experiment(robot))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):  # D18
        interrupted()
    system = drives._system
    assert {node.state for node in system.nodes} == {State.SWITCH_ON_DISABLED}
    assert {node.nmt_state for node in system.nodes} == {0x7F}
    with pytest.raises(MotionRefused, match="not up"):
        drives.perform(make_experiment(robot))


def test_one_axis_robot_gives_the_same_motion_with_and_without_a_bus(make_session, make_experiment):
    from robid_acquisition.simulated import SimulatedDrives

    robot = Robot.load("one_axis")
    experiment = make_experiment(robot, n_sample=200)
    traces = []
    for drives in (SimulatedDrives(plant="one_axis_true"), CanDrives(plant="one_axis_true")):
        assert not drives.moves_hardware
        assert drives.truth(robot).as_mapping()["gear_stiffness.axis_1"] > 0
        with drives.open(make_session(robot)) as opened:
            traces.append(opened.perform(experiment))
    # The encoder stands inside the speed loop: the start, rounded to half an increment, moves its steps, which
    # the loop turns into torque. So a few increments in position, and in torque small against its own size.
    step = traces[1].position_unit[0]
    assert np.abs(traces[0].position - traces[1].position).max() <= 3 * step
    difference = traces[0].torque - traces[1].torque
    assert np.sqrt(np.mean(difference**2)) < 0.01 * np.std(traces[0].torque)


def test_real_bus_is_refused_and_says_what_later_versions_will_ask(make_session, make_robot):
    drives = CanDrives(interface="socketcan", channel="can0")
    assert drives.moves_hardware
    assert drives.truth(make_robot()) is None
    with pytest.raises(MotionRefused, match=r"hardware: \{confirm: true\}"):
        drives.open(make_session(make_robot()))


def test_a_virtual_bus_without_a_plant_is_a_mistake_in_the_file():
    with pytest.raises(ValueError, match="nothing stands behind a virtual bus"):
        CanDrives(interface="virtual")


@pytest.mark.parametrize(
    "settings",
    [
        {"plant": "x", "interface": "socketcan"},
        {"node_ids": (1, 1)},
        {"node_ids": (0, 1)},
        {"node_ids": (1, 127)},
        {"bitrate": 5},
        {"bitrat": 500_000},
    ],
)
def test_settings_that_cannot_be_meant_are_refused(settings):
    with pytest.raises(ValueError, match="validation error"):
        CanDrives(**settings)


def test_plant_with_another_number_of_motors_is_refused(make_session, make_robot):
    with pytest.raises(ConfigurationError, match="has 1 motor, robot 'double' has 2"):
        CanDrives(plant="one_axis_true").open(make_session(make_robot()))
    with pytest.raises(ConfigurationError, match="node_ids has 2 entries"):
        CanDrives(plant="one_axis_true", node_ids=(3, 4)).open(make_session(make_robot(1)))
