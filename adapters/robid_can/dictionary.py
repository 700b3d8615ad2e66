"""The object dictionary that host and drive share: objects of CiA 301 and 402 by number, and their scales.

Types, access and default values stand in an EDS file (CiA 306); `virtual_drive.eds`, packaged here, is that
of the virtual drive. Scales are read from the drive, never assumed: increments per turn from 0x608F, the
velocity unit from 0x60A9 (notation of CiA 303-2), the torque unit from 0x6076.
"""

from __future__ import annotations

import enum
import functools
import io
from dataclasses import dataclass
from importlib import resources

import canopen
import numpy as np
import numpy.typing as npt
from canopen.objectdictionary import ODVariable

from robid_core import ConfigurationError, FloatArray

IncrementArray = npt.NDArray[np.signedinteger]

# (index, subindex); CiA 301: communication profile
DEVICE_TYPE = (0x1000, 0)
ERROR_REGISTER = (0x1001, 0)
CONSUMER_HEARTBEAT = (0x1016, 1)  # node id in bits 16 to 22, time in ms in bits 0 to 15
PRODUCER_HEARTBEAT = (0x1017, 0)  # ms
VENDOR_ID = (0x1018, 1)
PRODUCT_CODE = (0x1018, 2)
REVISION_NUMBER = (0x1018, 3)
SERIAL_NUMBER = (0x1018, 4)
# CiA 402: drives and motion control
ABORT_CONNECTION_OPTION = (0x6007, 0)  # 0 nothing, 1 fault, 2 disable voltage, 3 quick stop
ERROR_CODE = (0x603F, 0)
CONTROLWORD = (0x6040, 0)
STATUSWORD = (0x6041, 0)
QUICK_STOP_OPTION = (0x605A, 0)  # 1 to 4: then voltage off; 5 to 8: stay in quick stop active
FAULT_REACTION_OPTION = (0x605E, 0)  # 0 voltage off, 2 quick stop ramp
MODE = (0x6060, 0)
MODE_DISPLAY = (0x6061, 0)
POSITION_ACTUAL = (0x6064, 0)
VELOCITY_ACTUAL = (0x606C, 0)
RATED_TORQUE = (0x6076, 0)  # mN m
TORQUE_ACTUAL = (0x6077, 0)  # per mille of rated torque
TARGET_POSITION = (0x607A, 0)
MAX_PROFILE_VELOCITY = (0x607F, 0)
PROFILE_VELOCITY = (0x6081, 0)
QUICK_STOP_DECELERATION = (0x6085, 0)  # in the velocity unit per second
ENCODER_INCREMENTS = (0x608F, 1)
ENCODER_REVOLUTIONS = (0x608F, 2)
VELOCITY_UNIT = (0x60A9, 0)
PERIOD_VALUE = (0x60C2, 1)
PERIOD_INDEX = (0x60C2, 2)  # sampling time = value * 10**index seconds
TARGET_VELOCITY = (0x60FF, 0)
SUPPORTED_MODES = (0x6502, 0)
# Of the virtual drive's maker: memories for a reference and a trace
REFERENCE_MEMORY = (0x2100, 0)
TRACE_PERIODS = (0x2101, 1)
TRACE_KEPT = (0x2101, 2)
TRACE_COMMAND = (0x2101, 3)
TRACE_STATE = (0x2102, 1)
TRACE_SAMPLES = (0x2102, 2)
TRACE_SATURATED = (0x2102, 3)
TRACE_CLOCK = (0x2102, 4)  # us
TRACE_TORQUE_INCREMENTS = (0x2102, 5)  # increments of the trace that make the rated torque
TRACE_MEMORY = (0x2103, 0)

PROFILE_POSITION = 1  # CiA 402: modes of operation
CYCLIC_SYNCHRONOUS_VELOCITY = 9

REFERENCE_SAMPLE = np.dtype("<i4")
TRACE_ROW = np.dtype([("position", "<i4"), ("torque", "<i2")])  # 6 bytes, packed


class TraceState(enum.IntEnum):
    """What object 0x2102:01 says."""

    EMPTY = 0
    ARMED = 1
    RUNNING = 2
    COMPLETE = 3
    ABORTED = 4


_UNITS = {  # CiA 303-2: codes of SI units, in rad and in s
    "numerator": {0x10: 1.0, 0xB4: 2 * np.pi},  # radian, revolution
    "denominator": {0x03: 1.0, 0x47: 60.0},  # second, minute
}


def velocity_unit(code: int) -> float:
    """Unit of velocity objects in rad/s from the value of 0x60A9.

    Bits 31..24 hold the power of ten (signed), 23..16 the numerator, 15..8 the denominator (CiA 402-2).
    Raises ConfigurationError for a unit that is not radians or revolutions per second or minute.
    """
    exponent = int(np.uint8(code >> 24).astype(np.int8))
    numerator = _UNITS["numerator"].get(code >> 16 & 0xFF)
    denominator = _UNITS["denominator"].get(code >> 8 & 0xFF)
    if numerator is None or denominator is None:
        raise ConfigurationError(
            f"0x60A9: the velocity unit 0x{code:08X} is neither rad nor revolutions per second or minute; "
            "set the drive's SI unit velocity to one of them"
        )
    return float(10.0**exponent * numerator / denominator)


@dataclass(frozen=True)
class Scale:
    """What one increment of a drive's objects means at the motor shaft."""

    position: float  # rad per encoder increment
    velocity: float  # rad/s per unit of 0x60FF, 0x6081, 0x607F and the reference memory
    torque: float  # N m per increment of the trace memory

    @classmethod
    def read(cls, values: dict[tuple[int, int], int]) -> Scale:
        """Compute the scale from 0x608F, 0x60A9, 0x6076 and 0x2102:05."""
        increments = values[ENCODER_INCREMENTS]
        per_rated = values[TRACE_TORQUE_INCREMENTS]
        if not (increments > 0 and per_rated > 0 and values[RATED_TORQUE] > 0):
            raise ConfigurationError(
                "0x608F, 0x6076 or 0x2102:05 is zero: the drive does not know its encoder or rated torque; "
                "commission it first"
            )
        return cls(
            position=2 * np.pi * values[ENCODER_REVOLUTIONS] / increments,
            velocity=velocity_unit(values[VELOCITY_UNIT]),
            torque=values[RATED_TORQUE] * 1e-3 / per_rated,
        )


SCALE_OBJECTS = (
    ENCODER_INCREMENTS,
    ENCODER_REVOLUTIONS,
    VELOCITY_UNIT,
    RATED_TORQUE,
    TRACE_TORQUE_INCREMENTS,
)


def increments(value: FloatArray, unit: float, dtype: type[np.signedinteger]) -> IncrementArray:
    """Round values to whole increments; beyond the range of `dtype` they stay at its end."""
    limits = np.iinfo(dtype)
    counts: npt.NDArray[np.signedinteger] = np.clip(np.rint(value / unit), limits.min, limits.max).astype(
        dtype
    )
    return counts


def packaged_eds() -> str:
    """Return the text of the virtual drive's EDS file."""
    return (resources.files("robid_can") / "virtual_drive.eds").read_text(encoding="ascii")


@functools.cache
def virtual_drive_dictionary() -> canopen.ObjectDictionary:
    """Return the virtual drive's object dictionary; the same object to every caller, to be read only."""
    eds = io.StringIO(packaged_eds())
    eds.name = "virtual_drive.eds"
    return canopen.import_od(eds)


def variable(dictionary: canopen.ObjectDictionary, key: tuple[int, int]) -> ODVariable:
    """Return the description of an object; ConfigurationError where the EDS has none."""
    found = dictionary.get_variable(*key)
    if found is None:
        raise ConfigurationError(
            f"the object dictionary has no object 0x{key[0]:04X}:{key[1]:02X}; is it the EDS of this drive?"
        )
    return found
