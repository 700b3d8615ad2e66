"""Friction curved in speed: Coulomb, viscous, and a torque that grows with a power of the speed, for either way.

Theory: ``F = F_c + d v + c |v|^n`` forwards, the same with values of its own backwards. Greases and oils that thin
under shear drag with n below one (Ostwald 1925 and de Waele 1923; n = 1/3 with Grotjahn, Daemi and Heimann 2001, for
gears of robots), churned oil with n = 2; ball screws and gears that are preloaded on one flank do it differently either
way (Armstrong-Helouvry 1991; Janot, Young and Gautier 2017 found such a curve on a ball screw). The power is
``v (v^2 + v_s^2)^((n - 1) / 2)``, which has a finite slope at rest and is within 1 % of ``|v|^n`` from 8 v_s on (n =
1/3). Beyond the speeds that were measured it goes on as it was: no polynomial that bends down. `drag` is the torque at
1 rad/s (1 m/s). At n near one it is viscous friction, near zero Coulomb's: data then tell sums only.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import exponential, kernel, natural_logarithm, where
from robid_effects.either_way import by_way, coulomb_and_viscous


@kernel
def power_of_speed(velocity, exponent, speed):  # type: ignore[no-untyped-def]
    """v (v^2 + speed^2)^((exponent - 1) / 2), and its slope."""
    square = velocity * velocity + speed * speed
    factor = exponential(0.5 * (exponent - 1.0) * natural_logarithm(square))
    return velocity * factor, factor * (exponent * velocity * velocity + speed * speed) / square


@kernel
def power_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque and its slopes; parameters: coulomb, viscous, drag forwards, the same backwards, exponent, speed."""
    forwards = velocity > 0.0
    coulomb = where(forwards, parameters[0], parameters[3])
    viscous = where(forwards, parameters[1], parameters[4])
    drag = where(forwards, parameters[2], parameters[5])
    force, slope = coulomb_and_viscous(velocity, coulomb, viscous, parameters[7])
    power, rise = power_of_speed(velocity, parameters[6], parameters[7])
    return force + drag * power, 0.0 * position, slope + drag * rise


class PowerLaw(ForceEffect):
    """Coulomb and viscous friction and a power of the speed, separate for each direction."""

    source = (
        "M. Grotjahn, M. Daemi, B. Heimann, Friction and rigid body identification of robot dynamics, International "
        "Journal of Solids and Structures 38, 2001; A. Janot, P. C. Young, M. Gautier, Identification and control of "
        "electro-mechanical systems using state-dependent parameter estimation, International Journal of Control "
        "90(4), 2017"
    )
    sides = ("motor", "gear", "arm")
    parameters = (
        Parameter("coulomb_forwards", "N m", 0.5, 0.0, 1e5, "level at positive speed, F_c+"),
        Parameter("viscous_forwards", "N m s/rad", 0.0, 0.0, 1e5, "torque per positive speed, d+"),
        Parameter("drag_forwards", "N m", 0.1, 0.0, 1e5, "of the power, at 1 rad/s, c+"),
        Parameter("coulomb_backwards", "N m", 0.5, 0.0, 1e5, "level at negative speed, F_c-"),
        Parameter("viscous_backwards", "N m s/rad", 0.0, 0.0, 1e5, "torque per negative speed, d-"),
        Parameter("drag_backwards", "N m", 0.1, 0.0, 1e5, "of the power, at -1 rad/s, c-"),
        Parameter("exponent", "1", 1 / 3, 0.05, 3.0, "of the power, n"),
        Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed of sign and power, v_s"),
    )
    law = staticmethod(power_law)
    test_values = (
        TestValue(
            {
                "velocity": 8.0,
                "coulomb_forwards": 1.0,
                "viscous_forwards": 0.1,
                "drag_forwards": 3.0,
                "speed": 1e-6,
            },
            {"force": 1.0 + 0.8 + 6.0, "slope_velocity": 0.1 + 0.25},
            "by hand: the cube root of 8 is 2, its slope 1/12",
        ),
        TestValue(
            {
                "velocity": -4.0,
                "coulomb_backwards": 2.0,
                "drag_backwards": 0.5,
                "exponent": 2.0,
                "speed": 1e-6,
            },
            {"force": -2.0 - 8.0, "slope_velocity": 4.0},
            "by hand: churning, 0.5 * 4^2",
        ),
    )

    @classmethod
    def starts(cls, place: Place | None) -> tuple[Mapping[str, float], ...]:
        """A grease that thins under shear, something between, and churning."""
        return ({"exponent": 1 / 3}, {"exponent": 2 / 3}, {"exponent": 2.0})

    @classmethod
    def regressor(
        cls,
        position: FloatArray,
        velocity: FloatArray,
        load: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Force per unit of each level and coefficient, at the given exponent and smoothing speed."""
        exponent, speed = parameters[6:]
        return by_way(
            {
                "coulomb": np.tanh(velocity / speed),
                "viscous": velocity,
                "drag": velocity * (velocity**2 + speed**2) ** (0.5 * (exponent - 1)),
            }
        )
