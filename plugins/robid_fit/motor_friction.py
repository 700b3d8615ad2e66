"""Friction of the motors after a torque fit: in the numbers of a robot file, over speed, and what these leave."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core import Doubt, FloatArray, FrictionCurve, Model, ParameterTable, Robot
from robid_core.estimation.torque.nearest_friction import NearestFriction
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.residual import TorqueProblem

NARROWER = 0.67  # times a zero-speed width, and more: functions about it are narrow enough
WIDER = 4.0  # likewise, and less: wide enough
THINNED = 5  # every so many samples of the speeds
POINTS = 61  # of a curve, closer to one another where friction changes its direction
LEFT = 0.02  # of the friction: less is drawn and not told
SURE = 3.0  # standard errors of the curve, likewise


def are_alike(laws: SpeedFunctions, others: SpeedFunctions) -> bool:
    """Whether the widths that others are laid about lie among those of some functions of speed."""
    ratio = others.odd[0] / laws.odd[0]
    return bool(((ratio > NARROWER) & (ratio < WIDER)).all())


def carried(problem: TorqueProblem, point: FloatArray, other: TorqueProblem) -> FloatArray:
    """Return the unknowns of a problem with other functions of speed: what they add up to is the same."""
    speed = np.concatenate(
        [block.motion.rate(1).reshape(-1, problem.free.robot.n_axis)[::THINNED] for block in problem.blocks]
    )
    found = point.copy()
    size, own = problem.friction_size(point), other.friction_size(found)
    own[:-1] = other.blocks[0].laws.meeting(problem.blocks[0].laws, size[:-1], speed)
    return found


def with_friction(table: ParameterTable, robot: Robot, model: Model) -> ParameterTable:
    """Return the table with friction as the model has it: the same numbers as in the robot file that is written."""
    errors = dict(zip(model.free_names, np.sqrt(np.diag(model.covariance)).tolist(), strict=True))
    values = dict(zip(model.names, model.value.tolist(), strict=True))
    told = robot.parameters()
    found = [name for name in model.free_names if name.startswith("friction.")]
    kept = [i for i, name in enumerate(table.names) if name not in found]
    n_robot = sum(table.groups[i] != "nuisance" for i in kept)

    def joined(old: FloatArray, new: Sequence[float]) -> FloatArray:
        return np.concatenate((old[kept[:n_robot]], np.array(new), old[kept[n_robot:]]))

    def words(old: tuple[str, ...], new: Sequence[str]) -> tuple[str, ...]:
        return (*(old[i] for i in kept[:n_robot]), *new, *(old[i] for i in kept[n_robot:]))

    n_found = len(found)
    return ParameterTable(
        names=words(table.names, found),
        units=words(table.units, [robot.parameter_unit(name) for name in found]),
        groups=words(table.groups, [robot.parameter_kind(name) for name in found]),
        start=joined(table.start, [told[name] for name in found]),
        estimate=joined(table.estimate, [values[name] for name in found]),
        standard_error=joined(table.standard_error, [errors[name] for name in found]),
        reported=joined(table.reported.astype(float), [0.0] * n_found).astype(bool),
        at_bound=joined(table.at_bound.astype(float), [0.0] * n_found).astype(bool),
        prior=None if table.prior is None else joined(table.prior, [np.nan] * n_found),
    )


def curves_of(
    problem: TorqueProblem, point: FloatArray, friction: Sequence[NearestFriction]
) -> tuple[FrictionCurve, ...]:
    """Return friction over speed of each motor: the free functions, and the nearest friction of a robot file."""
    robot, laws = problem.free.robot, problem.blocks[0].laws
    size = problem.friction_size(point)
    values = problem.free.values(point[: problem.n_free])
    fastest = np.max([np.abs(block.motion.rate(1)).max(axis=(0, 1, 2)) for block in problem.blocks], axis=0)
    found = []
    for a, (axis, own) in enumerate(zip(robot.axis_names, friction, strict=True)):
        share = np.linspace(-1, 1, POINTS)
        speed = fastest[a] * share * np.abs(share)
        shapes = np.stack([law[:, 0] for law in laws.of_axis(a).along(speed[:, None])], axis=1)
        viscous = values.get(f"friction.{axis}.viscous", 0.0)
        found.append(
            FrictionCurve(
                axis=axis,
                law=", ".join(name for name in own.names if name != "speed")
                + f", transition speed {own.width:.3g} rad/s",
                speed_unit=robot.parameter_unit(f"friction.{axis}.speed"),
                unit_symbol=robot.parameter_unit(f"friction.{axis}.coulomb"),
                speed=speed,
                measured=shapes @ size[:-1, a] + size[-1, a] + viscous * speed,
                fitted=own.torque(speed),
            )
        )
    return tuple(found)


def other_shapes(robot: Robot, friction: Sequence[NearestFriction]) -> tuple[Doubt, ...]:
    """Remark on friction that is another function of speed than a robot file's."""
    found = {
        axis: own.left / own.size
        for axis, own in zip(robot.axis_names, friction, strict=True)
        if own.left > max(SURE * own.uncertainty, LEFT * own.size)
    }
    if not found:
        return ()
    of_axes = ", ".join(f"{axis} ({100 * share:.2g} % of it is left)" for axis, share in found.items())
    return (
        Doubt(
            "friction",
            f"friction over speed is not Coulomb and viscous: {of_axes}",
            "springs do not depend on it, the robot file's friction does: `robid diagnose` names the law",
            "remark",
        ),
    )
