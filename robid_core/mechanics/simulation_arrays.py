"""How states, controller and signals lie in memory for the simulation; the last axis of states is the lanes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from robid_core.arrays import FloatArray, IntArray
from robid_core.compiled.laws import N_INPUT, N_OUTPUT, Entries
from robid_core.compiled.memory import aligned_arrays
from robid_core.mechanics.chain_arrays import ChainArrays, ChainWork, chain_arrays, chain_work
from robid_core.mechanics.mechanical_model import MechanicalModel, PlantArrays, plant_arrays, spring_weights
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.term_arrays import TermArrays, term_arrays
from robid_core.mechanics.terms import SignalTerm


class StepWork(NamedTuple):
    """Memory of one step beside that of the chain; last axis: lanes."""

    joint: FloatArray  # (n_joint,) where the chain is evaluated
    joint_speed: FloatArray  # (n_joint,)
    middle: FloatArray  # (n,) where M, c, g and laws are evaluated
    middle_speed: FloatArray  # (n,)
    spring: FloatArray  # (n,) position that bends the springs
    start: FloatArray  # (n,) position at the start of the step, for laws with a state
    right: FloatArray  # (n,) right-hand side, then acceleration
    pivot: FloatArray  # (n,) inverse pivots
    system: FloatArray  # (n, n) lower triangle
    stage: FloatArray  # (4, n) accelerations of the stages
    torque: FloatArray  # (n_axis,) acting
    command: FloatArray  # (n_axis,) held
    braking: FloatArray  # (n_axis,) torque per speed that motors under a voltage lose
    load: FloatArray  # (n_axis,) torque that the transmissions pass
    force: FloatArray  # (n_force,) of each law
    slope: FloatArray  # (n_force,) what its slopes add to the system
    place: FloatArray  # (6,) what goes into a law, and what comes out
    next_state: FloatArray  # (n_state,)


class LaneState(NamedTuple):
    """State of robot and controller, motors after the other coordinates; changed in place."""

    position: FloatArray  # (n_block, n, width)
    speed: FloatArray  # (n_block, n, width)
    acceleration: FloatArray  # (n_block, n, width) of the last step, for the extrapolation of the next
    integral: FloatArray  # (n_block, n_axis, width) N m
    reference: FloatArray  # (n_block, n_axis, width) rad
    measured: FloatArray  # (n_block, n_axis, width) rad, at the last sample
    holding_torque: FloatArray  # (n_block, n_axis, width) N m
    law_state: FloatArray  # (n_block, n_state, width)


class ControlArrays(NamedTuple):
    """The cascade controller and its clock."""

    gains: FloatArray  # (n_axis, 7) speed, integral, position, speed feedforward, torque limit, encoder step, back EMF
    sample_time: float
    n_step: int  # integration steps a sample
    runge_kutta: bool


class Signals(NamedTuple):
    """Inputs and outputs, (n_lane, n_sample, n); an input of no rows is absent, so is the output `coordinates`."""

    speed_reference: FloatArray
    position_reference: FloatArray
    torque_feedforward: FloatArray
    position_noise: FloatArray
    torque_noise: FloatArray
    enabled: FloatArray
    position: FloatArray
    torque: FloatArray
    coordinates: FloatArray
    saturated: IntArray  # (n_lane, n_axis) samples at the torque limit
    diverged: IntArray  # (n_lane,) sample at which the lane was stopped, -1 if it was not
    force: FloatArray  # (n_lane, n_force) of the laws when the lane was stopped


class Arrays(NamedTuple):
    """Everything about the robot that the loop reads."""

    chain: ChainArrays
    plant: PlantArrays
    terms: TermArrays


class Work(NamedTuple):
    """Everything that the loop writes on the way."""

    chain: ChainWork
    step: StepWork


def work_memory(mechanism: Mechanism, n_force: int, n_state: int, width: int) -> Work:
    """Allocate the memory of one block of lanes."""
    n, n_joint, n_axis = mechanism.n_coordinate, mechanism.chain.n_coordinate, mechanism.n_axis
    shapes = (
        *((n_joint,), (n_joint,)),
        *((n,), (n,), (n,), (n,), (n,), (n,), (n, n), (4, n)),
        *(
            (n_axis,),
            (n_axis,),
            (n_axis,),
            (n_axis,),
            (n_force,),
            (n_force,),
            (N_INPUT + N_OUTPUT,),
            (n_state,),
        ),
    )
    memory = aligned_arrays(*((*(max(size, 1) for size in shape), width) for shape in shapes))
    return Work(chain_work(n_joint, width), StepWork(*memory))


def robot_arrays(
    models: Sequence[MechanicalModel],
    signals: Sequence[SignalTerm],
    robots: IntArray,
    width: int,
    implicit_step: float,
) -> tuple[Arrays, list[Entries]]:
    """Lay robots of one structure out for the loop.

    Parameters
    ----------
    models
        The robots.
    signals
        Laws on channels, the same for all.
    robots
        Whose numbers the lanes have, as of `in_lanes`.
    width
        Lanes of a block.
    implicit_step
        s; 0 for an explicit method.

    Returns
    -------
    The arrays, and the compiled laws: they must live as long as the arrays are used.
    """
    weight = [spring_weights(model.mechanism, model.stiffness, implicit_step) for model in models]
    terms, entries = term_arrays(models, signals, robots, width, implicit_step, weight)
    chain = chain_arrays([model.mechanism.chain for model in models], robots)
    return Arrays(chain, plant_arrays(models, robots, implicit_step, weight), terms), entries
