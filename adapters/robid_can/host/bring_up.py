"""From a silent bus to enabled drives: find, identify, configure and read back, start, enable.

Nothing moves here; whatever does not fit is refused with the object, its value and what is wanted.
"""

from __future__ import annotations

from collections.abc import Sequence

import canopen

from robid_can import dictionary as od
from robid_can.host import state, watch
from robid_can.host.link import Link
from robid_can.host.remote import RemoteDrive
from robid_can.host.stopping import STOP_S

PRESENCE_S = 1.0  # by then every node has reported after a reset
PROFILE_SPEED_SHARE = 0.2  # of the speed limit, for moves to a start position
MOST_STEPS = 10  # controlwords from any state to operation enabled
QUICK_STOP_ON_LOSS = 3  # 0x6007
STOP_RAMP_THEN_OFF = 2  # 0x605A and 0x605E
START, RESET_COMMUNICATION = 0x01, 0x82  # CiA 301: NMT commands


def find(link: Link, drives: Sequence[RemoteDrive], bitrate: int) -> None:
    """Reset communication and see that every node boots up exactly once."""
    boot_ups = link.watch.boot_ups
    link.collect()
    boot_ups.update(dict.fromkeys(boot_ups, 0))  # what booted before does not count
    link.nmt.send_command(RESET_COMMUNICATION)
    link.until(lambda: all(boot_ups.values()), PRESENCE_S)
    missing = [drive.name for drive in drives if not boot_ups[drive.expected.node_id]]
    if missing:
        where = "anyone" if len(missing) == len(drives) else ", ".join(missing)
        raise link.failure(
            f"B14: no sign of life from {where} at {bitrate} bit/s; check power, cable, bit rate and node ids"
        )
    for drive in drives:
        if boot_ups[drive.expected.node_id] > 1:
            raise link.failure(f"B12: more than one node answers as {drive.name}; give each its own id")


def identify(link: Link, drive: RemoteDrive, dictionary: canopen.ObjectDictionary) -> None:
    """Compare 0x1018 with the EDS and the serial number with what is expected."""
    device = dictionary.device_information
    wanted = {
        "vendor id": (od.VENDOR_ID, device.vendor_number),
        "product code": (od.PRODUCT_CODE, device.product_number),
        "revision": (od.REVISION_NUMBER, device.revision_number),
        "serial number": (od.SERIAL_NUMBER, drive.expected.serial_number),
    }
    for what, (key, value) in wanted.items():
        if value is not None and (found := drive.read(key)) != value:
            raise link.failure(
                f"B12: {drive.name} has the {what} {found} (0x{found:X}), wanted is {value} (0x{value:X}); "
                "are node ids swapped, or is it another drive?"
            )


def configure(link: Link, drive: RemoteDrive, sample_time_s: float) -> None:
    """Write what the run needs and what the drive shall do without a host; read all of it back."""
    drive.scale = od.Scale.read({key: drive.read(key) for key in od.SCALE_OBJECTS})
    limit = drive.expected.speed_limit / drive.scale.velocity
    wanted = {
        od.PRODUCER_HEARTBEAT: round(watch.HEARTBEAT_S * 1e3),
        od.CONSUMER_HEARTBEAT: watch.HOST_NODE_ID << 16 | round(watch.SILENCE_S * 1e3),
        od.ABORT_CONNECTION_OPTION: QUICK_STOP_ON_LOSS,
        od.QUICK_STOP_OPTION: STOP_RAMP_THEN_OFF,
        od.FAULT_REACTION_OPTION: STOP_RAMP_THEN_OFF,
        od.MAX_PROFILE_VELOCITY: min(int(limit), 2**32 - 1),
        od.PROFILE_VELOCITY: min(int(PROFILE_SPEED_SHARE * limit), 2**32 - 1),
        od.MODE: od.PROFILE_POSITION,
    }
    for key, value in wanted.items():
        drive.write(key, value)
    microseconds = round(sample_time_s * 1e6)
    exponent = -3 if microseconds % 1000 == 0 else -6
    wanted |= {od.PERIOD_VALUE: round(sample_time_s * 10**-exponent), od.PERIOD_INDEX: exponent}
    for key, value in wanted.items():
        if (found := drive.read(key)) != value:
            raise link.failure(
                f"D08: {drive.name}: object 0x{key[0]:04X}:{key[1]:02X} is {found} after {value} was written "
                "or asked for; this drive cannot be supervised as the run needs"
            )


def see_ramp(link: Link, drive: RemoteDrive) -> None:
    """Refuse a drive whose quick-stop ramp takes longer from the speed limit than a stop may."""
    ramp = drive.read(od.QUICK_STOP_DECELERATION) * drive.scale.velocity
    if drive.expected.speed_limit > ramp * STOP_S:
        raise link.failure(
            f"D08: {drive.name}: the quick-stop ramp 0x6085:00 is {ramp:.4g} rad/s^2, which takes more than {STOP_S:g} "
            f"s from the speed limit of {drive.expected.speed_limit:.4g} rad/s; commission a steeper one, "
            f"{drive.expected.speed_limit / STOP_S:.4g} rad/s^2 or more"
        )


def start(link: Link, drives: Sequence[RemoteDrive]) -> None:
    """Bring all nodes to operational and begin to miss their heartbeats."""
    link.nmt.send_command(START)
    states = link.watch.nmt_state
    link.until(
        lambda: all(states.get(d.expected.node_id) == watch.OPERATIONAL for d in drives), watch.SILENCE_S
    )
    for drive in drives:
        if states.get(drive.expected.node_id) != watch.OPERATIONAL:
            raise link.failure(f"B14: no heartbeat of {drive.name} says operational after the start command")
    link.watch.expected_state = watch.OPERATIONAL


def see_no_fault(link: Link, drive: RemoteDrive) -> str:
    """Return the state of a drive that is not in fault; one in fault stays there: a person resets it."""
    shown, _ = drive.state()
    if shown in (state.FAULT, state.FAULT_REACTION_ACTIVE):
        code = drive.read(od.ERROR_CODE)
        raise link.failure(
            f"D05: {drive.name} is in fault (0x{code:04X}); find the cause and reset it by hand"
        )
    return shown


def enable(link: Link, drive: RemoteDrive) -> None:
    """Walk the state machine up to operation enabled, target position where the motor stands."""
    drive.write(od.TARGET_POSITION, drive.read(od.POSITION_ACTUAL))
    for _ in range(MOST_STEPS):
        shown = see_no_fault(link, drive)
        if shown == state.OPERATION_ENABLED:
            return
        controlword = state.towards_enabled(shown)
        if controlword is None and shown == state.NOT_READY_TO_SWITCH_ON:
            link.wait()
        else:
            drive.write(od.CONTROLWORD, state.DISABLE_VOLTAGE if controlword is None else controlword)
    raise link.failure(f"D07: {drive.name} does not reach operation enabled, it shows '{drive.state()[0]}'")
