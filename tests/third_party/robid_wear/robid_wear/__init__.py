"""Friction of a brake that wears in: the level falls with the path it has slid, for robid.

Archard 1953: what is worn off grows with path and load. The law is written twice: as one writes it down, with
branches, and without, so that it runs on eight experiments at once.
"""

import numba

from robid_core import ForceEffect, Parameter, TestValue
from robid_core.mechanics import kernel, where

PARAMETERS = (
    Parameter("fresh", "N m", 0.8, 0.0, 1e3, "level before it has slid"),
    Parameter("worn", "N m", 0.4, 0.0, 1e3, "level once it has worn in"),
    Parameter("path", "rad", 2.0, 1e-3, 1e6, "that it slides until then"),
    Parameter("speed", "rad/s", 0.5, 1e-6, 1e3, "below it the sign is a straight line"),
)
TEST_VALUES = (
    TestValue(
        {"velocity": 10.0, "state": (1.0,)}, {"force": 0.6, "slope_velocity": 0.0}, "by hand: half worn in"
    ),
    TestValue(
        {"velocity": -0.1, "state": (9.0,), "step": 0.2}, {"force": -0.08, "next_state": (9.02,)}, "by hand"
    ),
)
SOURCE = "J. F. Archard, Contact and rubbing of flat surfaces, Journal of Applied Physics 24, 1953"


@numba.njit
def wear_law(position, velocity, load, state, next_state, parameters, step):
    """Torque in the middle of the step and its slopes; state: path so far."""
    fresh, worn, path, speed = parameters[0], parameters[1], parameters[2], parameters[3]
    slid = state[0] + 0.5 * step * abs(velocity)
    next_state[0] = state[0] + step * abs(velocity)
    if slid < path:
        level = fresh + (worn - fresh) * slid / path
        change = (worn - fresh) / path * 0.5 * step
    else:
        level = worn
        change = 0.0
    if velocity > speed:
        return level, 0.0, change
    if velocity < -speed:
        return -level, 0.0, change
    return level * velocity / speed, 0.0, level / speed + change * abs(velocity) / speed


class Wear(ForceEffect):
    """Friction whose level falls with the path, written with branches."""

    source = SOURCE
    sides = ("motor", "arm")
    parameters = PARAMETERS
    n_state = 1
    law = staticmethod(wear_law)
    test_values = TEST_VALUES


@kernel
def wear_law_on_lanes(position, velocity, load, state, next_state, parameters, step):
    """The same without branches."""
    fresh, worn, path, speed = parameters[0], parameters[1], parameters[2], parameters[3]
    slid = state[0] + 0.5 * step * abs(velocity)
    next_state[0] = state[0] + step * abs(velocity)
    level = where(slid < path, fresh + (worn - fresh) * slid / path, worn)
    change = where(slid < path, (worn - fresh) / path * 0.5 * step, 0.0)
    share = max(min(velocity / speed, 1.0), -1.0)
    slope = where(abs(velocity) < speed, level / speed, 0.0) + change * abs(share)
    return level * share, 0.0 * position, slope


class WearOnLanes(ForceEffect):
    """Friction whose level falls with the path, on eight experiments at once."""

    source = SOURCE
    sides = ("motor", "arm")
    parameters = PARAMETERS
    n_state = 1
    law = staticmethod(wear_law_on_lanes)
    test_values = TEST_VALUES
