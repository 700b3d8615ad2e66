"""The viscous part of a law is its slope without dry friction and without drag that grows with the speed."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.mechanics import ForceTerm, kernel
from robid_core.mechanics.static_laws import viscous_damping

VISCOUS = 0.02


@kernel
def mixed_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Viscous friction, drag, and dry friction that is half gone at 1 rad/s."""
    drag, dry = parameters[0] * abs(velocity), parameters[1] / (1.0 + velocity * velocity)
    force = 0.02 * velocity + drag * velocity + dry * velocity
    slope = 0.02 + 2.0 * drag + dry * (1.0 - velocity * velocity) / (1.0 + velocity * velocity)
    return force, 0.0 * position, slope


@pytest.mark.parametrize(("drag", "dry"), [(0.0, 0.0), (1e-3, 0.0), (0.0, 0.5), (1e-3, 0.5)])
def test_what_is_left_at_high_speed_is_viscous_but_what_grows_there(drag: float, dry: float) -> None:
    """Dry friction's slope has fallen as the square of the speed: 0.5 / 500^2 = 2e-6 is left, drag none."""
    row = np.array([1.0, 0.0])
    term = ForceTerm(mixed_law, np.array([drag, dry]), row, row, np.zeros(1), 0, "mixed")
    damping = viscous_damping([term], np.zeros((3, 2)))
    np.testing.assert_allclose(damping[:, 0, 0], VISCOUS, atol=5e-6)
    np.testing.assert_array_equal(damping[:, :, 1], 0.0)
