"""The way to a standstill: all drives are told at once, then judged together by what they measure.

First a broadcast: network management stops all nodes with one frame, and 0x6007, which the preflight has set, makes
that a quick stop in each drive. Then each drive is told by its controlword, without waiting for an answer. Nobody's
silence delays the others: all are asked for their speed in turn, under one deadline, and whoever was not seen to stand
still is named. Last, the voltage is switched off everywhere, and that is looked at in the same way.

Nothing here raises for a drive or a bus that does not work; it becomes one of the problems that are returned.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robid_can import dictionary as od
from robid_can.host import state
from robid_can.host.link import Link
from robid_can.host.remote import Key, RemoteDrive

STOP_NODE, ENTER_PRE_OPERATIONAL = 0x02, 0x80  # CiA 301: NMT commands, to all nodes with node id 0
STOP_S = 2.0  # within which every motor must stand still
OFF_S = 0.5  # within which every drive must show that its voltage is off
LOOK_S = 0.01  # how often drives are asked
AT_REST = 2  # readings of zero speed in a row: one alone may be the turning point of a swing
VOLTAGE_OFF = (state.NOT_READY_TO_SWITCH_ON, state.SWITCH_ON_DISABLED, state.READY_TO_SWITCH_ON, state.FAULT)


def stop_all(link: Link, drives: Sequence[RemoteDrive]) -> list[str]:
    """Stop and switch off all drives at once; return what went wrong or was not confirmed, one line each.

    Takes STOP_S + OFF_S at most, and as long as the slowest drive where all obey.
    """
    problems: list[str] = []
    link.stopping = True
    for command in (STOP_NODE, ENTER_PRE_OPERATIONAL):  # a stopped node has no SDO, so it is let go at once
        _attempt(lambda command=command: link.send_message(0, [command, 0]), problems)  # type: ignore[misc]
    _tell(link, drives, state.QUICK_STOP, problems)
    standing = dict.fromkeys((drive.name for drive in drives), 0)

    def stands(drive: RemoteDrive, speed: int) -> bool:
        standing[drive.name] = 0 if speed else standing[drive.name] + 1
        return standing[drive.name] >= AT_REST

    turning = _look(link, drives, od.VELOCITY_ACTUAL, stands, STOP_S, problems)
    if turning:
        told = [_speed(drive, speed) for drive, speed in turning]
        problems.append(f"D06: {STOP_S:g} s after quick stop {', '.join(told)}: USE THE EMERGENCY STOP")
    _tell(link, drives, state.DISABLE_VOLTAGE, problems)
    powered = _look(link, drives, od.STATUSWORD, _is_off, OFF_S, problems)
    if powered:
        told = [_power(drive, word) for drive, word in powered]
        problems.append(f"D06: {OFF_S:g} s after switching off {', '.join(told)}: SWITCH THE POWER OFF")
    return list(dict.fromkeys(problems))


def _tell(link: Link, drives: Sequence[RemoteDrive], controlword: int, problems: list[str]) -> None:
    """Send a controlword to every drive, one frame behind the other."""
    for drive in drives:
        _attempt(lambda drive=drive: drive.send_write(od.CONTROLWORD, controlword), problems)  # type: ignore[misc]
    _attempt(lambda: link.attend(0), problems)


def _look(
    link: Link,
    drives: Sequence[RemoteDrive],
    key: Key,
    confirms: Callable[[RemoteDrive, int], bool],
    limit_s: float,
    problems: list[str],
) -> list[tuple[RemoteDrive, int | None]]:
    """Ask all drives for an object until each has confirmed; return the others with what they said last."""
    open_ones: dict[RemoteDrive, int | None] = dict.fromkeys(drives)
    for drive in drives:
        drive.last_answer(key)  # what came before does not count
    end = link.clock.now() + limit_s
    while open_ones and link.clock.now() < end:
        for drive in open_ones:
            _attempt(lambda drive=drive: drive.send_read(key), problems)  # type: ignore[misc]
        _attempt(lambda: link.attend(LOOK_S), problems)
        for drive in list(open_ones):
            answer = drive.last_answer(key)
            if answer is not None:
                open_ones[drive] = answer
                if confirms(drive, answer):
                    del open_ones[drive]
    return list(open_ones.items())


def _attempt(action: Callable[[], object], problems: list[str]) -> None:
    """Do one step; whatever it raises is noted, and the next step is done all the same."""
    try:
        action()
    except Exception as error:  # any: a bus may raise what it likes, and all drives must be told
        problems.append(str(error) or type(error).__name__)


def _is_off(drive: RemoteDrive, statusword: int) -> bool:
    del drive
    return state.state_of(statusword) in VOLTAGE_OFF


def _speed(drive: RemoteDrive, speed: int | None) -> str:
    if speed is None:
        return f"{drive.name} does not say whether it turns"
    return f"{drive.name} still turns at {abs(speed) * drive.scale.velocity:.3g} rad/s"


def _power(drive: RemoteDrive, statusword: int | None) -> str:
    if statusword is None:
        return f"{drive.name} does not say whether it is off"
    return f"{drive.name} shows '{state.state_of(statusword) or hex(statusword)}'"
