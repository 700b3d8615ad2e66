"""Hysteresis of a gear or bearing as elastic sliders side by side: the Maxwell-slip (Iwan) model.

Theory: four springs k_i in parallel, each behind a Coulomb slider that gives way at +-f_i (Iwan 1966; Al-Bender,
Lampaert and Swevers 2005). Force against deflection is piecewise linear, independent of speed, with the full
memory of past reversals: a branch is the virgin curve doubled in both directions (Masing's rule), loops inside
loops close. The sliders share the torque equally, f_i = torque / 4; their break-away deflections form a geometric
row from the first to `spread` times the first, such that the springs add up to `stiffness`. This torque is *added*
to the linear spring of the robot file: with both, small motions meet the sum of the stiffnesses, large ones the
linear spring and a torque of +-`torque`. State: torques of the sliders, all at zero at the start; a step at
constant velocity is exact, min and max.
"""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray, ForceEffect, Parameter, Place, TestValue
from robid_core.mechanics import kernel, where

N_SLIDER = 4


def sliders(stiffness: float, torque: float, spread: float) -> tuple[FloatArray, FloatArray]:
    """Return stiffness (N m/rad) and level (N m) of each slider, shape (N_SLIDER,), the earliest to slip first."""
    relative = spread ** (np.arange(N_SLIDER) / (N_SLIDER - 1.0))
    share = (1.0 / relative) / np.sum(1.0 / relative)
    return stiffness * share, np.full(N_SLIDER, torque / N_SLIDER)


@kernel
def maxwell_slip_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Torque of all sliders in the middle of the step, exact at constant velocity; state: torque of each."""
    force = 0.0 * velocity
    slope = 0.0 * velocity
    for i in range(N_SLIDER):
        stiffness, level = parameters[i], parameters[N_SLIDER + i]
        stretched = state[i] + stiffness * (0.5 * step * velocity)
        force = force + max(min(stretched, level), -level)
        slope = slope + where(abs(stretched) < level, stiffness * (0.5 * step), 0.0)
        next_state[i] = max(min(state[i] + stiffness * (step * velocity), level), -level)
    return force, 0.0, slope


class MaxwellSlip(ForceEffect):
    """Hysteresis with the memory of all reversals: four elastic sliders, added to the linear spring."""

    source = (
        "W. D. Iwan, A distributed-element model for hysteresis, Journal of Applied Mechanics 33(4), 1966; "
        "F. Al-Bender, V. Lampaert, J. Swevers, The generalized Maxwell-slip model, "
        "IEEE Transactions on Automatic Control 50(11), 2005"
    )
    sides = ("gear", "bearing")
    parameters = (
        Parameter("stiffness", "N m/rad", 5e3, 1e-6, 1e10, "of all sliders while none slips"),
        Parameter("torque", "N m", 5.0, 0.0, 1e6, "of all sliders while all slip"),
        Parameter("spread", "1", 10.0, 1.0, 1e4, "largest over smallest break-away deflection"),
    )
    n_state = N_SLIDER
    law = staticmethod(maxwell_slip_law)
    test_values = (
        TestValue(
            {"velocity": 1.0, "step": 2.0, "stiffness": 15.0, "torque": 60.0, "spread": 8.0},
            {"force": 15.0, "slope_velocity": 15.0, "next_state": (15.0, 8.0, 4.0, 2.0)},
            "springs 8, 4, 2, 1 N m/rad, each up to 15 N m, stretched by 1 and by 2 rad",
        ),
    )

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Return the stiffness of each slider, then the level of each."""
        del place
        return np.concatenate(sliders(*parameters))
