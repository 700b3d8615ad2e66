"""A corner in the torque over the deflection of a spring, rounded.

Catalogue curves, soft zones and backlash are sums of ramps. A ramp is rounded by a parabola within a stated
radius, exact outside of it, so that its slope rises linearly: it is the mean of a sharp ramp over twice the radius.
Where a spring moves further than that in one step of a simulation, a law takes the mean over what it passes: summed
over steps this is the impulse of the sharp corner, wherever the samples fall. The value at each sample would be off by
up to half a step's share, by another amount at each passage: a fit sees that as roughness of its cost.
"""

from __future__ import annotations

from robid_core.mechanics import kernel, where

SMALLEST_RADIUS = 1e-12
"""rad; a corner is never sharper."""


@kernel
def swept_radius(radius, velocity, step):  # type: ignore[no-untyped-def]
    """(Radius of a corner over which a spring moves at `velocity` for one step, its slope in the velocity)."""
    half = 0.5 * abs(velocity) * step
    slope = where(half > radius, where(velocity < 0.0, -0.5 * step, 0.5 * step), 0.0)
    return max(radius, half), slope


@kernel
def rounded_ramp(x, radius):  # type: ignore[no-untyped-def]
    """(max(x, 0) with its corner rounded within +-radius, its slope); at the corner radius / 4 above."""
    inside = min(max(x + radius, 0.0), 2.0 * radius)
    slope = inside / (2.0 * radius)
    return 0.5 * inside * slope + max(x - radius, 0.0), slope


@kernel
def dead_zone(x, half, radius):  # type: ignore[no-untyped-def]
    """(What of `x` lies beyond +-half, corners rounded, its slope in `x`, its slope in the radius).

    Of both corners at any `x`: a radius may be larger than the zone.
    """
    above, share = rounded_ramp(x - half, radius)
    below, other = rounded_ramp(-x - half, radius)
    return above - below, share + other, share * (1.0 - share) - other * (1.0 - other)
