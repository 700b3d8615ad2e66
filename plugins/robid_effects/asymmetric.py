"""Friction that depends on the direction: Coulomb and viscous, each with a value for either way.

Theory: ``F = F_c+ + d+ v`` forwards and ``-F_c- + d- v`` backwards (B. Armstrong-Helouvry, Control of
Machines with Friction, 1991, who measured both ways apart on a PUMA; lip seals, preloaded gears and worm
gears do it most). The sign is smoothed as in the thesis' (2.9), each side with its own level, so that there
is no torque at rest. Half the difference acts as a torque offset while the axis moves either way about
equally long: on an axis that gravity loads it looks like an error of mass or torque constant; slow motion
over both signs of the load distinguishes them. Speeds that are symmetric about zero see the mean of both
sides.
"""

from __future__ import annotations

import math

import numpy as np

from robid_core import Equivalent, FloatArray, ForceEffect, Motion, Parameter, Place, TestValue
from robid_core.mechanics import equivalent_damping, kernel, where
from robid_effects.either_way import by_way, coulomb_and_viscous


@kernel
def asymmetric_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque and its slopes; parameters: coulomb, viscous forwards, the same backwards, speed."""
    forwards = velocity > 0.0
    coulomb = where(forwards, parameters[0], parameters[2])
    viscous = where(forwards, parameters[1], parameters[3])
    force, slope = coulomb_and_viscous(velocity, coulomb, viscous, parameters[4])
    return force, 0.0 * position, slope


class Asymmetric(ForceEffect):
    """Coulomb and viscous friction that differ between the directions of motion."""

    source = "B. Armstrong-Helouvry, Control of Machines with Friction, 1991"
    sides = ("motor", "gear", "arm")
    parameters = (
        Parameter("coulomb_forwards", "N m", 0.55, 0.0, 1e5, "level at positive speed, F_c+"),
        Parameter("viscous_forwards", "N m s/rad", 0.0, 0.0, 1e5, "torque per positive speed, d+"),
        Parameter("coulomb_backwards", "N m", 0.45, 0.0, 1e5, "level at negative speed, F_c-"),
        Parameter("viscous_backwards", "N m s/rad", 0.0, 0.0, 1e5, "torque per negative speed, d-"),
        Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed of the sign, v_s"),
    )
    law = staticmethod(asymmetric_law)
    test_values = (
        TestValue(
            {"velocity": 0.5 * math.log(3.0), "coulomb_forwards": 2.0, "viscous_forwards": 0.1},
            {"force": 1.6 + 0.05 * math.log(3.0), "slope_velocity": 4.0 * 9 / 25 + 0.1},
            "by hand: tanh(ln 3) = 4/5",
        ),
        TestValue(
            {"velocity": -100.0, "coulomb_backwards": 1.0, "viscous_backwards": 0.2},
            {"force": -21.0, "slope_velocity": 0.2},
            "by hand",
        ),
    )

    @classmethod
    def linearize(cls, parameters: FloatArray, place: Place, motion: Motion) -> Equivalent:
        """E[dF/dv]: each half of a symmetric distribution of speeds counts half."""
        damping = equivalent_damping(
            motion.velocity_rms,
            motion.sine_speed,
            (parameters[0] + parameters[2]) / 2,
            (parameters[1] + parameters[3]) / 2,
            parameters[4],
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
        """Force per unit of each level and coefficient, at the given smoothing speed."""
        return by_way({"coulomb": np.tanh(velocity / parameters[4]), "viscous": velocity})
