"""The safety gate: no array reaches a drive that was not checked against the robot's limits here.

A small module without plugin code. Input: the *sampled* commands, the start position and the limits; output:
a clearance that carries their hash. A sender takes only arrays whose hash stands in the clearance. A pipeline
can tighten limits, never widen them. robid is no safety function: the machine's own limits, brakes and
emergency stop remain.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.errors import MotionRefused

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class MotionLimits:
    """What a motor may do, motor side, each of shape (n_axis,); `lower` and `upper` bound its angle."""

    axis_names: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True)
class Clearance:
    """Proof that exactly these commands were checked."""

    sha256: str

    def covers(self, start: FloatArray, reference: FloatArray, sample_time_s: float, periods: int) -> bool:
        """Tell whether this motion is the one that was cleared, repetitions and clock included."""
        return self.sha256 == _digest(start, reference, sample_time_s, periods)


def _digest(start: FloatArray, reference: FloatArray, sample_time_s: float, periods: int) -> str:
    digest = hashlib.sha256(repr((float(sample_time_s), int(periods))).encode())
    for part in (start, reference):
        data = np.ascontiguousarray(part, dtype=np.float64)
        digest.update(repr(data.shape).encode())
        digest.update(data.tobytes())
    return digest.hexdigest()


def clear_motion(
    start: FloatArray, reference: FloatArray, sample_time_s: float, periods: int, limits: MotionLimits
) -> Clearance:
    """Check a periodic speed reference and sign it off.

    Parameters
    ----------
    start
        Motor angles at which the motion begins, rad, shape (n_axis,).
    reference
        One period of motor speed, rad/s, shape (n_sample, n_axis), repeated `periods` times.
    sample_time_s
        Time between samples.
    periods
        How often the reference is repeated; a reference that does not close would walk away.
    limits
        The motors' limits.

    Raises
    ------
    MotionRefused
        Where a sample leaves position, speed or acceleration limits (start and wrap included), or is NaN.
    """
    if not (np.isfinite(start).all() and np.isfinite(reference).all()):
        raise MotionRefused("D03: the commands hold NaN or infinite values; nothing was sent")
    # The speed is held from sample to sample; the motor starts and ends at rest, and the period wraps.
    rest = np.zeros_like(reference[:1])
    step = np.diff(reference, axis=0, prepend=rest, append=rest)
    if periods > 1:
        step = np.concatenate([step, reference[:1] - reference[-1:]])
    angle_in_period = np.cumsum(reference, axis=0) * sample_time_s
    drift = angle_in_period[-1] * (periods - 1)
    highest = start + np.maximum(angle_in_period.max(axis=0), 0) + np.maximum(drift, 0)
    lowest = start + np.minimum(angle_in_period.min(axis=0), 0) + np.minimum(drift, 0)
    _refuse_beyond("speed", "rad/s", np.abs(reference).max(axis=0), limits.speed, limits)
    _refuse_beyond(
        "acceleration", "rad/s^2", np.abs(step).max(axis=0) / sample_time_s, limits.acceleration, limits
    )
    _refuse_beyond("upper position", "rad", highest, limits.upper, limits)
    _refuse_beyond("lower position", "rad", -lowest, -limits.lower, limits)
    return Clearance(_digest(start, reference, sample_time_s, periods))


def _refuse_beyond(
    what: str, unit: str, reached: FloatArray, allowed: FloatArray, limits: MotionLimits
) -> None:
    beyond = np.flatnonzero(~(reached <= allowed))
    if len(beyond):
        a = int(beyond[0])
        raise MotionRefused(
            f"D03: {limits.axis_names[a]}: the commanded {what} of the motor reaches {abs(reached[a]):.4g} {unit}, "
            f"its limit is {abs(allowed[a]):.4g} {unit}; nothing was sent; lower the amplitude or move the "
            "configuration away from the limit"
        )
