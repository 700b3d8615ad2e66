"""One bristle: the step that the laws of Dahl, LuGre, Bouc-Wen and the two-state model share.

A bristle carries the torque z: ``z' = sigma v - rate |v| z``, with stiffness sigma and rate = sigma / level, so
that z tends to level sign(v) in steady sliding. At constant velocity, rate and sigma the solution is an
exponential, and the step takes it exactly: stable for any stiffness, step and speed, v = 0 included.
"""

from __future__ import annotations

from robid_core.mechanics import exponential, kernel, where

SMALLEST_LEVEL = 1e-12  # N m: a level of zero is a bristle that carries nothing, not a division by zero
_SERIES_BELOW = 0.1  # series of degree 8: remainder 0.1^9 / 10! = 3e-16; above, 1 - e^-x loses one digit


@kernel
def advance_bristle(torque, velocity, stiffness, rate, rate_slope, time):  # type: ignore[no-untyped-def]
    """Torque of the bristle after `time` and its slope in velocity.

    ``z(t) = z(0) + t v (sigma - rate sign(v) z(0)) (1 - e^-x) / x`` with x = rate t |v|: no division by the
    velocity. At v = 0 the slope is the mean of those to the left and to the right.

    Parameters
    ----------
    torque
        z(0), N m.
    velocity
        rad/s.
    stiffness
        sigma, N m/rad.
    rate
        1/rad; zero is a linear spring.
    rate_slope
        d ln(rate) / dv, s/rad.
    time
        s.
    """
    x = rate * time * abs(velocity)
    decay = exponential(-x)
    series = 1.0 - x / 7.0 * (1.0 - x / 8.0 * (1.0 - x / 9.0))
    series = 1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0 * series))
    series = 1.0 - x / 2.0 * (1.0 - x / 3.0 * series)
    mean = where(x < _SERIES_BELOW, series, (1.0 - decay) / max(x, _SERIES_BELOW))
    sign = where(velocity > 0.0, 1.0, where(velocity < 0.0, -1.0, 0.0))
    pull = stiffness - rate * sign * torque
    late_pull = pull * decay / mean
    slope = time * mean * (late_pull + velocity * rate_slope * (late_pull - stiffness))
    return torque + time * mean * velocity * pull, slope
