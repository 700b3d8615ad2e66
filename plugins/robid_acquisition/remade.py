"""Slips that need a recording made anew: speeds or counts for angles, exchanged channels, another clock."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid_acquisition.below_resonance import cutoff_of, long_experiments, recorded_below
from robid_acquisition.coarse_angles import coarse_steps
from robid_core import Record, RobidError, Robot, other_sampling
from robid_core.estimation.rigid.counts_for_angles import bare_counts_in
from robid_core.estimation.rigid.exchanged_channels import exchanged_in
from robid_core.estimation.rigid.mended import Mended, mends
from robid_core.estimation.rigid.plausibility import Recorded, Slip
from robid_core.estimation.rigid.speeds_for_angles import speeds_in
from robid_core.residual import rigid_drives

_OF_SPEED = (
    "motor_position: the column of the angle; this one is motor_speed, unit: rad/s; where only speeds were recorded, "
    "add a column with their integral, from the angle on at which the recording began"
)


def remade_of(record: Record, robot: Robot, explained: float) -> Slip | None:
    """Return what explains most of why a record does not fit the robot, where that is more than `explained`."""
    best = None
    for kind in (_speeds, _exchanged, _counts, _clock):
        try:
            for slip, mended in kind(record, robot):
                if mended.explained > explained:
                    explained, best = mended.explained, slip
        except (RobidError, ArithmeticError):  # nothing is known of this kind
            continue
    return best


def _slip(what: str, remedy: str, mended: Mended, robot: Robot) -> Slip:
    same = np.eye(robot.n_axis)
    return Slip(what, remedy, same, same, mended.before, mended.after)


def _named(mended: Mended, robot: Robot, one: str, many: str) -> str:
    """Say what the angle of one axis, or the angles of many, look like."""
    names = ", ".join(robot.axis_names[a] for a in mended.axes)
    return f"the angle of {names} {one}" if len(mended.axes) == 1 else f"the angles of {names} {many}"


def _speeds(record: Record, robot: Robot) -> Iterator[tuple[Slip, Mended]]:
    """Angles that are speeds."""
    step, cutoff = record.runs[0].sample_time_s, cutoff_of(record, robot)
    if found := speeds_in(rigid_drives(robot), long_experiments(record, cutoff), step, cutoff):
        what = _named(found, robot, "looks like a speed", "look like speeds")
        yield _slip(what, _OF_SPEED, found, robot), found


def _exchanged(record: Record, robot: Robot) -> Iterator[tuple[Slip, Mended]]:
    """Angles that are torques, and the other way round."""
    step, cutoff = record.runs[0].sample_time_s, cutoff_of(record, robot)
    if found := exchanged_in(rigid_drives(robot), long_experiments(record, cutoff), step, cutoff):
        what = _named(found, robot, "and its torque are exchanged", "and their torques are exchanged")
        remedy = "motor_position: the column of the torque, motor_torque: that of the angle"
        yield _slip(what, remedy, found, robot), found


def _counts(record: Record, robot: Robot) -> Iterator[tuple[Slip, Mended]]:
    """Angles that are counts of an encoder."""
    axes = list(coarse_steps(record, robot))
    recorded = recorded_below(record, robot) if axes else None
    if recorded is not None and (found := bare_counts_in(recorded, axes)):
        turns, mended = found
        what = _named(mended, robot, "looks like counts of an encoder", "look like counts of encoders")
        remedy = f"motor_position: unit: counts, unit_to: rad, scale: {2 * np.pi / turns[0]:.9g}"
        yield _slip(f"{what}, {' or '.join(map(str, turns))} a turn", remedy, mended, robot), mended


def _clock(record: Record, robot: Robot) -> Iterator[tuple[Slip, Mended]]:
    """Samples that were taken as often as the robot's drives take them, where another time is stated."""
    stated, step = record.runs[0].sample_time_s, robot.sample_time_s
    recorded = recorded_below(record, robot) if other_sampling(stated, robot) else None
    if recorded is None:
        return
    cutoff = cutoff_of(record, robot, step)
    experiments = long_experiments(record, cutoff_of(record, robot))
    drives = rigid_drives(robot)
    before, after = recorded.left, Recorded.of_experiments(drives, experiments, step, cutoff).left
    if mends(before, after):
        mended = Mended.of_shares(tuple(range(robot.n_axis)), before, after)
        what = f"the samples look {step:g} s apart, as those of the robot's drives, and not {stated:g} s"
        yield _slip(what, f"sample_time_s: {step:g}, without time_column", mended, robot), mended
