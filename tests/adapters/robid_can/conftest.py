"""Doubles for the bus tests: a scripted bus with its clock, a plant in closed form, a robot around it."""

import logging
from dataclasses import dataclass, field
from types import SimpleNamespace

import can
import numpy as np
import pytest

from robid_can import dictionary
from robid_can.drive import DriveSystem, Nameplate
from robid_can.drives import CanDrives, LockStep, OpenCanDrives, expected_drives, nameplates
from robid_can.frame import Frame, VirtualEnd
from robid_can.host import ExpectedDrive, Host, Link
from robid_core import Experiment, MotionLimits, Session, clear_motion


class ScriptedBus:
    """Answers what the host sends by a script of (identifier, bytes) in hexadecimal."""

    def __init__(self):
        self.script = []  # (sent, [answers]); None as sent: whatever
        self.sent = []
        self.inbox = []

    def expect(self, sent, *answers):
        self.script.append((sent, answers))

    def arrive(self, *frames):
        for line in frames:
            identifier, _, data = line.partition("#")
            self.inbox.append(Frame(int(identifier, 16), bytes.fromhex(data), 0.0))

    def send(self, message, timeout=None):
        line = f"{message.arbitration_id:03x}#{bytes(message.data).hex(' ')}"
        self.sent.append(line)
        if self.script and self.script[0][0] == line:
            self.arrive(*self.script.pop(0)[1])

    def recv(self, timeout=None):
        return self.inbox.pop(0) if self.inbox else None


class Clock:
    """Time that passes when it is let pass; `at` holds frames that arrive then."""

    def __init__(self, bus):
        self.time, self.bus, self.at = 0.0, bus, []

    def now(self):
        return self.time

    def let_pass(self, seconds):
        self.time += seconds
        while self.at and self.at[0][0] <= self.time + 1e-9:
            self.bus.arrive(self.at.pop(0)[1])


@pytest.fixture
def scripted():
    bus = ScriptedBus()
    clock = Clock(bus)
    link = Link(bus, clock, {1: "axis_1 (node 1)", 2: "axis_2 (node 2)"})
    return SimpleNamespace(bus=bus, clock=clock, link=link)


class Integrators:
    """Double integrators J dv/dt = torque under a PI speed loop; noise from the seed as for the real plant."""

    def __init__(self, n_axis, position_noise=0.0, torque_noise=0.0, torque_limit=np.inf):
        self.n_axis = n_axis
        self.noise = position_noise, torque_noise
        self.limit = torque_limit
        self.inertia = 1e-3 * (1 + np.arange(n_axis))

    def rest(self, motor_angle):
        self.angle, self.speed = np.array(motor_angle, dtype=float), np.zeros(self.n_axis)
        self.sum = np.zeros(self.n_axis)

    def track(self, speed_reference, seed):
        position, torque = np.empty_like(speed_reference), np.empty_like(speed_reference)
        for k, wanted in enumerate(speed_reference):
            error = wanted - self.speed
            self.sum = self.sum + error
            pull = np.clip(self.inertia * (200 * error + 2 * self.sum), -self.limit, self.limit)
            position[k], torque[k] = self.angle, pull
            acceleration = pull / self.inertia
            self.angle = self.angle + 1e-3 * self.speed + 0.5e-6 * acceleration
            self.speed = self.speed + 1e-3 * acceleration
        generator = np.random.default_rng(seed)
        q = generator.standard_normal(position.shape) * self.noise[0]
        return position + q, torque + generator.standard_normal(torque.shape) * self.noise[1]


@dataclass
class RobotDouble:
    """What drives ask of a robot."""

    n_axis: int = 2
    name: str = "double"
    sample_time_s: float = 1e-3
    position_noise: float = 0.0
    torque_noise: float = 0.0
    torque_limit: float = 30.0
    encoder_counts: int = 2**16
    clip: bool = False
    axis_names: tuple[str, ...] = field(init=False)

    def __post_init__(self):
        ones = np.ones(self.n_axis)
        self.axis_names = tuple(f"axis_{axis + 1}" for axis in range(self.n_axis))
        self.limits = MotionLimits(self.axis_names, -1e3 * ones, 1e3 * ones, 400 * ones, 1e6 * ones)
        self.drives = SimpleNamespace(
            torque_limit=self.torque_limit * ones,
            torque_noise=self.torque_noise * ones,
            encoder_counts=self.encoder_counts * ones,
        )

    def plant(self):
        limit = self.torque_limit if self.clip else np.inf
        return Integrators(self.n_axis, self.position_noise, self.torque_noise, limit)

    def motor_angle(self, angle):
        return 100.0 * np.asarray(angle)

    def to_yaml(self):
        return "name: double\n"


@pytest.fixture
def make_robot():
    return RobotDouble


def experiment_for(robot, *, n_sample=150, periods=3, traced=2, seed=5, scale=1.0, unit=1e-6):
    """A cleared experiment whose reference is whole increments of the virtual drive's velocity unit."""
    phase = 2 * np.pi * np.arange(n_sample)[:, None] / n_sample
    order = 1 + np.arange(robot.n_axis)
    reference = scale * (3 * np.sin(phase * order) + 2 * np.cos(phase * (order + 3)))
    reference = np.rint(reference / unit) * unit
    start = 10.0 + np.arange(robot.n_axis)
    clearance = clear_motion(start, reference, robot.sample_time_s, periods, robot.limits)
    return Experiment("test", start, reference, periods, traced, robot.sample_time_s, seed, clearance)


@pytest.fixture
def make_experiment():
    return experiment_for


@pytest.fixture
def make_session():
    return lambda robot, raw_log=None: Session(robot, logging.getLogger("test"), raw_log, lambda text: None)


@pytest.fixture
def open_can(make_session):
    """Open CAN drives over a robot double, without loading a robot from a file."""

    def opened(robot, raw_log=None, **settings):
        node_ids = tuple(range(1, robot.n_axis + 1))
        expected = expected_drives(robot, node_ids, node_ids)
        return OpenCanDrives(
            CanDrives(plant="double", **settings), make_session(robot, raw_log), robot, expected
        )

    return opened


@pytest.fixture
def loop(make_robot):
    """Host and drive system on one virtual bus, both in reach of the test; `cross` sees every frame."""
    ends = []

    def built(robot=None, *, node_ids=None, plates=None, expected=None, log=None):
        robot = robot or make_robot()
        ids = tuple(range(1, robot.n_axis + 1))
        channel = f"test-{len(ends)}-{id(robot)}"
        ends.extend([VirtualEnd(channel), VirtualEnd(channel)])
        system = DriveSystem(ends[-1], robot.plant(), plates or nameplates(robot), node_ids or ids)
        drives = expected or [ExpectedDrive(f"axis_{i}", i, i, 400.0) for i in ids]
        names = {d.node_id: f"{d.axis_name} (node {d.node_id})" for d in drives}
        link = Link(ends[-2], LockStep(system), names, log)
        host = Host(link, drives, dictionary.virtual_drive_dictionary())
        return SimpleNamespace(
            host=host, link=link, system=system, robot=robot, channel=channel, nodes=system.nodes
        )

    yield built
    for end in ends:
        end.shutdown()


@pytest.fixture
def nameplate():
    return Nameplate(serial_number=7, encoder_increments=4096, rated_torque_mnm=2000, saturated_torque_nm=5.0)


@pytest.fixture
def plain_bus():
    """An end of python-can's own, for a third party on a channel."""
    ends = []

    def opened(channel):
        ends.append(can.Bus(interface="virtual", channel=channel))
        return ends[-1]

    yield opened
    for end in ends:
        end.shutdown()
