"""A torque problem from a record and a robot: what is free by default, blocks of all variants, functions of speed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from robid_core.arrays import BoolArray
from robid_core.artifacts import Record
from robid_core.errors import DataRejected
from robid_core.estimation.torque.periodic import PeriodicMotion
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.windowed import WindowedMotion
from robid_core.parameters import FreeParameters
from robid_core.residual.measured import (
    arm_side_of,
    block_of,
    check_variants,
    parts_by_variant,
    spectra_of,
)
from robid_core.residual.moving_samples import MovingSamples, moving_samples
from robid_core.residual.problem import TorqueProblem
from robid_core.robot import Robot
from robid_core.robot.sampling import check_sampling

Motion = PeriodicMotion | WindowedMotion
FEWEST_VALUES = 5.0  # for each unknown function of an axis' speed

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
    robots: Mapping[str, Robot] | None = None,
    own: Collection[str] = (),
    discard: int = 0,
    highest_hz: float = 100.0,
    each_delay: bool = False,
    arm_side: Sequence[str] = (),
    gain_prior: float = 0.01,
    mounting_prior: float = 0.02,
    leave_out_rests: bool = True,
    sticking: Collection[str] | None = None,
    spectra: Callable[[Record, int, float, float], Motion] = spectra_of,
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
        Under which variants of the records were measured, where they are not the nominal one.
    own
        Free parameters that only some of these robots have: each acts in its own.
    discard
        Leading periods dropped as transient.
    highest_hz
        Bins above are left out.
    each_delay
        Whether each axis has a delay of its own.
    arm_side
        Channels of sensors behind the gears that count, too.
    gain_prior
        Standard deviation of their gains, relative.
    mounting_prior
        Standard deviation of the angles by which inertial units are turned on their links, rad.
    leave_out_rests
        Whether samples at which friction holds an axis do not count in its torque: those at which it stands still,
        where motions do not repeat, and sticks.
    sticking
        Axes whose turns do not count; None: those whose angles show that friction holds them there.
    spectra
        `spectra_of`, or one that remembers what it has transformed.

    Raises
    ------
    DataRejected
        Where the record cannot be used.
    ConfigurationError
        Where variants and robots do not fit, or a record and its robot are not sampled alike.
    """
    free = FreeParameters.of_robot(_bare(robot), names, dict(prior))
    check_variants(records, robot, robots or {}, free.names, own)
    measured = [
        (part, (robots or {}).get(variant, robot))
        for record in records
        for variant, part in parts_by_variant(record)
    ]
    for part, under in measured:
        for run in part.runs:
            check_sampling(run.sample_time_s, under)
    parts = [
        (spectra(part, discard, highest_hz, under.sample_time_s), _bare(under)) for part, under in measured
    ]
    arms = [
        arm_side_of(part, motion, discard, arm_side)
        for (part, _), (motion, _) in zip(measured, parts, strict=True)
    ]
    if len({None if arm is None else arm.sensors for arm in arms}) > 1:
        raise DataRejected(
            f"arm_side: records or variants have {' and '.join(arm_side)} of different axes; choose those with the same"
        )
    motions = [motion for motion, _ in parts]
    laws = speed_functions(robot, motions)
    counted = _moving(robot, motions, laws, sticking) if leave_out_rests else dict[int, MovingSamples]()
    blocks: tuple[Any, ...] = tuple(
        block_of(motion, under, laws, arm, counted.get(number))
        for number, ((motion, under), arm) in enumerate(zip(parts, arms, strict=True))
    )
    return TorqueProblem(
        free, blocks, laws.names, each_delay=each_delay, gain_prior=gain_prior, mounting_prior=mounting_prior
    )


def _moving(
    robot: Robot, motions: Sequence[MotionSpectra], laws: SpeedFunctions, sticking: Collection[str] | None
) -> dict[int, MovingSamples]:
    """Samples at which axes move, by the number of a motion with rests.

    Raises DataRejected where too few are left of an axis that is said to stick.
    """
    if sticking is None:
        found = moving_samples(motions)
    else:
        named = np.isin(robot.axis_names, list(sticking))
        found = moving_samples(motions, named)
        _check_enough(robot, motions, found, named, FEWEST_VALUES * (len(laws.odd) + len(laws.even) + 1))
    return {number: own for number, own in enumerate(found) if own is not None}


def _check_enough(
    robot: Robot,
    motions: Sequence[MotionSpectra],
    found: Sequence[MovingSamples | None],
    named: BoolArray,
    fewest: float,
) -> None:
    """Refuse axes that are said to stick, (n_axis,), and of which fewer values count in all."""
    values = np.zeros(robot.n_axis)
    for motion, own in zip(motions, found, strict=True):
        n_run = int(np.prod(motion.angle.shape[:2]))
        values += (
            2 * n_run * len(motion.bin) if own is None else 2 * own.share.sum(axis=(0, 1, 2))[: robot.n_axis]
        )
    few = named & (values < fewest)
    if few.any():
        each = " and ".join(robot.axis_names[axis] for axis in np.flatnonzero(few))
        raise DataRejected(
            f"{each}: without the samples at which an axis turns back too little is left to tell its friction from its "
            "motion; record motions that turn back less often (a large slow one beside the small fast one)"
        )


def _bare(robot: Robot) -> Robot:
    """Return a robot without the friction of its motors that functions of speed stand for."""
    levels = [n for n in robot.layout if n.startswith("friction.") and n.endswith((".coulomb", ".offset"))]
    return robot.with_parameters(dict.fromkeys(levels, 0.0))
