"""Small calls, one for each group of kernels, after which their machine code is on disk.

All are made of a pendulum behind one motor. Positions at rest are a part of all others: compiled first, they are found
on disk.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robid_core.compiled.lanes import LANES
from robid_core.mechanics.chain import Chain
from robid_core.mechanics.equilibrium import solve_equilibrium
from robid_core.mechanics.linearize import second_order_model
from robid_core.mechanics.mechanical_model import MechanicalModel
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.prescribed import MotorMotion, prescribe
from robid_core.mechanics.response import response
from robid_core.mechanics.simulate import Controller, rest_state, simulate

_ONE = np.ones(1)
_CHAIN = Chain(
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
_PENDULUM = Mechanism(
    _CHAIN,
    np.eye(1) * 0.1,
    _ONE * 1e-3,
    np.zeros(1, dtype=np.int64),
    np.zeros(0, dtype=np.int64),
    np.ones(1, dtype=np.bool_),
)
_SPRING, _DAMPER = _ONE * 1e3, _ONE


def _rest() -> None:
    solve_equilibrium(_PENDULUM, _SPRING, np.zeros((1, 1)))


def _linearise() -> None:
    rest = solve_equilibrium(_PENDULUM, _SPRING, np.zeros((1, 1)))
    response(second_order_model(_PENDULUM, _SPRING, _DAMPER, rest.position), _ONE * 10.0)


def _simulate(n_lane: int) -> None:
    controller = Controller(_ONE * 0.1, _ONE, _ONE, _ONE, _ONE * 10, _ONE * 0)
    state = rest_state(_PENDULUM, _SPRING, np.zeros((n_lane, 1)))
    simulate(_PENDULUM, _SPRING, _DAMPER, controller, state, np.zeros((n_lane, 2, 1)))


def _prescribe() -> None:
    state = rest_state(_PENDULUM, _SPRING, np.zeros((LANES, 1)))
    motion = MotorMotion(np.zeros((LANES, 1)), np.zeros((LANES, 1)), np.zeros((LANES, 4, 1)))
    prescribe([MechanicalModel(_PENDULUM, _SPRING, _DAMPER)], [state], motion)


WARM_UP: dict[str, Callable[[], None]] = {
    "simulation of one experiment": lambda: _simulate(1),
    "simulation of eight experiments at once": lambda: _simulate(LANES),
    "positions at rest": _rest,
    "linear models": _linearise,
    "torque of a prescribed motion": _prescribe,
}
"""What is compiled, and the call that compiles it."""
