"""A torque problem from a record and a robot: what is free by default, blocks of all variants, functions of speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from robid_core.artifacts import Record
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.parameters import FreeParameters
from robid_core.residual.measured import block_of, spectra_of, variants_of
from robid_core.residual.problem import TorqueProblem
from robid_core.robot import Robot
from robid_core.settings_types import RobotName

NOUNS = (
    "gear_stiffness", "gear_damping", "bearing_stiffness", "bearing_damping", "rotor_inertia",
    "mass", "centre_of_mass", "inertia",
)  # fmt: skip


def default_patterns(robot: Robot) -> tuple[str, ...]:
    """Springs, dampers, viscous friction and inertia, as far as the robot has them."""
    heads = {name.partition(".")[0] for name in robot.layout}
    return ("friction.*.viscous", *(f"{noun}.*" for noun in NOUNS if noun in heads))


def torque_problem(
    records: Sequence[Record],
    robot: Robot,
    names: Sequence[str],
    prior: Mapping[str, float],
    speed_functions: Callable[[Robot, Sequence[MotionSpectra]], SpeedFunctions],
    *,
    robots: Mapping[str, RobotName] | None = None,
    discard: int = 0,
    highest_hz: float = 100.0,
    each_delay: bool = False,
) -> TorqueProblem:
    """Prepare what is minimised.

    Parameters
    ----------
    records, robot
        What was measured, and the robot that a fit begins with.
    names
        Parameters that are free.
    prior
        Standard deviations by pattern, in natural scales.
    speed_functions
        Chooses the functions of speed that stand for the friction of the motors, from the robot and the motions.
    robots
        Under which variants of the record were measured, where they are not the nominal one.
    discard
        Leading periods dropped as transient.
    highest_hz
        Bins above are left out.
    each_delay
        Whether each axis has a delay of its own.

    Raises
    ------
    DataRejected
        Where the record cannot be used.
    ConfigurationError
        Where variants and robots do not fit.
    """
    free = FreeParameters.of_robot(_bare(robot), names, dict(prior))
    parts = [
        (spectra_of(part, discard, highest_hz), _bare(own))
        for record in records
        for part, own in variants_of(record, robot, robots or {}, free.names)
    ]
    laws = speed_functions(robot, [motion for motion, _ in parts])
    blocks: tuple[Any, ...] = tuple(block_of(motion, own, laws) for motion, own in parts)
    return TorqueProblem(free, blocks, laws.names, each_delay=each_delay)


def _bare(robot: Robot) -> Robot:
    """Return a robot without the friction of its motors that functions of speed stand for."""
    levels = [n for n in robot.layout if n.startswith("friction.") and n.endswith((".coulomb", ".offset"))]
    return robot.with_parameters(dict.fromkeys(levels, 0.0))
