"""Friction of a lubricant whose molecules are pulled over one another: it grows with the logarithm of the speed.

Theory: shear stress and rate of an Eyring fluid are ``stress = stress_E arsinh(rate / rate_E)`` (H. Eyring 1936), which
is how oil and grease drag under the pressure of gears, bearings and ball screws (Johnson and Tevaarwerk 1977): in
proportion to the speed below v_E, hardly faster than its logarithm above. With Coulomb friction, which seals and dry
contacts add, and values of its own for either way: ``F = F_c + d v + F_E arsinh(|v| / v_E)``. It has a finite slope at
rest, never falls, and goes on as a logarithm beyond the speeds that were measured. Where all speeds are above v_E it
is distinguished from a power law with a small exponent by its bend alone, and v_E from the Coulomb level by none.
"""

from __future__ import annotations

import math

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import exponential, kernel, natural_logarithm, where
from robid_effects.either_way import by_way, coulomb_and_viscous


@kernel
def area_sine(x):  # type: ignore[no-untyped-def]
    """arsinh(x) and its slope, 1 / sqrt(1 + x^2); by a series where the logarithm would cancel."""
    square = 1.0 + x * x
    root = exponential(0.5 * natural_logarithm(square))
    size = abs(x)
    small = size * (1.0 - x * x * (1.0 / 6.0 - 0.075 * x * x))
    value = where(size < 1e-2, small, natural_logarithm(size + root))
    return where(x < 0.0, -value, value), 1.0 / root


@kernel
def eyring_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque and its slopes; parameters: coulomb, viscous, shear forwards, the same backwards, two speeds."""
    forwards = velocity > 0.0
    coulomb = where(forwards, parameters[0], parameters[3])
    viscous = where(forwards, parameters[1], parameters[4])
    shear = where(forwards, parameters[2], parameters[5])
    force, slope = coulomb_and_viscous(velocity, coulomb, viscous, parameters[7])
    bend, rise = area_sine(velocity / parameters[6])
    return force + shear * bend, 0.0 * position, slope + shear / parameters[6] * rise


class Eyring(ForceEffect):
    """Coulomb and viscous friction and the shear drag of an Eyring fluid, separate for each direction."""

    source = (
        "H. Eyring, Viscosity, plasticity, and diffusion as examples of absolute reaction rates, Journal of Chemical "
        "Physics 4, 1936; K. L. Johnson, J. L. Tevaarwerk, Shear behaviour of elastohydrodynamic oil films, "
        "Proceedings of the Royal Society A 356, 1977"
    )
    sides = ("motor", "gear", "arm")
    parameters = (
        Parameter("coulomb_forwards", "N m", 0.5, 0.0, 1e5, "level at positive speed, F_c+"),
        Parameter("viscous_forwards", "N m s/rad", 0.0, 0.0, 1e5, "torque per positive speed, d+"),
        Parameter("shear_forwards", "N m", 0.1, 0.0, 1e5, "of the fluid at positive speed, F_E+"),
        Parameter("coulomb_backwards", "N m", 0.5, 0.0, 1e5, "level at negative speed, F_c-"),
        Parameter("viscous_backwards", "N m s/rad", 0.0, 0.0, 1e5, "torque per negative speed, d-"),
        Parameter("shear_backwards", "N m", 0.1, 0.0, 1e5, "of the fluid at negative speed, F_E-"),
        Parameter("eyring_speed", "rad/s", 5.0, 1e-6, 1e4, "from which on the fluid thins, v_E"),
        Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed of the sign, v_s"),
    )
    law = staticmethod(eyring_law)
    test_values = (
        TestValue(
            {"velocity": 3.75, "coulomb_forwards": 0.0, "shear_forwards": 2.0, "eyring_speed": 5.0},
            {"force": 2.0 * math.log(2.0), "slope_velocity": 2.0 / 5.0 * 0.8},
            "by hand: arsinh(3/4) = ln(3/4 + 5/4)",
        ),
        TestValue(
            {"velocity": -20 / 3, "coulomb_backwards": 1.0, "viscous_backwards": 0.3, "shear_backwards": 2.0},
            {"force": -1.0 - 2.0 - 2.0 * math.log(3.0), "slope_velocity": 0.3 + 0.4 * 0.6},
            "by hand: arsinh(4/3) = ln(4/3 + 5/3)",
        ),
    )

    @classmethod
    def regressor(
        cls,
        position: FloatArray,
        velocity: FloatArray,
        load: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Force per unit of each level and coefficient, at the given speeds."""
        eyring_speed, speed = parameters[6:]
        return by_way(
            {
                "coulomb": np.tanh(velocity / speed),
                "viscous": velocity,
                "shear": np.arcsinh(velocity / eyring_speed),
            }
        )
