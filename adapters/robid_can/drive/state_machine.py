"""The power drive state machine of CiA 402-2: states, what a controlword does in each, the statusword.

Pure functions; transition numbers are those of the standard's figure.
"""

from __future__ import annotations

import enum

FAULT_RESET = 0x80
QUICK_STOP_STAYS = range(5, 9)  # 0x605A: option codes after which the drive stays in quick stop active


class State(enum.Enum):
    """The eight states; the value is what bits 0, 1, 2, 3, 5 and 6 of the statusword show."""

    NOT_READY_TO_SWITCH_ON = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION_ACTIVE = 0x0F
    FAULT = 0x08


POWERED = frozenset({State.SWITCHED_ON, State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE})
VOLTAGE_ENABLED = 0x0010
REMOTE = 0x0200
TARGET_REACHED = 0x0400
SET_POINT_ACKNOWLEDGE = 0x1000


def follow(state: State, controlword: int, previous: int, quick_stop_option: int = 2) -> State:
    """Return the state after a controlword.

    Commands are told by bits 0 to 3 and need bit 7 clear; fault reset is the rising edge of bit 7, hence
    `previous`. Every combination that is no command of the present state changes nothing.
    """
    if state is State.FAULT:
        reset = controlword & FAULT_RESET and not previous & FAULT_RESET
        return State.SWITCH_ON_DISABLED if reset else state  # 15
    if controlword & FAULT_RESET or state in (State.NOT_READY_TO_SWITCH_ON, State.FAULT_REACTION_ACTIVE):
        return state
    if not controlword & 0x02:  # disable voltage
        return State.SWITCH_ON_DISABLED  # 7, 9, 10, 12
    if not controlword & 0x04:  # quick stop
        return _quick_stop(state)
    return _low_bits(state, controlword & 0x09, quick_stop_option)


def _quick_stop(state: State) -> State:
    if state is State.OPERATION_ENABLED:
        return State.QUICK_STOP_ACTIVE  # 11
    if state in (State.READY_TO_SWITCH_ON, State.SWITCHED_ON):
        return State.SWITCH_ON_DISABLED  # 7, 10
    return state


def _low_bits(state: State, bits: int, quick_stop_option: int) -> State:
    """Shutdown (x110), switch on and disable operation (0111), enable operation (1111)."""
    shutdown, enable = not bits & 0x01, bits == 0x09
    if state is State.QUICK_STOP_ACTIVE:
        allowed = enable and quick_stop_option in QUICK_STOP_STAYS
        return State.OPERATION_ENABLED if allowed else state  # 16
    if shutdown:
        return State.READY_TO_SWITCH_ON  # 2, 6, 8
    if state is State.SWITCH_ON_DISABLED:
        return state
    return State.OPERATION_ENABLED if enable else State.SWITCHED_ON  # 3 and 4, 4; 3, 5


def statusword(state: State, *, target_reached: bool, acknowledge: bool) -> int:
    """Return object 0x6041."""
    word = state.value | REMOTE
    if state in POWERED:
        word |= VOLTAGE_ENABLED
    if target_reached:
        word |= TARGET_REACHED
    if acknowledge:
        word |= SET_POINT_ACKNOWLEDGE
    return word
