"""Counterbalance of an arm: a spring, gas spring or hydraulic cylinder between two points of a joint.

Theory: one end is held at distance a from the joint's axis, the other moves on a circle of radius b; the
cylinder's length is L(q) = sqrt(a^2 + b^2 - 2 a b cos(q + mounting_angle)), and its pull F(L) gives the torque F
dL/dq (Klimchik et al. 2013, spring compensator of a heavy robot; Arakelian 2016 for a survey). Pull = preload z^-n
+ stiffness (L - L_0), L_0 the length at joint angle zero where the pull is the preload. Gas that a pull compresses
(preload > 0, hydropneumatic cylinder) has the column z = 1 - (L - L_0) / gas_length, in units of that at joint
angle zero; gas that pushes (preload < 0, gas strut) z = 1 + (L - L_0) / gas_length. n is the polytropic exponent,
1 slow, 1.4 fast, 0 no gas: constant pull. With n = 0 and preload = stiffness |a - b| the torque is stiffness a b
sin(q): it balances a pendulum at every angle. Gas compressed below a twentieth of its column keeps its pull;
friction of the seals is friction.*.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_core import ConfigurationError, FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import exponential, kernel, natural_logarithm, sine_and_cosine, where

SMALLEST_COLUMN = 0.05


@kernel
def counterbalance_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque against the joint angle and its slope; parameters: see `Counterbalance.arguments`."""
    squares, product, preload, stiffness = parameters[0], parameters[1], parameters[3], parameters[4]
    per_length, exponent = parameters[5], parameters[6]
    s, c = sine_and_cosine(position + parameters[2])
    length = np.sqrt(squares - 2.0 * product * c)
    lever = product * s / length
    extension = length - parameters[7]
    column = max(1.0 - per_length * extension, SMALLEST_COLUMN)
    gas = preload * exponential(-exponent * natural_logarithm(column))
    pull = gas + stiffness * extension
    springiness = where(column > SMALLEST_COLUMN, exponent * per_length, 0.0)
    rate = stiffness + springiness * gas / column
    slope = rate * lever * lever + pull * (product * c - lever * lever) / length
    return pull * lever, slope, 0.0 * velocity


class Counterbalance(ForceEffect):
    """Spring or gas cylinder that carries part of an arm's weight."""

    source = "Klimchik et al. 2013, IEEE ICRA; Arakelian 2016, Advanced Robotics 30(2)"
    sides = ("arm",)
    law = staticmethod(counterbalance_law)
    parameters = (
        Parameter(
            "anchor_distance", "m", 0.6, 1e-3, 10.0, "a, from the joint's axis to the end that is held"
        ),
        Parameter("attachment_distance", "m", 0.15, 1e-3, 10.0, "b, from the axis to the end that moves"),
        Parameter("mounting_angle", "rad", 0.0, -7.0, 7.0, "between a and b at joint angle zero"),
        Parameter("preload", "N", 5000.0, -1e6, 1e6, "pull at joint angle zero; negative: it pushes"),
        Parameter("stiffness", "N/m", 0.0, 0.0, 1e7, "of a metal spring"),
        Parameter("gas_length", "m", 0.6, 1e-3, 1e3, "gas volume over piston area at joint angle zero"),
        Parameter("polytropic_exponent", "1", 1.2, 0.0, 2.0, "n of the gas; 0: no gas"),
    )
    test_values = (
        TestValue(
            {"position": np.pi / 6, "preload": 900.0, "stiffness": 2000.0, "polytropic_exponent": 0.0},
            {"force": 90.0, "slope_position": 180 * np.cos(np.pi / 6), "slope_velocity": 0.0},
            "spring of zero free length (Arakelian 2016): 2000 * 0.6 * 0.15 * sin(q)",
        ),
    )

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """a^2 + b^2, a b, mounting angle, preload, stiffness, gas column lost per extension, exponent, L_0."""
        a, b, mounting_angle, preload, stiffness, gas_length, exponent = parameters
        squares, product = a * a + b * b, a * b
        if abs(a - b) < 1e-3 * max(a, b):
            raise ConfigurationError(
                f"effects: {place.label}: anchor_distance and attachment_distance are both {a:g} m; the cylinder would "
                "shrink to nothing as they pass one another: give two different distances"
            )
        per_length = (1.0 if preload >= 0 else -1.0) / gas_length
        length = np.sqrt(squares - 2 * product * np.cos(mounting_angle))
        return np.array([squares, product, mounting_angle, preload, stiffness, per_length, exponent, length])

    @classmethod
    def starts(cls, place: Place | None) -> tuple[Mapping[str, float], ...]:
        """Mounted along the arm at its zero."""
        return ({"mounting_angle": 0.0},)

    @classmethod
    def regressor(
        cls,
        position: FloatArray,
        velocity: FloatArray,
        load: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Torque per unit of preload (of its sign) and of stiffness, at the given geometry and gas."""
        squares, product, mounting_angle, _, _, per_length, exponent, rest = cls.arguments(parameters, place)
        angle = np.asarray(position, dtype=float) + mounting_angle
        length = np.sqrt(squares - 2 * product * np.cos(angle))
        lever, extension = product * np.sin(angle) / length, length - rest
        column = np.maximum(1 - per_length * extension, SMALLEST_COLUMN)
        return {"preload": column**-exponent * lever, "stiffness": extension * lever}
