"""Mechanics of a robot: pure kernels on arrays, each with a plain numpy twin in `reference`.

`Chain` (bodies and joints) -> `Mechanism` (motors, gears, springs) -> equilibrium -> linear model -> response, and
closed-loop simulation.
"""

from robid_core.mechanics.chain import PRISMATIC, REVOLUTE, Chain
from robid_core.mechanics.dynamics import Dynamics, dynamics
from robid_core.mechanics.equilibrium import Equilibrium, solve_equilibrium
from robid_core.mechanics.friction import equivalent_damping, friction_torque
from robid_core.mechanics.linearize import LinearModel, SecondOrderModel, linear_model, second_order_model
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.response import ResponseGradient, response, response_with_gradient
from robid_core.mechanics.simulate import (
    Controller,
    Friction,
    Simulation,
    SimulationState,
    rest_state,
    simulate,
)
from robid_core.mechanics.warm_up import warm_up

__all__ = [
    "PRISMATIC",
    "REVOLUTE",
    "Chain",
    "Controller",
    "Dynamics",
    "Equilibrium",
    "Friction",
    "LinearModel",
    "Mechanism",
    "ResponseGradient",
    "SecondOrderModel",
    "Simulation",
    "SimulationState",
    "dynamics",
    "equivalent_damping",
    "friction_torque",
    "linear_model",
    "response",
    "response_with_gradient",
    "rest_state",
    "second_order_model",
    "simulate",
    "solve_equilibrium",
    "warm_up",
]
