"""Compile every kernel once, so that a run can say what it is waiting for; later runs load them from disk."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robid_core.compiled.lanes import LANES
from robid_core.mechanics.chain import Chain
from robid_core.mechanics.equilibrium import solve_equilibrium
from robid_core.mechanics.linearize import second_order_model
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.response import response
from robid_core.mechanics.simulate import Controller, rest_state, simulate


def warm_up(note: Callable[[str], None] | None = None) -> None:
    """Call each kernel on a pendulum behind one motor.

    Parameters
    ----------
    note
        Told what is compiled next (or loaded, where it was compiled before).
    """
    tell = note if note is not None else _say_nothing
    chain = Chain(
        parent=np.array([-1]),
        joint_type=np.array([0]),
        axis=np.array([[0.0, 1.0, 0.0]]),
        rotation=np.eye(3)[None],
        translation=np.zeros((1, 3)),
        mass=np.ones(1),
        centre_of_mass=np.array([[0.1, 0.0, 0.0]]),
        inertia=np.eye(3)[None] * 0.01,
        names=("pendulum",),
        gravity=np.array([0.0, 0.0, -9.81]),
    )
    one = np.ones(1)
    arm, elastic = np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64)
    mechanism = Mechanism(chain, np.eye(1) * 0.1, one * 1e-3, arm, elastic, np.ones(1, dtype=np.bool_))
    spring, damper = one * 1e3, one
    tell("kernel 1 of 4: chain dynamics")
    rest = solve_equilibrium(mechanism, spring, np.zeros((1, 1)))
    tell("kernel 2 of 4: frequency response")
    response(second_order_model(mechanism, spring, damper, rest.position), one * 10.0)
    controller = Controller(one * 0.1, one, one, one, one * 10, one * 0)
    for number, n_lane, experiments in ((3, 1, "one experiment"), (4, LANES, "eight experiments at once")):
        tell(f"kernel {number} of 4: closed-loop simulation of {experiments}")
        state = rest_state(mechanism, spring, np.zeros((n_lane, 1)))
        simulate(mechanism, spring, damper, controller, state, np.zeros((n_lane, 2, 1)))


def _say_nothing(_: str) -> None:
    """Take a note and keep quiet."""
