"""One virtual drive: NMT, heartbeat, EMCY, its objects and its state machine.

The drive knows its own axis only; what moves is the `Axis` that the drive system lends it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from robid_can import dictionary as od
from robid_can.drive.objects import INVALID_VALUE, WRONG_STATE, ObjectStore, SdoAbort
from robid_can.drive.sdo_server import SdoServer
from robid_can.drive.state_machine import QUICK_STOP_STAYS, State, follow, statusword
from robid_can.drive.trace import TraceMemory

SEND_EMCY, SEND_SDO, SEND_HEARTBEAT = 0x080, 0x580, 0x700  # CiA 301: predefined connection set
PRE_OPERATIONAL, OPERATIONAL, STOPPED = 0x7F, 0x05, 0x04  # CiA 301: NMT states in a heartbeat
START, STOP, ENTER_PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 0x01, 0x02, 0x80, 0x81, 0x82
NEW_SET_POINT = 0x10  # controlword, profile position mode
HEARTBEAT_LOST = 0x8130  # CiA 301: EMCY error codes
REFERENCES_DIFFER = 0x6320  # parameter error
SUPPORTED = (od.PROFILE_POSITION, od.CYCLIC_SYNCHRONOUS_VELOCITY)


@dataclass(frozen=True)
class Nameplate:
    """What is particular to one drive and its motor."""

    serial_number: int
    encoder_increments: int  # per turn
    rated_torque_mnm: int
    saturated_torque_nm: float  # from here on a measured torque counts as limited
    quick_stop_deceleration: float = 1000.0  # rad/s^2, as commissioned


class Axis(Protocol):
    """The motor that a drive moves: angles in rad, speeds in rad/s."""

    @property
    def angle(self) -> float:
        """Where the motor stands."""

    @property
    def speed(self) -> float:
        """How fast it turns."""

    @property
    def moving(self) -> bool:
        """Whether a move to a target is under way."""

    def move_to(self, angle: float, speed: float) -> None:
        """Begin a move."""

    def slow_down(self, deceleration: float) -> int:
        """Drop what was under way and ramp down to rest, rad/s^2; return when the motor is there, us."""

    def halt(self) -> None:
        """Drop what was under way and stand still here."""


class DriveNode:
    """A CANopen node with the profile of CiA 402; frames go out through `send(identifier, payloads)`."""

    def __init__(
        self,
        node_id: int,
        nameplate: Nameplate,
        axis: Axis,
        sample_time_s: float,
        send: Callable[[int, Sequence[bytes]], None],
    ) -> None:
        self.node_id = node_id
        self.nameplate = nameplate
        self.axis = axis
        self.mute = False  # a broken drive for tests and drills: hears everything, says nothing
        self.deaf = False  # another: answers, but and obeys no order to stop
        self._send = send
        self._sample_time_us = round(sample_time_s * 1e6)
        identity = {
            od.SERIAL_NUMBER: nameplate.serial_number,
            od.ENCODER_INCREMENTS: nameplate.encoder_increments,
            od.RATED_TORQUE: nameplate.rated_torque_mnm,
        }
        self.objects = ObjectStore(od.virtual_drive_dictionary(), identity)
        self.scale = od.Scale.read({key: self.objects.number(key) for key in od.SCALE_OBJECTS})
        deceleration = nameplate.quick_stop_deceleration / self.scale.velocity
        self.objects.values[od.QUICK_STOP_DECELERATION] = round(min(max(deceleration, 1), 2**32 - 1))
        self.trace = TraceMemory(self.objects, self.scale, nameplate.saturated_torque_nm)
        self._connect_objects()
        self.boot(0)

    def boot(self, now_us: int) -> None:
        """Start as after power on: boot-up message, pre-operational, voltage off."""
        self.state = State.SWITCH_ON_DISABLED  # 0 and 1 are automatic
        self._controlword = 0
        self._acknowledge = False
        self._rest_us: int | None = None  # when a ramp ends, and in which state the drive is then
        self._state_at_rest = self.state
        self.trace.disarm()
        self.axis.halt()
        self.nmt_state = PRE_OPERATIONAL
        self.sdo = SdoServer(self.objects, lambda frames: self.say(SEND_SDO, frames))
        for key in (od.PRODUCER_HEARTBEAT, od.CONSUMER_HEARTBEAT, od.MODE):
            self.objects.values[key] = 0
        self._next_heartbeat_us: int | None = None
        self._heard_us: int | None = None
        self.now_us = now_us
        self.say(SEND_HEARTBEAT, [b"\x00"])

    def say(self, service: int, payloads: Sequence[bytes]) -> None:
        """Send frames on one of this node's identifiers."""
        if not self.mute:
            self._send(service + self.node_id, payloads)

    def _connect_objects(self) -> None:
        store = self.objects
        store.on_read[od.STATUSWORD] = self._statusword
        store.on_read[od.MODE_DISPLAY] = lambda: store.number(od.MODE)
        store.on_read[od.POSITION_ACTUAL] = lambda: round(self.axis.angle / self.scale.position)
        store.on_read[od.VELOCITY_ACTUAL] = lambda: round(self.axis.speed / self.scale.velocity)
        store.on_write[od.CONTROLWORD] = self._obey
        store.on_write[od.MODE] = self._set_mode
        store.on_write[od.PERIOD_VALUE] = lambda value: self._check_period(value, None)
        store.on_write[od.PERIOD_INDEX] = lambda index: self._check_period(None, index)
        store.on_write[od.PRODUCER_HEARTBEAT] = self._start_heartbeat
        store.on_write[od.TRACE_COMMAND] = self._arm

    # What the host may ask

    def _statusword(self) -> int:
        reached = not self.axis.moving and self.axis.speed == 0
        return statusword(self.state, target_reached=reached, acknowledge=self._acknowledge)

    def _obey(self, controlword: int) -> None:
        before, previous = self.state, self._controlword
        option = self.objects.number(od.QUICK_STOP_OPTION)
        after = follow(before, controlword, previous, option)
        if self.deaf and before is State.OPERATION_ENABLED is not after:
            return
        self.state, self._controlword = after, controlword
        self._leave(before)
        in_profile = self.objects.number(od.MODE) == od.PROFILE_POSITION
        if self.state is State.OPERATION_ENABLED and in_profile:
            if controlword & NEW_SET_POINT and not previous & NEW_SET_POINT:
                self.axis.move_to(
                    self.objects.number(od.TARGET_POSITION) * self.scale.position,
                    self.objects.number(od.PROFILE_VELOCITY) * self.scale.velocity,
                )
            self._acknowledge = bool(controlword & NEW_SET_POINT)

    def _leave(self, before: State) -> None:
        """Stop where operation ended: a quick stop takes its ramp, everything else switches the voltage off."""
        option = self.objects.number(od.QUICK_STOP_OPTION)
        if self.state is before or self.state is State.OPERATION_ENABLED:
            return
        self.trace.disarm()
        if self.state is State.QUICK_STOP_ACTIVE and option:  # 0: voltage off at once
            stays = option in QUICK_STOP_STAYS
            self._ramp_down(State.QUICK_STOP_ACTIVE if stays else State.SWITCH_ON_DISABLED)  # 12
        elif before in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE):
            self.state = State.SWITCH_ON_DISABLED if self.state is State.QUICK_STOP_ACTIVE else self.state
            self._rest_us = None
            self.axis.halt()

    def _ramp_down(self, state_at_rest: State) -> None:
        """Ramp down by 0x6085; the state changes when the motor stands."""
        self._state_at_rest = state_at_rest
        if self.axis.speed == 0:
            self.axis.halt()
            self.state = state_at_rest
        else:
            ramp = self.objects.number(od.QUICK_STOP_DECELERATION) * self.scale.velocity
            self._rest_us = self.axis.slow_down(ramp)

    def _set_mode(self, mode: int) -> None:
        if mode not in SUPPORTED:
            raise SdoAbort(INVALID_VALUE)
        if self.axis.moving or self.axis.speed:
            raise SdoAbort(WRONG_STATE)

    def _check_period(self, value: int | None, index: int | None) -> None:
        value = self.objects.number(od.PERIOD_VALUE) if value is None else value
        index = self.objects.number(od.PERIOD_INDEX) if index is None else index
        if round(value * 10.0 ** (index + 6)) != self._sample_time_us:
            raise SdoAbort(INVALID_VALUE)  # the control loop of this drive has one period

    def _arm(self, command: int) -> None:
        if command not in (0, 1):
            raise SdoAbort(INVALID_VALUE)
        ready = (
            self.state is State.OPERATION_ENABLED
            and self.objects.number(od.MODE) == od.CYCLIC_SYNCHRONOUS_VELOCITY
            and self.nmt_state == OPERATIONAL
        )
        if command and not ready:
            raise SdoAbort(WRONG_STATE)
        self.trace.arm(bool(command))

    # Faults and lost communication

    def fault(self, code: int) -> None:
        """Stop as 0x605E says because of an error of the drive (13, 14); an EMCY tells at once."""
        self.objects.values[od.ERROR_CODE] = code
        self.objects.values[od.ERROR_REGISTER] = 1
        self.say(SEND_EMCY, [struct.pack("<HB5x", code, 1)])
        self.trace.disarm()
        if self.objects.number(od.FAULT_REACTION_OPTION):
            self.state = State.FAULT_REACTION_ACTIVE
            self._ramp_down(State.FAULT)
        else:
            self._rest_us, self.state = None, State.FAULT
            self.axis.halt()

    def _lose_host(self) -> None:
        """Tell that the host is silent and react."""
        self._heard_us = None
        if self.objects.number(od.ABORT_CONNECTION_OPTION) != 1:  # a fault brings its own EMCY
            self.say(SEND_EMCY, [struct.pack("<HB5x", HEARTBEAT_LOST, 0x11)])
        self._abort_connection()

    def _abort_connection(self) -> None:
        """React to a lost host or to being stopped by network management as 0x6007 asks."""
        option, before = self.objects.number(od.ABORT_CONNECTION_OPTION), self.state
        if self.deaf:
            return
        if option == 1:
            self.fault(HEARTBEAT_LOST)
        elif option in (2, 3):
            quick_stop = self.objects.number(od.QUICK_STOP_OPTION)
            self.state = follow(before, 0x00 if option == 2 else 0x02, 0, quick_stop)
            self._leave(before)

    # Network management and time

    def command(self, data: bytes, now_us: int) -> None:
        """Take an NMT command; `data` is command and node id, 0 for all."""
        if len(data) != 2 or data[1] not in (0, self.node_id):
            return
        if data[0] in (RESET_NODE, RESET_COMMUNICATION):
            self.boot(now_us)
        wanted = {START: OPERATIONAL, STOP: STOPPED, ENTER_PRE_OPERATIONAL: PRE_OPERATIONAL}.get(data[0])
        if wanted is None:
            return
        before, self.nmt_state = self.state, wanted
        if wanted == STOPPED:
            self._abort_connection()
        elif wanted != OPERATIONAL and before is State.OPERATION_ENABLED and not self.deaf:
            self.state = State.SWITCH_ON_DISABLED
            self._leave(before)

    def request(self, requests: Sequence[bytes]) -> None:
        """Take SDO requests; a stopped node has no SDO."""
        if self.nmt_state != STOPPED:
            self.sdo.receive(requests)

    def hear_heartbeat(self, node_id: int, now_us: int) -> None:
        """Note that another node lives."""
        if self.objects.number(od.CONSUMER_HEARTBEAT) >> 16 & 0x7F == node_id:
            self._heard_us = now_us

    def _start_heartbeat(self, period_ms: int) -> None:
        self._next_heartbeat_us = self.now_us if period_ms else None

    def next_event_us(self) -> int | None:
        """Return when this drive wants to act by itself."""
        times = [self._next_heartbeat_us, self._deadline_us(), self._rest_us]
        return min((time for time in times if time is not None), default=None)

    def _deadline_us(self) -> int | None:
        limit_ms = self.objects.number(od.CONSUMER_HEARTBEAT) & 0xFFFF
        return None if self._heard_us is None or not limit_ms else self._heard_us + 1000 * limit_ms

    def act(self, now_us: int) -> None:
        """Do what is due at this time."""
        self.now_us = now_us
        if self._rest_us is not None and now_us >= self._rest_us:
            self._rest_us, self.state = None, self._state_at_rest
        deadline = self._deadline_us()
        if deadline is not None and now_us >= deadline:
            self._lose_host()
        if self._next_heartbeat_us is not None and now_us >= self._next_heartbeat_us:
            self._next_heartbeat_us += 1000 * max(self.objects.number(od.PRODUCER_HEARTBEAT), 1)
            self.say(SEND_HEARTBEAT, [bytes([self.nmt_state])])
