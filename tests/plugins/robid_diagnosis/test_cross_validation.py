"""Blocks of one long motion left out: a law that is there predicts them, values alone do not; wrong input."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from robid_core import Channel, Context, DataRejected, DenseRun, Diagnosis, Record, Robot
from robid_core.residual import prescribe_record
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_diagnosis.cross_validation import CrossValidation

T, SECONDS = 1e-3, 16
BY_LOAD = {"coulomb": 0.0, "load_coulomb": 0.2, "load_excess": 0.0}


def long_motion(robot: Robot, n_exp: int = 1) -> Record:
    """A sum of waves without a common period, on a slow one."""
    generator, time = np.random.default_rng(1), T * np.arange(round(SECONDS / T))
    frequency = generator.uniform(2, 40, (n_exp, 30, 1))
    wave = np.cos(2 * np.pi * frequency * time + generator.uniform(0, 2 * np.pi, frequency.shape)).sum(axis=1)
    reference = wave / wave.std() * 4 + 10 * np.sin(2 * np.pi * 0.31 * time)
    run = robot.simulate(reference[..., None], np.full((n_exp, 1), 0.5), seed=1)
    shape = (1, 1, n_exp, 1, len(time), 1)
    channels = {
        "motor_position": Channel("motor", "rad", run.position.reshape(shape)),
        "motor_torque": Channel("motor", "N m", run.torque.reshape(shape)),
    }
    dense = DenseRun(T, channels, time, np.ones(shape[:5], dtype=bool))
    return Record(robot.axis_names, "simulated", "zero_order_hold", (dense,), np.full((1, 1), 0.5))


def explained(robot: Robot) -> Diagnosis:
    """A diagnosis that found the law at the robot's first axis."""
    extended = robot.with_effect("grease", "friction.load_dependent", robot.axis_names[0], values=BY_LOAD)
    return Diagnosis("effects", "", model=extended.model({}))


@pytest.mark.parametrize("blocks", [2, pytest.param(4, marks=pytest.mark.full)])
def test_a_law_that_is_there_predicts_blocks_that_were_left_out(blocks: int) -> None:
    """It leaves what the plant itself leaves; the robot file, its values refitted, leaves the law's torque as well."""
    told = Robot.load("one_axis")
    plant = told.with_effect("hidden", "friction.load_dependent", "axis_1", values=BY_LOAD)
    measured = long_motion(plant)
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    diagnosis = CrossValidation(blocks=blocks, skip_s=0.5).run(measured, told, context, explained(told))
    before, after = diagnosis.errors
    own = prescribe_record(plant, measured).run.lanes("motor_torque")
    left = (measured.run.lanes("motor_torque") - own)[0, round(0.5 / T) :]
    assert after.rms[0] < 1.05 * np.sqrt((left**2).mean())
    assert after.rms[0] < 0.5 * before.rms[0]
    assert after.low[0] < after.relative[0] < after.high[0] < before.low[0]


def test_several_experiments_are_refused() -> None:
    robot = Robot.load("one_axis")
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    with pytest.raises(DataRejected, match="2 experiments or periods; it cuts one long motion"):
        CrossValidation().run(long_motion(robot, 2), robot, context, explained(robot))


def test_the_stage_keeps_the_contract() -> None:
    record = long_motion(Robot.load("one_axis"))
    check_stage(
        CrossValidation,
        for_axes=(1,),
        artifacts=lambda robot: {
            Record: record.replace(axis_names=robot.axis_names),
            Diagnosis: explained(robot),
        },
        recovery=False,  # the record is of one robot, whatever is asked for
        blocks=2,
        passes=1,
    )
