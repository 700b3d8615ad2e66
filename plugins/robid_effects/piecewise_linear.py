"""The stiffness curve of a gear as its catalogue gives it: three stiffnesses, two torques, lost motion.

Theory: below torque_1 the gear winds up with stiffness_1, up to torque_2 with stiffness_2, above with stiffness_3
(Harmonic Drive, engineering data, "calculation of the torsion angle"; thesis figure 2.3). Lost motion is the angle
between small torques of both signs, plus and minus 3 % of the rated torque (catalogues of cycloidal gears): a play
of that full width lies in series with the curve and closes at 3 % of torque_2, which stands for the rated torque.
So

    angle at torque_1: lost_motion / 2 + torque_1 / stiffness_1,
    angle at torque_2: (torque_2 - torque_1) / stiffness_2 more,

odd in the torque, and stiff enough inside the play for the equilibrium to be where it is. `lost_motion` is the play
alone: where a catalogue's angle holds the elastic part too, take 2 * 0.03 rated torque / stiffness_1 off. A cycloidal
gear has one stiffness: give it three times, and the rated torque as torque_2. Corners are rounded within 2 % of the
shorter piece beside them; the torque there is off by a quarter of that times the difference of the stiffnesses
(0.3 % in the catalogue's own example).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_core import ConfigurationError, FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel
from robid_effects.deflection import SMALLEST_RADIUS, dead_zone, swept_radius

CLOSING = 0.03  # lost motion is measured between +-3 % of the rated torque (Nabtesco RV, Sumitomo, Spinea)
ROUNDING = 0.02
N_CORNER = 3


@kernel
def piecewise_linear_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque less the linear spring's, and its slopes; parameters: see `PiecewiseLinear.arguments`."""
    force, slope = parameters[1] * position, parameters[1] + 0.0 * position
    by_velocity = 0.0 * velocity
    for corner in range(N_CORNER):
        row = 2 + 3 * corner
        radius, wider = swept_radius(parameters[row + 1], velocity, step)
        beyond, share, by_radius = dead_zone(position, parameters[row], radius)
        force += parameters[row + 2] * beyond
        slope += parameters[row + 2] * share
        by_velocity += parameters[row + 2] * by_radius * wider
    return force - parameters[0] * position, slope - parameters[0], by_velocity


class PiecewiseLinear(ForceEffect):
    """Piecewise linear stiffness in place of the robot file's linear spring."""

    source = "Harmonic Drive SE, engineering data; Nabtesco RV catalogue; thesis section 2.4, figure 2.3"
    sides = ("gear",)
    law = staticmethod(piecewise_linear_law)
    parameters = (
        Parameter("stiffness_1", "N m/rad", 6.7e4, 1.0, 1e9, "below torque_1"),
        Parameter("stiffness_2", "N m/rad", 1.1e5, 1.0, 1e9, "between torque_1 and torque_2"),
        Parameter("stiffness_3", "N m/rad", 1.2e5, 1.0, 1e9, "above torque_2"),
        Parameter("torque_1", "N m", 29.0, 1e-6, 1e6, "first corner"),
        Parameter("torque_2", "N m", 108.0, 1e-6, 1e6, "second corner; about the rated torque"),
        Parameter(
            "lost_motion", "rad", 0.0, 0.0, 0.1, "full width of the play, without what winds elastically"
        ),
    )
    test_values = (
        TestValue(
            {
                "position": 29 / 6.7e4 + 31 / 1.1e5,
                "stiffness_1": 6.7e4,
                "stiffness_2": 1.1e5,
                "stiffness_3": 1.2e5,
                "torque_1": 29.0,
                "torque_2": 108.0,
            },
            {"force": 60.0, "slope_position": 1.1e5},
            "Harmonic Drive, torsion angle of an HFUC-32-100-2UH at 60 N m: 7.15e-4 rad; where the file's spring is 0",
        ),
    )

    @classmethod
    def starts(cls, place: Place | None) -> tuple[Mapping[str, float], ...]:
        """Near the linear spring that it stands for, softer where it begins to wind."""
        if place is None:
            return ({},)
        shares = {"stiffness_1": 0.8, "stiffness_2": 1.0, "stiffness_3": 1.05}
        return ({name: share * place.stiffness for name, share in shares.items()},)

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Linear spring, first stiffness; deflection, radius and rise in stiffness of each corner."""
        stiffness_1, stiffness_2, stiffness_3, torque_1, torque_2, lost_motion = parameters
        if torque_2 <= torque_1:
            raise ConfigurationError(
                f"effects: {place.label}: torque_2 is {torque_2:g} N m and torque_1 {torque_1:g} N m; the second "
                "corner of the stiffness curve must lie above the first"
            )
        play, closing = 0.5 * lost_motion, min(CLOSING * torque_2, 0.5 * torque_1)
        corner = np.array([play + closing / stiffness_1, play + torque_1 / stiffness_1, 0.0])
        corner[2] = corner[1] + (torque_2 - torque_1) / stiffness_2
        piece = np.diff(corner, prepend=0.0)
        radius = ROUNDING * np.minimum(piece, np.append(piece[1:], np.inf))
        stiffness = np.array([closing / corner[0], stiffness_1, stiffness_2, stiffness_3])
        radius = np.maximum(radius, SMALLEST_RADIUS)
        corners = np.stack([corner, radius, np.diff(stiffness)], axis=-1)
        return np.array([place.stiffness, stiffness[0], *corners.ravel()])
