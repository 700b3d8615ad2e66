"""Derivatives that the linear model's spectra do not know: by prescribed motions, or by the linear model over time."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.parameters import FreeParameters
from robid_core.residual.motor_laws import braking_beside, motor_effects
from robid_core.robot import Robot

if TYPE_CHECKING:
    from robid_core.residual.block import TorqueBlock

DIFFERENCE = 1e-3  # step of derivatives by two prescribed motions, in natural scales
FINE_DIFFERENCE = 1e-5  # in a cut: near a lightly damped resonance large derivatives cancel
ELASTIC = ("stiffness", "damping")
LANES_AT_ONCE = 32  # robots times experiments: what bounds the memory of motions that run together


@dataclass(frozen=True, eq=False)
class SimulatedColumn:
    """Derivatives for a parameter that are not those of the linear model's spectra, by a difference of two robots."""

    index: int
    """Number of the parameter among the free ones."""
    remainder: ComplexArray
    """Of the remainder, shape (n_config, n_exp, n_bin, n_row)."""
    linear: ComplexArray
    """Of the linear model's rows, likewise."""


def simulated_columns(
    block: TorqueBlock[Any], free: FreeParameters, coordinates: FloatArray
) -> tuple[SimulatedColumn, ...]:
    """Derivatives of a block's rows at a point, after `renew` there.

    Of effects, gears and modes; with nonlinear springs of the linear ones, too: what they do depends on how far the
    others are bent. Of everything where the linear model is not enough, or where passes do not keep what they gain; of
    bodies only once where the state at the first sample is known, since they hardly change then. Of effects on the
    structure the linear model knows enough, elsewhere.
    """
    robot = block.robot_at(free, coordinates)
    kinds = [free.robot.parameter_kind(name) for name in free.names]
    lasting = () if block.initial_state_unknown else ("inertia",)
    columns = {column.index: column for column in block.simulated if kinds[column.index] in lasting}
    known = {*columns, *(column.index for column in block.signal_columns)}
    known |= {i for i, name in enumerate(free.names) if name not in robot.layout}
    numbers = [i for i, kind in enumerate(kinds) if _needs_motion(block, kind, robot) and i not in known]
    laws = {bound.label for bound in robot.effects}
    structural = [i for i in numbers if _is_structure(block, free.names[i], kinds[i], laws, robot)]
    in_time = [i for i in numbers if i not in structural and kinds[i] in ("inertia", "friction", *ELASTIC)]
    found = {i: _moved(block, free, coordinates, i) for i in numbers}
    here = block.linear_rows(robot)
    linear = {i: (block.linear_rows(other) - here) / step for i, (other, step) in found.items()}
    still = np.zeros_like(block.remainder[:1, :1, :1, :1])
    remainders = {i: np.broadcast_to(still, linear[i].shape) for i in structural}
    others, steps = [found[i][0] for i in in_time], [found[i][1] for i in in_time]
    slopes = block.slopes_in_time(robot, others, steps) if in_time and block.by_motion != "all" else None
    remainders |= dict(zip(in_time, slopes or (), strict=False))
    remainders |= _of_motor_laws(
        block, robot, free.names, {i: found[i] for i in numbers if i not in remainders}
    )
    remainders |= _by_motion(block, robot, {i: found[i] for i in numbers if i not in remainders})
    columns |= {i: SimulatedColumn(i, remainders[i], linear[i]) for i in numbers}
    return tuple(columns[i] for i in sorted(columns))


def _of_motor_laws(
    block: TorqueBlock[Any], robot: Robot, names: Sequence[str], moved: dict[int, tuple[Robot, float]]
) -> dict[int, ComplexArray]:
    """Derivatives by parameters of effects on motors: they brake, and do nothing to a prescribed motion."""
    labels, slopes = motor_effects(robot), dict[int, ComplexArray]()
    for i, (other, step) in moved.items():
        if names[i].startswith("effect.") and names[i].split(".")[1] in labels:
            laws = [own.of_robot(other) for own in block.on_motors]
            slopes[i] = np.zeros_like(block.remainder)
            braking = braking_beside(laws, other, block.motion, block.linear_torque)
            slopes[i][..., : robot.n_axis] = (braking - block.braking) / step
    return slopes


def _by_motion(
    block: TorqueBlock[Any], robot: Robot, moved: dict[int, tuple[Robot, float]]
) -> dict[int, ComplexArray]:
    """Derivatives of the remainder by motions prescribed to robots of which one parameter is moved by a step."""
    slopes: dict[int, ComplexArray] = {}
    if not moved:
        return slopes
    # Motions that repeat go on from where the last one ended: what rings must ring alike on both sides.
    goes_on = not block.initial_state_unknown
    about = block.remainders([robot], final=False)[0] if goes_on else block.remainder
    numbers = list(moved)
    n_config, n_exp = block.remainder.shape[:2]
    size = max(1, LANES_AT_ONCE // (n_config * n_exp))
    for first in range(0, len(numbers), size):
        batch = numbers[first : first + size]
        remainders = block.remainders([moved[i][0] for i in batch], final=False)
        for i, remainder in zip(batch, remainders, strict=True):
            slopes[i] = (remainder - about) / moved[i][1]
    return slopes


def _needs_motion(block: TorqueBlock[Any], kind: str, robot: Robot) -> bool:
    """Whether the linear model's spectra do not know the derivative for a parameter of that kind."""
    elastic = kind in ELASTIC
    bent = bool(robot.bending_forces) and block.by_motion != "least"
    known = block.linear_is_enough and (kind in ("inertia", "friction") or (elastic and not bent))
    asked = block.by_motion == "all" and (elastic or kind == "inertia")
    return asked or not known


def _is_structure(block: TorqueBlock[Any], name: str, kind: str, laws: Collection[str], robot: Robot) -> bool:
    """Whether a parameter belongs to an effect on the structure that the linear model knows well enough."""
    plain = block.by_motion != "all" and not robot.bending_forces
    return plain and block.linear_is_enough and kind == "effect" and name.split(".")[1] not in laws


def _moved(
    block: TorqueBlock[Any], free: FreeParameters, coordinates: FloatArray, number: int
) -> tuple[Robot, float]:
    """Robot with one parameter moved, and by how much: down, where up is no robot (one level above another)."""
    size = FINE_DIFFERENCE if block.initial_state_unknown else DIFFERENCE
    for step in (size, -size):
        moved = coordinates.copy()
        moved[number] += step
        robot = block.robot_at(free, moved)
        if robot.is_possible:
            break
    return robot, step
