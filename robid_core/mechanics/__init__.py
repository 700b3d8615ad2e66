"""Mechanics of a robot: pure kernels on arrays, each with a plain numpy twin in `reference`.

`Chain` (bodies and joints) -> `Mechanism` (motors, gears, springs) -> equilibrium -> linear model -> response, and
closed-loop simulation.
"""

from robid_core.compiled.functions import (
    cosine,
    exponential,
    natural_logarithm,
    sine,
    sine_and_cosine,
    smooth_sign,
)
from robid_core.compiled.kernel import kernel
from robid_core.compiled.lanes import where
from robid_core.mechanics.chain import PRISMATIC, REVOLUTE, Chain
from robid_core.mechanics.change import MechanismChange
from robid_core.mechanics.dynamics import Dynamics, dynamics
from robid_core.mechanics.equilibrium import Equilibrium, solve_equilibrium
from robid_core.mechanics.friction import (
    coulomb_viscous_law,
    equivalent_damping,
    friction_terms,
    friction_torque,
)
from robid_core.mechanics.inertial_sensor import InertialSensor
from robid_core.mechanics.linearize import LinearModel, SecondOrderModel, linear_model, second_order_model
from robid_core.mechanics.mechanical_model import MechanicalModel
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.prescribed import (
    MotorMotion,
    mean_over_smooth,
    periodic_motion,
    prescribe,
)
from robid_core.mechanics.response import (
    ResponseGradient,
    response,
    response_with_gradient,
    with_motor_impedance,
)
from robid_core.mechanics.simulate import (
    Controller,
    Simulation,
    SimulationDiverged,
    SimulationState,
    rest_state,
    simulate,
)
from robid_core.mechanics.slopes import (
    SecondOrderSlopes,
    output_slopes,
    response_slopes,
    second_order_slopes,
    torque_slopes,
)
from robid_core.mechanics.terms import ForceTerm, SignalTerm
from robid_core.mechanics.tool import Pose, pose_of
from robid_core.mechanics.warm_up import WARM_UP

__all__ = [
    "WARM_UP",
    "PRISMATIC",
    "REVOLUTE",
    "Chain",
    "Controller",
    "Dynamics",
    "Equilibrium",
    "ForceTerm",
    "InertialSensor",
    "LinearModel",
    "MechanicalModel",
    "Mechanism",
    "MechanismChange",
    "MotorMotion",
    "Pose",
    "ResponseGradient",
    "SecondOrderModel",
    "SecondOrderSlopes",
    "SignalTerm",
    "Simulation",
    "SimulationDiverged",
    "SimulationState",
    "cosine",
    "coulomb_viscous_law",
    "dynamics",
    "equivalent_damping",
    "exponential",
    "friction_terms",
    "friction_torque",
    "kernel",
    "linear_model",
    "mean_over_smooth",
    "natural_logarithm",
    "periodic_motion",
    "pose_of",
    "prescribe",
    "response",
    "response_slopes",
    "response_with_gradient",
    "rest_state",
    "second_order_model",
    "second_order_slopes",
    "simulate",
    "sine",
    "sine_and_cosine",
    "smooth_sign",
    "solve_equilibrium",
    "output_slopes",
    "torque_slopes",
    "where",
    "with_motor_impedance",
]
