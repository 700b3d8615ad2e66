"""Coulomb friction alone: a torque of constant size against the motion, with a sharp or a smooth sign.

Theory: ``F = F_c sign(v)`` (thesis eq. 2.8; C. A. de Coulomb, Theorie des machines simples, 1785). It says
nothing about standstill, and a simulation cannot step over a jump: the sharp sign is a straight line between
-v_0 and v_0, exact outside; the smooth one is tanh(v / v_s) (2.9), 2 % short of the level at 2.3 v_s. Below
those speeds a loaded axis creeps where a real one sticks: `friction.breakaway` holds. The gain that a small
signal sees is 2 F_c times the density of the speed at zero: ``sqrt(2 / pi) F_c / rms`` in Gaussian motion,
``2 F_c / (pi A)`` on a sine (half of its own describing function, 4 F_c / (pi A)).
"""

from __future__ import annotations

import math

import numpy as np

from robid_core import Equivalent, FloatArray, ForceEffect, Motion, Parameter, Place, TestValue
from robid_core.mechanics import equivalent_damping, kernel, smooth_sign, where


@kernel
def coulomb_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Sharp sign: torque, and its slopes; parameters: coulomb, speed."""
    share = velocity / parameters[1]
    force = parameters[0] * max(min(share, 1.0), -1.0)
    return force, 0.0 * position, where(abs(share) < 1.0, parameters[0] / parameters[1], 0.0)


@kernel
def coulomb_tanh_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Smooth sign: torque, and its slopes; parameters: coulomb, speed."""
    share = smooth_sign(velocity / parameters[1])
    return parameters[0] * share, 0.0 * position, parameters[0] / parameters[1] * (1.0 - share * share)


class Coulomb(ForceEffect):
    """Coulomb friction with a sharp sign."""

    source = "C. A. de Coulomb, Theorie des machines simples, 1785; thesis eq. (2.8)"
    sides = ("motor", "gear", "arm")
    searched_at = ("arm",)
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "level of the torque, F_c"),
        Parameter("speed", "rad/s", 0.05, 1e-6, 1e3, "below it the sign is a straight line, v_0: numerical"),
    )
    law = staticmethod(coulomb_law)
    test_values = (
        TestValue({"velocity": -0.06, "coulomb": 2.0}, {"force": -2.0, "slope_velocity": 0.0}, "(2.8)"),
        TestValue(
            {"velocity": 0.01, "coulomb": 2.0, "speed": 0.05},
            {"force": 0.4, "slope_velocity": 40.0},
            "by hand: a fifth of the way up the line",
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
        """Force per unit of the level."""
        return {"coulomb": np.clip(velocity / parameters[1], -1.0, 1.0)}


class CoulombTanh(ForceEffect):
    """Coulomb friction with a smooth sign."""

    source = "thesis eq. (2.9)"
    sides = ("motor", "gear", "arm")
    searched_at = ("arm",)
    parameters = (
        Parameter("coulomb", "N m", 0.5, 0.0, 1e5, "level of the torque, F_c"),
        Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed, v_s"),
    )
    law = staticmethod(coulomb_tanh_law)
    test_values = (
        TestValue(
            {"velocity": -0.5 * math.log(3.0), "coulomb": 2.0, "speed": 0.5},
            {"force": -1.6, "slope_velocity": 2.0 / 0.5 * 9 / 25},
            "by hand from (2.9): tanh(ln 3) = 4/5",
        ),
    )

    @classmethod
    def linearize(cls, parameters: FloatArray, place: Place, motion: Motion) -> Equivalent:
        """E[dF/dv] in closed form."""
        damping = equivalent_damping(
            motion.velocity_rms, motion.sine_speed, parameters[0], 0.0, parameters[1]
        )
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
        """Force per unit of the level, at the given smoothing speed."""
        return {"coulomb": np.tanh(velocity / parameters[1])}
