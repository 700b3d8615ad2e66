"""Friction with values of its own for either way: what its laws share."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_core import FloatArray
from robid_core.mechanics import kernel, smooth_sign


@kernel
def coulomb_and_viscous(velocity, coulomb, viscous, speed):  # type: ignore[no-untyped-def]
    """Torque of the values of one way, and its slope; the sign is smoothed over a speed."""
    share = smooth_sign(velocity / speed)
    return coulomb * share + viscous * velocity, coulomb / speed * (1.0 - share * share) + viscous


def by_way(shapes: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return regressors `<name>_forwards` and `<name>_backwards` of odd functions of the speed, by `<name>`."""
    ways = (("forwards", np.maximum), ("backwards", np.minimum))
    return {f"{name}_{way}": side(shape, 0.0) for way, side in ways for name, shape in shapes.items()}
