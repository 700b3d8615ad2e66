"""Coulomb plus viscous friction of a motor, smoothed at standstill.

Theory: a constant torque against the motion and one proportional to speed, tau = tau_C tanh(v / v_s) + d v
(thesis eq. 2.9 and 2.10; Armstrong-Helouvry, Dupont and Canudas de Wit 1994). The smoothing speed v_s is a
nuisance of simulation: below it friction is not resolved. What a small multisine on top of a slow sine sees
is E[d tau / d v] over the speeds, which falls as the motion grows: friction fades with amplitude.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from robid_core import ForceEffect, Parameter
from robid_core.mechanics import equivalent_damping

FloatArray = npt.NDArray[np.float64]


@numba.njit(cache=True)
def coulomb_viscous_law(
    position: float, velocity: float, load: float, state: float, parameters: FloatArray, step: float
) -> tuple[float, float, float, float]:
    """Friction torque, its slopes in position and velocity, and its (unused) state."""
    level = np.tanh(velocity / parameters[2])
    force = parameters[0] * level + parameters[1] * velocity
    slope = parameters[0] * (1.0 - level * level) / parameters[2] + parameters[1]
    return force, 0.0, slope, state


class CoulombViscous(ForceEffect):
    """Coulomb and viscous friction on the motor."""

    source = "Zimmermann, thesis eq. (2.9), (2.10)"
    sides = ("motor", "gear", "arm")
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e4, "level of the constant torque"),
        Parameter("viscous", "N m s/rad", 0.0, 0.0, 1e4, "torque per speed"),
        Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed of the sign"),
    )

    @classmethod
    def law(cls):  # type: ignore[no-untyped-def]
        """Return the compiled law."""
        return coulomb_viscous_law

    @classmethod
    def equivalent_damping(
        cls, parameters: FloatArray, speed_rms: FloatArray, slow_sine_speed: FloatArray
    ) -> FloatArray:
        """E[df/dv] under a Gaussian speed on top of a slow sine."""
        coulomb, viscous, speed = parameters
        return equivalent_damping(
            speed_rms, slow_sine_speed, np.asarray(coulomb), np.asarray(viscous), np.asarray(speed)
        )

    @classmethod
    def regressor(cls, velocity: FloatArray, parameters: FloatArray) -> dict[str, FloatArray]:
        """Force per unit of Coulomb level and of viscous coefficient, at the given smoothing speed."""
        return {"coulomb": np.tanh(velocity / parameters[2]), "viscous": velocity}
