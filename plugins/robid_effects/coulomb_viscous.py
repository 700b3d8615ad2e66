"""Coulomb plus viscous friction, smoothed at standstill: the friction that the robots of the core have.

Theory: a constant torque against the motion and one proportional to speed, ``F = F_c tanh(v / v_s) + d v +
F_0`` (thesis eq. 2.9 and 2.10; Armstrong-Helouvry, Dupont and Canudas de Wit, A survey of models, analysis
tools and compensation methods for the control of machines with friction, Automatica 30, 1994). The smoothing
speed v_s is a nuisance of simulation: below it friction is not resolved. The offset F_0 stands for what
pushes always the same way: a current sensor's zero, an asymmetric seal. A small multisine on top of a
slow sine sees E[dF/dv] over the speeds, which falls as the motion grows: friction fades with amplitude.
"""

from __future__ import annotations

import math

import numpy as np

from robid_core import Equivalent, FloatArray, ForceEffect, Motion, Parameter, Place, TestValue
from robid_core.mechanics import coulomb_viscous_law, equivalent_damping


class CoulombViscous(ForceEffect):
    """Coulomb friction with a smooth sign, viscous friction, and a constant torque."""

    source = "thesis eq. (2.9), (2.10), after O. Egeland, J. T. Gravdahl, Modeling and Simulation, 2002"
    sides = ("motor", "gear", "arm")
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "level of the torque that does not depend on speed, F_c"),
        Parameter("viscous", "N m s/rad", 0.0, 0.0, 1e5, "torque per speed, d"),
        Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed of the sign, v_s"),
        Parameter("offset", "N m", 0.0, -1e5, 1e5, "torque that is always there, F_0"),
    )
    law = staticmethod(coulomb_viscous_law)
    test_values = (
        TestValue(
            {"velocity": 0.5 * math.log(3.0), "coulomb": 2.0, "viscous": 0.1, "speed": 0.5, "offset": 0.3},
            # tanh(ln 3) = (3 - 1/3) / (3 + 1/3) = 4/5; its slope is 1 - 16/25 = 9/25
            {"force": 1.6 + 0.05 * math.log(3.0) + 0.3, "slope_velocity": 2.0 / 0.5 * 9 / 25 + 0.1},
            "by hand from (2.9) and (2.10), at v = v_s ln 3 where tanh is 4/5",
        ),
    )

    @classmethod
    def linearize(cls, parameters: FloatArray, place: Place, motion: Motion) -> Equivalent:
        """E[dF/dv] in closed form; the offset has no slope."""
        coulomb, viscous, speed, _ = parameters
        damping = equivalent_damping(motion.velocity_rms, motion.sine_speed, coulomb, viscous, speed)
        return Equivalent(np.zeros_like(damping), damping)

    @classmethod
    def regressor(
        cls,
        position: FloatArray,
        velocity: FloatArray,
        load: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Force per unit of Coulomb level, viscous coefficient and offset, at the given smoothing speed."""
        return {
            "coulomb": np.tanh(velocity / parameters[2]),
            "viscous": velocity,
            "offset": np.ones_like(velocity),
        }
