"""Whether a record fits the robot file: slips in signs, units, sides of the gear and the order of axes, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from robid_acquisition.below_resonance import recorded_below
from robid_acquisition.remade import remade_of
from robid_core import Record, RobidError, Robot
from robid_core.estimation.rigid.coupled_axes import Coupling, coupling_in
from robid_core.estimation.rigid.encoder_counts import counts_in, explained_by
from robid_core.estimation.rigid.plausibility import Recorded, Slip, slips_in
from robid_core.estimation.rigid.torque_offsets import offsets_in
from robid_core.estimation.rigid.torque_scales import ONE, Scale, scales_in
from robid_core.estimation.rigid.zero_angles import Zero, zeros_in

Found = TypeVar("Found")

AGAINST = 0.3  # of a torque's rms, of the other sign, that motion must ask for; of its variance that the robot leaves
_REMEDY = (
    "look at torque_constant or scale, gear ratio, rotor inertia, and at a load that the robot file lacks"
)


def slips_of(record: Record, robot: Robot) -> list[Slip]:
    """Return slips in a record that explain why it does not fit the robot; none where it does, or cannot be told."""
    try:
        recorded = recorded_below(record, robot)
        slips = [] if recorded is None else slips_in(recorded, robot.axis_names)
        if recorded is None:
            return []
        if remade := remade_of(record, robot, explained_by(recorded, slips[0]) if slips else 0.0):
            return [remade]
        if not slips:
            return []
        doubts = [one.explained for one in (counts_in(recorded), coupling_in(recorded)) if one]
        if doubts and max(doubts) > explained_by(recorded, slips[0]):
            return []  # a doubt explains more
        zeros = tuple(_off(zero, robot) for zero in zeros_in(recorded))
        return [replace(slips[0], ties=slips[0].ties + zeros), *slips[1:]]
    except (RobidError, ArithmeticError):  # nothing is known against the record
        return []


def unsigned_torques(record: Record, robot: Robot) -> list[str]:
    """Say which torques never change their sign although the motion asks for it: absolute values, or unsigned ones."""
    recorded = _found(lambda one: [one], record, robot)
    if not recorded:
        return []
    (seen,), found = recorded, []
    for a, name in enumerate(robot.axis_names):
        lanes = [run.lanes("motor_torque")[..., a] for run in record.runs]
        values = np.concatenate([lane[np.isfinite(lane)] for lane in lanes])
        sign = 1.0 if values.sum() >= 0 else -1.0
        against = np.minimum(sign * seen.rigid[:, a], 0.0)
        power = float((seen.torque[:, a] ** 2).mean())
        if (sign * values >= 0).all() and (against**2).mean() > AGAINST**2 * power and seen.left[a] > AGAINST:
            found.append(
                f"the torque of {name} is never {'negative' if sign > 0 else 'positive'}, and the motion asks for both "
                "signs: it looks like an absolute value, or like unsigned numbers"
            )
    return found


def doubts_of_angle(record: Record, robot: Robot) -> list[str]:
    """Say which axis has another zero or other counts than stated, or is coupled; none where all fit, or none mends."""
    try:
        recorded = recorded_below(record, robot)
        zeros = [] if recorded is None else zeros_in(recorded)
        counts, coupling = (None, None) if recorded is None else (counts_in(recorded), coupling_in(recorded))
    except (RobidError, ArithmeticError):
        return []
    most = max((one.explained for one in (*zeros[:1], counts, coupling) if one), default=0.0)
    if coupling and coupling.explained == most:
        return [_coupled(coupling, robot)]
    if counts and counts.explained == most:
        name = robot.axis_names[counts.axis]
        return [
            f"the angle of {name} is {counts.multiple} what the torques say, as with {counts.multiple} the counts per "
            f"turn (the robot file leaves {100 * counts.before:.0f} % of a torque, {100 * counts.after:.0f} % with the "
            f"angle times {counts.factor:g}): look at scale (motor_position) and at the encoder's counts per turn"
        ]
    if not zeros:
        return []
    first, name = zeros[0], robot.axis_names[zeros[0].axis]
    others = [_off(zero, robot) for zero in zeros[1:]]
    if first.alone:
        others.append(f"the torque of {name} has an offset")
    return [
        f"{', or '.join((_off(first, robot), *others))} (the robot file leaves {100 * first.before:.0f} % of a torque, "
        f"{100 * first.after:.0f} % with the first mended): look at zero (motor_position, joint_position), at the "
        "pose in which the robot file has its axes at zero, and at centres of mass"
    ]


def _coupled(coupling: Coupling, robot: Robot) -> str:
    """Say which joint moves with another motor."""
    axis, motor = robot.axis_names[coupling.axis], robot.axis_names[coupling.motor]
    return (
        f"{axis} moves with the motor of {motor}, by {'' if coupling.sign > 0 else 'minus '}the angle of {motor} "
        f"(the robot file leaves {100 * coupling.before:.0f} % of a torque, {100 * coupling.after:.0f} % with this "
        "coupling): look at coupling in the robot file, and at whether the controller takes it out of the angles"
    )


def _off(zero: Zero, robot: Robot) -> str:
    """Say by how much an angle is off."""
    return f"the angle of {robot.axis_names[zero.axis]} is off by {zero.angle:.3g} rad at the joint"


def doubts_of_scale(record: Record, robot: Robot) -> list[str]:
    """Say which torques fit the robot only with another torque constant; none where they fit, or cannot be told."""
    scales = _found(scales_in, record, robot)
    if len(scales) > 1:
        factors = [one.factor for one in scales]
        told = f"{float(np.exp(np.mean(np.log(factors)))):.2g} times"
        if max(factors) > ONE * min(factors):
            told = f"{', '.join(f'{one:.3g}' for one in factors)} times ({', '.join(_names(scales, robot))})"
        return [
            f"the torques are {told} what the robot makes of the motion: currents, or percents of a rating, in place "
            f"of N m? Else {_REMEDY}"
        ]
    return [
        f"the torque of {robot.axis_names[one.axis]} is {one.factor:.2g} times what the robot makes of the motion (the "
        f"robot file leaves {100 * one.before:.0f} % of it, {100 * one.after:.0f} % where scaled): {_REMEDY}"
        for one in scales
    ]


def _names(scales: Sequence[Scale], robot: Robot) -> list[str]:
    return [robot.axis_names[one.axis] for one in scales]


def doubts_of_offset(record: Record, robot: Robot) -> list[str]:
    """Say which torques fit the robot but for a constant; none where they fit, or cannot be told."""
    offsets = _found(offsets_in, record, robot)
    if len(offsets) > 1:
        names = ", ".join(robot.axis_names[one.axis] for one in offsets)
        sizes = ", ".join(f"{one.torque:.3g}" for one in offsets)
        most = max(offsets, key=lambda one: one.before)
        return [
            f"the torques of {names} are off by constants, {sizes} N m at the motors (the robot file leaves "
            f"{100 * most.before:.0f} % of a torque, {100 * most.after:.0f} % without its constant): a weight that the "
            "robot file lacks does that about few poses; look at loads, at centres of mass, and at zero (motor_torque)"
        ]
    return [
        f"the torque of {robot.axis_names[one.axis]} is off by a constant, {one.torque:.3g} N m at the motor (the "
        f"robot file leaves {100 * one.before:.0f} % of it, {100 * one.after:.0f} % without it): look at zero "
        "(motor_torque), at the offset of friction in the robot file, and at weights that it lacks"
        for one in offsets
    ]


def _found(ask: Callable[[Recorded], list[Found]], record: Record, robot: Robot) -> list[Found]:
    """Return what a record shows below the first resonance; nothing where that cannot be told."""
    try:
        recorded = recorded_below(record, robot)
        return [] if recorded is None else ask(recorded)
    except (RobidError, ArithmeticError):
        return []


def sentence(slips: list[Slip]) -> str:
    """Say what is wrong and what to write."""
    told = "; ".join(
        f"{', or '.join((one.what, *one.ties))} (the robot file leaves {100 * one.before:.0f} % of that torque, and "
        f"{100 * one.after:.0f} % with the first mended; {one.remedy})"
        for one in slips
    )
    return f"the record does not fit the robot file: {told}"
