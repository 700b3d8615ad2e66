"""Coulomb friction that waves with the angle: nuts, gears and seals rub more at some places than at others.

Theory: torque ``a sin(n angle + phase) sign(v)`` beside the mean level, which the axis or another effect has. Measured
on gears of a robot with the period of the motor and of the gear's teeth (Armstrong-Helouvry 1991), and found by
spectral analysis over the angle on drives and screws (Popovic and Goldenberg 1998); a bent screw or a preload that
varies along the way gives long waves. Unlike cogging and torque ripple it turns round with the motion, so slow moves
both ways tell the two apart. It takes energy as long as the amplitude is below the mean level: give it no more. The
sign is tanh(v / v_s). Where the angle's zero differs between runs, the phase does, too.
"""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel, sine_and_cosine, smooth_sign


@kernel
def angle_dependent_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque and its slopes; parameters: amplitude, order, phase, speed."""
    s, c = sine_and_cosine(parameters[1] * position + parameters[2])
    share = smooth_sign(velocity / parameters[3])
    rise = (1.0 - share * share) / parameters[3]
    return parameters[0] * s * share, parameters[0] * parameters[1] * c * share, parameters[0] * s * rise


class AngleDependent(ForceEffect):
    """Coulomb friction that varies with the angle, by one order of it."""

    source = (
        "B. Armstrong-Helouvry, Control of Machines with Friction, 1991; M. R. Popovic, A. A. Goldenberg, Modeling of "
        "friction using spectral analysis, IEEE Transactions on Robotics and Automation 14(1), 1998"
    )
    sides = ("motor", "gear", "arm")
    parameters = (
        Parameter("amplitude", "N m", 0.05, 0.0, 1e4, "of the wave, a, below the mean Coulomb level"),
        Parameter("order", "1/turn", 1.0, 0.0, 1e4, "periods per turn of the place, n"),
        Parameter("phase", "rad", 0.0, -2 * np.pi, 2 * np.pi, "of the sine at angle zero"),
        Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "smoothing speed of the sign, v_s"),
    )
    law = staticmethod(angle_dependent_law)
    test_values = (
        TestValue(
            {"position": np.pi / 12, "velocity": -50.0, "amplitude": 0.2, "order": 6.0},
            {"force": -0.2, "slope_position": 0.0, "slope_velocity": 0.0},
            "by hand: on the crest, against the motion",
        ),
        TestValue(
            {"position": 0.0, "velocity": 50.0, "amplitude": 0.2, "order": 6.0},
            {"force": 0.0, "slope_position": 1.2},
            "by hand: through zero with slope amplitude times order",
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
        """Force per unit of the amplitude, at the given order, phase and smoothing speed."""
        wave = np.sin(parameters[1] * position + parameters[2])
        return {"amplitude": wave * np.tanh(velocity / parameters[3])}
