"""CiA 402 drives on CAN as the core's noun: a bus, the host on it, and a simulated drive system behind it.

With `plant` the bus is python-can's virtual one and nothing but a simulation moves. A real bus is refused in
this version: the host's side is the same, but the drill of faults that must come before motion on hardware
does not exist yet.
"""

from __future__ import annotations

import itertools
import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field, PositiveInt, model_validator

from robid_core import (
    ConfigurationError,
    Drives,
    Experiment,
    MotionRefused,
    Robot,
    RobotName,
    Session,
    StopNotConfirmed,
    Trace,
    Truth,
    at_safe_points,
    heed,
)

if TYPE_CHECKING:
    from robid_can.drive import DriveSystem, Nameplate
    from robid_can.host import ExpectedDrive, Host

PEAK_OVER_RATED = 3  # torque limit over rated torque of the virtual drives; common for servo motors
QUICK_STOP = 1000.0  # rad/s^2, ramp of the virtual drives: half a second from 500 rad/s
DEFAULT_INCREMENTS = 2**20  # per turn, where the robot's file knows no encoder
_sessions = itertools.count()  # two sessions of one process do not share a virtual bus


class CanDrives(Drives):
    """CiA 402 drives on a CAN bus, in trace mode: reference and sampling inside the drives.

    Example
    -------
    ::

        drives: {use: can, with: {interface: virtual, bitrate: 1000000, plant: six_axis_true}}
    """

    interface: Literal[
        "virtual", "udp_multicast", "socketcan", "pcan", "kvaser", "vector", "ixxat", "slcan"
    ] = "virtual"
    """Interface of python-can."""
    channel: str = "robid"
    """Channel of the interface, such as can0."""
    bitrate: PositiveInt = Field(default=1_000_000, ge=10_000, le=1_000_000)
    """Bit/s; simulated frames take their time on the bus too."""
    plant: RobotName | None = None
    """The robot that stands behind simulated drives; without it the drives are real."""
    node_ids: tuple[int, ...] | None = None
    """Node of each axis in order; 1, 2, 3... where absent."""
    serial_numbers: tuple[int, ...] | None = None
    """Serial number expected of each drive; any where absent."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.plant is not None and self.interface != "virtual":
            raise ValueError(
                f"a simulated plant stands behind the virtual interface only, not behind {self.interface}"
            )
        if self.plant is None and self.interface == "virtual":
            raise ValueError(
                "nothing stands behind a virtual bus without `plant:`; name a robot, six_axis_true say"
            )
        for node_id in self.node_ids or ():
            if not 1 <= node_id <= 126:  # 127 is the host's
                raise ValueError(f"{node_id} is no node id; they go from 1 to 126")
        if len(set(self.node_ids or ())) != len(self.node_ids or ()):
            raise ValueError("two axes have the same node id")
        return self

    @property
    def moves_hardware(self) -> bool:
        """False where a simulated plant stands behind the bus."""
        return self.plant is None

    def uses(self) -> list[tuple[str, str]]:
        """Return the plugins whose code a simulated motion depends on: the plant's effects."""
        if self.plant is None:
            return []
        effects = Robot.load(self.plant).description.effects.values()
        return sorted({("robid.effects", effect.use) for effect in effects})

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """A plant of another number of motors, and nodes or serial numbers that are not one for each motor."""
        found: dict[tuple[str | int, ...], str] = {}
        n_axis = robot.n_axis
        n_plant = n_axis if self.plant is None else Robot.load(self.plant).n_axis
        if n_plant != n_axis:
            motors = f"{n_plant} motor{'' if n_plant == 1 else 's'}"
            found["plant",] = f"plant '{self.plant}' has {motors}, robot '{robot.name}' has {n_axis}"
        for what, values in {"node_ids": self.node_ids, "serial_numbers": self.serial_numbers}.items():
            if values is not None and len(values) != n_axis:
                found[what,] = (
                    f"{what} has {len(values)} entries, the robot {n_axis} motor{'' if n_axis == 1 else 's'}"
                )
        return found

    def truth(self, robot: Robot) -> Truth | None:
        """Return the parameters of the simulated plant."""
        del robot
        if self.plant is None:
            return None
        parameters = Robot.load(self.plant).parameters()
        return Truth(self.plant, tuple(parameters), np.array(list(parameters.values()), dtype=float))

    def open(self, session: Session) -> OpenCanDrives:
        """Build the bus with both its sides; the drives come up when the result is entered."""
        if self.plant is None:
            raise MotionRefused(
                f"drives: no simulated plant stands behind {self.interface} '{self.channel}', so that real "
                "motors may move; this version moves simulated ones only: add `plant:` with the name of a "
                "robot (a later version will ask for `hardware: {confirm: true}` and a person at the robot)"
            )
        for message in self.problems_with(session.robot).values():
            raise ConfigurationError(f"drives: {message}")
        plant, n_axis = Robot.load(self.plant), session.robot.n_axis
        node_ids = self.node_ids or tuple(range(1, n_axis + 1))
        serial_numbers = self.serial_numbers or tuple(range(1, n_axis + 1))
        return OpenCanDrives(self, session, plant, expected_drives(session.robot, node_ids, serial_numbers))


def expected_drives(
    robot: Robot, node_ids: tuple[int, ...], serial_numbers: tuple[int, ...]
) -> list[ExpectedDrive]:
    """Return which drive the host expects at each axis."""
    from robid_can.host import ExpectedDrive

    speeds = robot.limits.speed.tolist()
    rows = zip(robot.axis_names, node_ids, serial_numbers, speeds, strict=True)
    return [ExpectedDrive(*row) for row in rows]


def nameplates(robot: Robot) -> list[Nameplate]:
    """Return the virtual drives' data from the plant's file; serial numbers 1, 2, 3...

    A measured torque within three standard deviations of its noise below the limit counts as limited.
    """
    from robid_can.drive import Nameplate

    d = robot.drives
    saturated = np.maximum(d.torque_limit - 3 * d.torque_noise, 0.9 * d.torque_limit)
    return [
        Nameplate(
            serial_number=axis + 1,
            encoder_increments=int(d.encoder_counts[axis]) or DEFAULT_INCREMENTS,
            rated_torque_mnm=int(np.ceil(1e3 * d.torque_limit[axis] / PEAK_OVER_RATED)),
            saturated_torque_nm=float(saturated[axis]),
            quick_stop_deceleration=float(min(QUICK_STOP, robot.limits.acceleration[axis])),
        )
        for axis in range(robot.n_axis)
    ]


class LockStep:
    """The simulated drive system as the host's clock: time passes when the host waits."""

    def __init__(self, system: DriveSystem) -> None:
        self._system = system

    def now(self) -> float:
        """Seconds of simulated time."""
        return self._system.time_s

    def let_pass(self, seconds: float) -> None:
        """Let the drives answer, then let time pass; a nanosecond at least, or who waits for less waits for ever."""
        if seconds:
            self._system.advance(max(seconds, 1e-9))
        else:
            self._system.process()


class OpenCanDrives:
    """Host and drives on one bus; entered, the drives are enabled; left, they are stopped and switched off."""

    def __init__(
        self, settings: CanDrives, session: Session, plant: Robot, expected: list[ExpectedDrive]
    ) -> None:
        self._settings = settings
        self._session = session
        self._plant = plant
        self._expected = expected
        self._host: Host | None = None
        self._safe_points = ExitStack()

    def _connect(self) -> Host:
        """Open both ends of the virtual bus."""
        from robid_can import dictionary
        from robid_can.drive import DriveSystem
        from robid_can.frame import VirtualEnd
        from robid_can.host import Host, Link

        channel = f"{self._settings.channel}-{next(_sessions)}"
        self._buses = [VirtualEnd(channel), VirtualEnd(channel)]
        self._system = DriveSystem(
            self._buses[1],
            self._plant.plant(),
            nameplates(self._plant),
            [drive.node_id for drive in self._expected],
            bitrate=self._settings.bitrate,
            sample_time_s=self._plant.sample_time_s,
        )
        log = self._session.raw_log
        if log is not None:
            log.attach("virtual_drive.eds", "text/plain", dictionary.packaged_eds().encode())
        names = {d.node_id: f"{d.axis_name} (node {d.node_id})" for d in self._expected}
        link = Link(self._buses[0], LockStep(self._system), names, log)
        return Host(link, self._expected, dictionary.virtual_drive_dictionary())

    def __enter__(self) -> Self:
        """Bring the drives up; whatever fails here leaves nothing switched on.

        From here on signals interrupt at safe points only: where the host waits for the bus.
        """
        self._safe_points.enter_context(at_safe_points())
        try:
            self._host = self._connect()
            self._host.bring_up(self._settings.bitrate, self._session.robot.sample_time_s)
        except BaseException:
            self.__exit__(*sys.exc_info())
            raise
        count = len(self._expected)
        enabled = "1 drive is" if count == 1 else f"{count} drives are"
        self._note(f"{enabled} enabled on {self._settings.interface} bus")
        return self

    def __exit__(self, *exception: object) -> None:
        """Stop, switch off, leave the bus; a signal that comes meanwhile interrupts afterwards: no safe point here.

        Raises StopNotConfirmed where a motor was not seen to stand still, also in place of another error.
        """
        with self._safe_points:
            host, self._host = self._host, None
            if host is not None:
                self._stop(host, exception[1] if exception else None)
        if host is not None and not any(exception):
            heed()

    def _stop(self, host: Host, cause: object) -> None:
        try:
            problems = host.stop()
        finally:
            for bus in self._buses:
                bus.shutdown()
        for problem in problems:
            self._session.log.error("drives: %s", problem)
        outcome = "; ".join(problems) or "all drives have stopped and are switched off"
        self._note(outcome)
        if isinstance(cause, KeyboardInterrupt) and not problems:
            cause.add_note(outcome)
        elif problems:
            why = "interrupted" if isinstance(cause, KeyboardInterrupt) else str(cause or "at the end")
            raise StopNotConfirmed(f"{why}; {outcome}")

    def _note(self, text: str) -> None:
        self._session.note(text)
        if self._session.raw_log is not None:
            self._session.raw_log.event(self._system.time_s, text)

    def perform(self, experiment: Experiment) -> Trace:
        """Run one cleared experiment through the bus."""
        if self._host is None:
            raise MotionRefused("drives: they are not up; enter them by `with drives.open(session)`")
        self._system.seed = experiment.seed
        return self._host.perform(experiment)
