"""What a statusword says, and which controlword leads on (CiA 402-2, power drive state machine).

Pure functions; a statusword that shows no state of the standard is told, never taken for one.
"""

from __future__ import annotations

from typing import Final

NOT_READY_TO_SWITCH_ON: Final = "not ready to switch on"
SWITCH_ON_DISABLED: Final = "switch on disabled"
READY_TO_SWITCH_ON: Final = "ready to switch on"
SWITCHED_ON: Final = "switched on"
OPERATION_ENABLED: Final = "operation enabled"
QUICK_STOP_ACTIVE: Final = "quick stop active"
FAULT_REACTION_ACTIVE: Final = "fault reaction active"
FAULT: Final = "fault"

# (mask, value, state): CiA 402-2, table of the statusword
_PATTERNS = (
    (0x4F, 0x00, NOT_READY_TO_SWITCH_ON),
    (0x4F, 0x40, SWITCH_ON_DISABLED),
    (0x6F, 0x21, READY_TO_SWITCH_ON),
    (0x6F, 0x23, SWITCHED_ON),
    (0x6F, 0x27, OPERATION_ENABLED),
    (0x6F, 0x07, QUICK_STOP_ACTIVE),
    (0x4F, 0x0F, FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, FAULT),
)

SHUTDOWN, SWITCH_ON, ENABLE_OPERATION = 0x06, 0x07, 0x0F
DISABLE_VOLTAGE, QUICK_STOP = 0x00, 0x02
NEW_SET_POINT = 0x10  # profile position mode; with it the target is absolute
TARGET_REACHED, SET_POINT_ACKNOWLEDGE = 0x0400, 0x1000  # statusword

# The way up, one controlword per state; there is none out of fault: a person resets it
_TOWARDS_ENABLED = {
    SWITCH_ON_DISABLED: SHUTDOWN,
    READY_TO_SWITCH_ON: SWITCH_ON,
    SWITCHED_ON: ENABLE_OPERATION,
}


def state_of(statusword: int) -> str | None:
    """Return the state that a statusword shows, or None where it shows none of the eight."""
    return next((state for mask, value, state in _PATTERNS if statusword & mask == value), None)


def towards_enabled(state: str | None) -> int | None:
    """Return the controlword that leads one step towards operation enabled, None where there is none."""
    return _TOWARDS_ENABLED.get(state or "")
