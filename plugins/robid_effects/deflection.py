"""A corner in the torque over the deflection of a spring, rounded.

Catalogue curves, soft zones and backlash are sums of ramps. A ramp is rounded by a parabola within a stated
radius, exact outside of it, so that its slope rises linearly.
"""

from __future__ import annotations

from robid_core.mechanics import kernel

SMALLEST_RADIUS = 1e-12
"""rad; a corner is never sharper."""


@kernel
def rounded_ramp(x, radius):  # type: ignore[no-untyped-def]
    """(max(x, 0) with its corner rounded within +-radius, its slope); at the corner radius / 4 above."""
    inside = min(max(x + radius, 0.0), 2.0 * radius)
    slope = inside / (2.0 * radius)
    return 0.5 * inside * slope + max(x - radius, 0.0), slope
