"""Measurements of the reference bench's plants: what the drives of a plant would have recorded, as a Record.

Motion, settling and start are those of `acquisition.drives`: the motors start at rest where the motion has the pose in
its middle, a first period settles, the next ones are kept.
"""

from __future__ import annotations

import dataclasses
import logging
import sys
from pathlib import Path

import numpy as np

from robid_core import Channel, Context, DenseRun, Record, Robot, mean_travel
from robid_core.testing import example_context

sys.path.append(str(Path(__file__).parents[2] / "tests"))
from reference.excitation_class import ExcitationClass

from robid_core import FloatArray

SEED = 20261122  # of all measurements of this study; those of the bench itself have another
BLOCKS, PERIODS, SETTLE_PERIODS = 4, 2, 1


def quiet() -> Context:
    """Context for stages whose words nobody reads."""
    log = logging.getLogger("robid.studies")
    log.setLevel(logging.ERROR)
    return dataclasses.replace(example_context(), log=log)


def chance(plant: int, pose: int, seed: int) -> np.random.Generator:
    """Generator of one measurement: each (plant, pose, seed) is drawn once and belongs to nothing else."""
    return np.random.default_rng(np.random.SeedSequence(SEED, spawn_key=(plant, pose, seed)))


def references(
    excitation: ExcitationClass, n_block: int, generator: np.random.Generator, n_exp: int | None = None
) -> FloatArray:
    """Speed references of blocks, (n_block, n_exp, n_sample, n_axis), rad/s: experiments as axes, or one more."""
    drawn = [excitation.block(generator, n_exp) for _ in range(n_block)]
    return np.stack([fast + slow for fast, slow in drawn])


def measure(
    robot: Robot,
    angle: FloatArray,
    excitation: ExcitationClass,
    reference: FloatArray,
    noise_seed: int | None,
    *,
    n_period: int = PERIODS,
) -> Record:
    """Record of one configuration.

    Parameters
    ----------
    robot
        The plant, with its sensors.
    angle
        The configuration, joint side, rad, shape (n_axis,).
    excitation
        Whose lines and sampling the references have.
    reference
        Shape (n_block, n_exp, n_sample, n_axis).
    noise_seed
        Draws the sensors' noise; None: none.
    n_period
        Periods kept.
    """
    n_sample, n_axis = reference.shape[2:]
    step = excitation.sample_time_s
    lanes = reference.reshape(-1, n_sample, n_axis)
    start = robot.motor_angle(angle) - mean_travel(lanes, step)
    whole = np.tile(lanes, (1, SETTLE_PERIODS + n_period, 1))
    result = robot.simulate(whole, robot.joint_angle(start), noise_seed)
    shape = (1, *reference.shape[:2], n_period, n_sample, n_axis)
    kept = SETTLE_PERIODS * n_sample
    channels = {
        "motor_position": Channel("motor", "rad", result.position[:, kept:].reshape(shape)),
        "motor_torque": Channel("motor", "N m", result.torque[:, kept:].reshape(shape)),
        "speed_reference": Channel("motor", "rad/s", np.broadcast_to(reference[None, :, :, None], shape)),
    }
    time_s = np.arange(n_sample, dtype=np.float64) * step
    run = DenseRun(step, channels, time_s, np.ones(shape[:-1], dtype=bool))
    return Record(
        robot.axis_names, "reference bench", "zero_order_hold", (run,), angle[None], excitation.line
    )


def first_experiments(record: Record, count: int) -> Record:
    """The first experiments of a record: whole blocks, or the first ones of the first block."""
    n_exp = record.run.valid.shape[2]
    blocks, left = divmod(count, n_exp)
    if left and blocks:
        raise ValueError(f"{count} experiments are neither whole blocks of {n_exp} nor less than one")
    part = (slice(None), slice(max(blocks, 1)), slice(left or n_exp))
    channels = {
        name: Channel(channel.side, channel.unit_symbol, channel.values[part])
        for name, channel in record.run.channels.items()
    }
    return record.replace(runs=(record.run.replace(channels=channels, valid=record.run.valid[part]),))
