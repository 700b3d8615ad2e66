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

from robid_core.arrays import FloatArray
from robid_core.errors import MotionRefused


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
        if _flaw(start, reference, sample_time_s, periods):
            return False
        return self.sha256 == _digest(start, reference, sample_time_s, periods)


def _digest(start: FloatArray, reference: FloatArray, sample_time_s: float, periods: int) -> str:
    digest = hashlib.sha256(repr((float(sample_time_s), int(periods))).encode())
    for part in (start, reference):
        data = np.ascontiguousarray(part)
        digest.update(repr(data.shape).encode())
        digest.update(data.tobytes())
    return digest.hexdigest()


def _flaw(start: FloatArray, reference: FloatArray, sample_time_s: float, periods: int) -> str | None:
    """Say what keeps this from being a motion at all: types, shapes, values; None where it is one."""
    for name, part, n_dim in (("start", start, 1), ("reference", reference, 2)):
        if not (isinstance(part, np.ndarray) and part.dtype == np.float64 and part.ndim == n_dim):
            return f"{name} must be an array of float64 with {n_dim} dimension{'s' * (n_dim > 1)}"
        if not np.isfinite(part).all():
            return "the commands hold NaN or infinite values"
    if not (reference.size and reference.shape[1] == len(start)):
        return f"a reference of shape {reference.shape} does not fit a start of {len(start)} motors"
    if isinstance(periods, bool) or not isinstance(periods, int | np.integer) or periods < 1:
        return f"{periods!r} is no number of periods"
    number = isinstance(sample_time_s, float | int) and not isinstance(sample_time_s, bool)
    if not (number and 0 < sample_time_s < np.inf):
        return f"{sample_time_s!r} is no time between samples"
    return None


def _flaw_of_limits(limits: MotionLimits, n_axis: int) -> str | None:
    """Say which limit is none; a limit may be infinite, and never NaN or of another shape."""
    for name in ("lower", "upper", "speed", "acceleration"):
        value = getattr(limits, name)
        if not (isinstance(value, np.ndarray) and value.dtype == np.float64 and value.shape == (n_axis,)):
            return f"the {name} limit must be an array of float64 with one entry for each of {n_axis} motors"
        if np.isnan(value).any():
            return f"the {name} limit is NaN"
    if len(limits.axis_names) != n_axis:
        return f"there are {len(limits.axis_names)} names for {n_axis} motors"
    return None


def clear_motion(
    start: FloatArray, reference: FloatArray, sample_time_s: float, periods: int, limits: MotionLimits
) -> Clearance:
    """Check a periodic speed reference and sign it off.

    The speed is held from sample to sample, so that the angle turns back at sampling instants only; the motor
    starts and ends at rest, and steps there and from period to period count as acceleration.

    Parameters
    ----------
    start
        Motor angles at which the motion begins, rad, shape (n_axis,), float64.
    reference
        One period of motor speed, rad/s, shape (n_sample, n_axis), float64, repeated `periods` times.
    sample_time_s
        Time between samples, above zero.
    periods
        How often the reference is repeated, at least once; a reference that does not close walks away.
    limits
        The motors' limits.

    Raises
    ------
    MotionRefused
        Where a sample leaves position, speed or acceleration limits (start and wrap included), where a value is NaN,
        and where types or shapes are not those above.

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> still, one = np.zeros(1), np.ones(1)
    >>> limits = robid.MotionLimits(("axis_1",), -one, one, 2 * one, 1000 * one)
    >>> wave = np.sin(2 * np.pi * np.arange(1000) / 1000)[:, None]
    >>> clearance = robid.clear_motion(still, wave, 0.001, 2, limits)
    >>> clearance.covers(still, wave, 0.001, 2), clearance.covers(still, 2 * wave, 0.001, 2)
    (True, False)
    """
    flaw = _flaw(start, reference, sample_time_s, periods) or _flaw_of_limits(limits, len(start))
    if flaw:
        raise MotionRefused(f"D03: {flaw}; nothing was sent")
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
