"""What was measured, as blocks of a torque problem: spectra of records, variants under their robots."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from robid_core.artifacts import Record
from robid_core.errors import ConfigurationError, DataRejected
from robid_core.estimation.torque.periodic import PeriodicMotion, periodic_motion_of
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.windowed import WindowedMotion, windowed_motion_of
from robid_core.residual.periodic_block import PeriodicBlock
from robid_core.residual.windowed_block import WindowedBlock
from robid_core.robot import Robot
from robid_core.settings_types import RobotName


def spectra_of(record: Record, discard: int, highest_hz: float) -> PeriodicMotion | WindowedMotion:
    """Return the spectra of a record: of its periods, or of all of it where nothing repeats."""
    run = record.run
    if record.torque_hold != "zero_order_hold":
        raise DataRejected(
            f"the torque is said to be {record.torque_hold}; the torque residual needs a held one"
        )
    if not run.valid[:, :, :, discard:].all():
        raise DataRejected("a sample is missing in a period that is kept; drop its period")
    position, torque = (run.values(name)[:, :, :, discard:] for name in ("motor_position", "motor_torque"))
    if record.line is None:
        n_config, n_axis = position.shape[0], position.shape[-1]
        n_time = position.shape[3] * position.shape[4]
        shape = (n_config, -1, n_time, n_axis)
        return windowed_motion_of(
            position.reshape(shape), torque.reshape(shape), run.sample_time_s, highest_hz
        )
    if run.n_period - discard < 2:
        raise DataRejected(
            f"{run.n_period - discard} period is left; two are needed to tell the noise: measure "
            "more periods (acquisition: periods)"
        )
    return periodic_motion_of(position, torque, run.sample_time_s, record.line, highest_hz)


def functions_of_speed(
    robot: Robot, motions: Sequence[MotionSpectra], widths: tuple[float, ...] | None
) -> SpeedFunctions:
    """Return the free functions of speed, the same for all records."""
    if widths is not None:
        return SpeedFunctions.of_widths(widths, robot.n_axis)
    power = [(motion.rate(1) ** 2).mean(axis=(0, 1, 2)) for motion in motions]
    return SpeedFunctions.about(robot.drives.friction_speed, np.sqrt(np.max(power, axis=0)))


def block_of(
    motion: PeriodicMotion | WindowedMotion, robot: Robot, laws: SpeedFunctions
) -> PeriodicBlock | WindowedBlock:
    """Return the block of one record under its robot."""
    if isinstance(motion, PeriodicMotion):
        return PeriodicBlock.of_record(robot, motion, laws)
    return WindowedBlock.of_record(robot, motion, laws)


def variants_of(
    record: Record, robot: Robot, robots: Mapping[str, RobotName], names: tuple[str, ...]
) -> Iterator[tuple[Record, Robot]]:
    """Part the record by variants, each with its robot, which must have the free parameters."""
    found = tuple(dict.fromkeys(record.variants)) or ("",)
    unmeasured = [variant for variant in robots if variant not in found]
    if unmeasured:
        raise ConfigurationError(
            f"robots: nothing was measured as '{unmeasured[0]}'; the record has "
            + (f"the variants {', '.join(found)}" if record.variants else "no variants")
        )
    if len(found) > 1 and len(found) - len(robots) > 1:
        raise ConfigurationError(
            f"the record has the variants {', '.join(found)}; tell the robot of each that is not the nominal one, "
            f"`robots: {{{found[-1]}: {found[-1]}.yaml}}`, or choose one with `variant:` where it is read"
        )
    for variant in found:
        own = Robot.load(robots[variant]) if variant in robots else robot
        missing = [name for name in names if name not in own.layout]
        if missing:
            raise ConfigurationError(
                f"robots: {variant}: it has no parameter {missing[0]}, which is free; give it `base: {robot.name}`"
            )
        if len(found) == 1:
            yield record, own
            continue
        chosen = np.array([name == variant for name in record.variants])
        whole = np.broadcast_to(chosen[:, None, None], record.run.valid.shape[:3])
        yield record.part(whole), own
