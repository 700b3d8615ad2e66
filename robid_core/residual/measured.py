"""What was measured, as blocks of a torque problem: spectra of records, variants under their robots."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import cast, get_args

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import Record
from robid_core.errors import ConfigurationError, DataRejected
from robid_core.estimation.torque.periodic import PeriodicMotion, periodic_motion_of
from robid_core.estimation.torque.quick_lengths import quick_length
from robid_core.estimation.torque.spectra import Hold, MotionSpectra
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.windowed import WindowedMotion, windowed_motion_of
from robid_core.residual.arm_sensors import ArmSpectra, arm_spectra_of
from robid_core.residual.moving_samples import MovingSamples
from robid_core.residual.periodic_block import PeriodicBlock
from robid_core.residual.windowed_arm import WindowedArm
from robid_core.residual.windowed_block import WindowedBlock
from robid_core.robot import Robot

SHARPEST = 0.1  # of the change of a speed within a sample


def hold_of(record: Record) -> Hold:
    """Return how a record's torques go between samples; DataRejected where it says what nobody knows."""
    if record.torque_hold not in get_args(Hold):
        raise DataRejected(
            f"torque_hold is '{record.torque_hold}', and must be one of {', '.join(get_args(Hold))}"
        )
    return cast(Hold, record.torque_hold)


def spectra_of(
    record: Record, discard: int, highest_hz: float, sample_time_s: float
) -> PeriodicMotion | WindowedMotion:
    """Return the spectra of a record: of its periods, or of all of it where nothing repeats.

    `sample_time_s` is that of the drives of the robot, of which clocks of records differ little (`check_sampling`):
    simulations go by its steps.
    """
    run = record.run
    if not run.valid[:, :, :, discard:].all():
        raise DataRejected(
            "a sample is missing in a period that is kept; drop its period, or read the record with gaps: split"
        )
    position, torque = (run.values(name)[:, :, :, discard:] for name in ("motor_position", "motor_torque"))
    if record.line is None:
        n_config, n_axis = position.shape[0], position.shape[-1]
        n_time = position.shape[3] * position.shape[4]
        shape, kept = (n_config, -1, n_time, n_axis), quick_length(n_time)
        return windowed_motion_of(
            position.reshape(shape)[:, :, :kept],
            torque.reshape(shape)[:, :, :kept],
            sample_time_s,
            highest_hz,
            hold_of(record),
        )
    if run.n_period - discard < 2:
        raise DataRejected(
            f"{run.n_period - discard} period is left; two are needed to estimate the noise: measure "
            "more periods (acquisition: periods)"
        )
    sampled = sample_time_s, record.line, highest_hz, hold_of(record)
    return periodic_motion_of(position, torque, *sampled)


def functions_of_speed(
    robot: Robot,
    motions: Sequence[MotionSpectra],
    widths: tuple[float, ...] | None,
    about: FloatArray | None = None,
) -> SpeedFunctions:
    """Return the free functions of speed, the same for all records.

    Of `widths`, rad/s, where they are given; else about the zero-speed widths of friction, rad/s, (n_axis,): those of
    the robot's file, or others.
    """
    if widths is not None:
        return SpeedFunctions.of_widths(widths, robot.n_axis)
    power = [(motion.rate(1) ** 2).mean(axis=(0, 1, 2)) for motion in motions]
    told = robot.drives.friction_speed if about is None else about
    return SpeedFunctions.about(told, np.sqrt(np.max(power, axis=0)))


def resolved_width(robot: Robot, angle: FloatArray, width: FloatArray) -> FloatArray:
    """Zero-speed widths of friction, not below what samples resolve, rad/s, (n_axis,).

    That is a share of what the torque of friction does to a motor's speed within a sample, in the pose `angle`, rad,
    (n_axis,).
    """
    mass = robot.second_order(angle[None]).mass[0]
    mobility = np.linalg.inv(mass).diagonal()[: robot.n_axis]
    change = robot.drives.coulomb * mobility * robot.sample_time_s
    return np.maximum(width, SHARPEST * change)


def arm_side_of(
    record: Record, motion: PeriodicMotion | WindowedMotion, discard: int, channels: Sequence[str]
) -> ArmSpectra | None:
    """Return the spectra of sensors behind the gears; none where no channel is asked for."""
    if not channels:
        return None
    if isinstance(motion, WindowedMotion):
        return WindowedArm.of_run(record.run, motion, tuple(channels))
    return arm_spectra_of(record.run, discard, len(motion.bin), channels)


def block_of(
    motion: PeriodicMotion | WindowedMotion,
    robot: Robot,
    laws: SpeedFunctions,
    arm: ArmSpectra | None = None,
    moving: MovingSamples | None = None,
) -> PeriodicBlock | WindowedBlock:
    """Return the block of one record under its robot; `moving`: samples that count."""
    if isinstance(motion, PeriodicMotion):
        return PeriodicBlock.of_record(robot, motion, laws, arm, moving)
    assert arm is None or isinstance(arm, WindowedArm)
    return WindowedBlock.of_record(robot, motion, laws, arm, moving)


def parts_by_variant(record: Record) -> Iterator[tuple[str, Record]]:
    """Part a record by its variants; "" is the name where it has none."""
    found = _variants([record])
    for variant in found:
        if len(found) == 1:
            yield variant, record
            continue
        chosen = np.array([name == variant for name in record.variants])
        yield variant, record.part(np.broadcast_to(chosen[:, None, None], record.run.valid.shape[:3]))


def check_variants(
    records: Sequence[Record],
    robot: Robot,
    robots: Mapping[str, Robot],
    names: Sequence[str],
    own: Collection[str] = (),
) -> None:
    """Refuse variants that have no robot, and robots that are not variants of the nominal one.

    Parameters
    ----------
    records, robot, robots
        What was measured, the nominal robot, and those of variants that have another.
    names
        Free parameters: all robots share them, so that each must have them and be told the same.
    own
        Those of `names` that belong to one variant.

    Raises
    ------
    ConfigurationError
        The message names the variant.
    """
    found = _variants(records)
    unmeasured = [variant for variant in robots if variant not in found]
    if unmeasured:
        measured = [name for name in found if name]
        raise ConfigurationError(
            f"robots: nothing was measured as '{unmeasured[0]}'; the record has "
            + (f"the variants {', '.join(measured)}" if measured else "no variants")
        )
    nominal = [variant for variant in found if variant and variant not in robots]
    if len(nominal) > 1:
        raise ConfigurationError(
            f"the record has the variants {', '.join(name for name in found if name)}; give the robot of each that is "
            f"not the nominal one, `robots: {{{nominal[-1]}: {nominal[-1]}.yaml}}`, or choose one with `variant:` "
            "where it is read"
        )
    for variant, other in robots.items():
        for name in (one for one in names if one not in own):
            if name not in other.layout:
                raise ConfigurationError(
                    f"robots: {variant}: it has no parameter {name}, which is free; give it `base: {robot.name}`"
                )
            if other.parameter(name) != robot.parameter(name):
                raise ConfigurationError(
                    f"robots: {variant}: {name} is free and shared, but has another value than in {robot.name} "
                    f"({other.parameter(name):g}, {robot.parameter(name):g}); say what differs as an effect "
                    "(load.payload), or hold it"
                )


def _variants(records: Sequence[Record]) -> tuple[str, ...]:
    """Names of all variants, "" where a record has none."""
    return tuple(dict.fromkeys(name for record in records for name in record.variants or ("",)))
