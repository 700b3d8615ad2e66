"""Constants of a record as parameters of the robots under which its variants were measured."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from robid_core import Channel, ConfigurationError, Context, DataRejected, DenseRun, FloatArray, Record, Robot
from robid_core.residual import variant_robots
from robid_core.residual.measured import parts_by_variant
from robid_core.stage import map_in_process
from robid_fit.rigid import RigidBodyFit
from robid_fit.torque_residual import TorqueResidualFit

MASSES = (0.5, 4.0)
N_SAMPLE, LINES = 2000, np.arange(8, 120, 4)
CONSTANTS = {"payload_kg": "effect.load.mass"}


@pytest.fixture(scope="module")
def robot() -> Robot:
    bare = Robot.load("one_axis")
    body = next(iter(bare.chain.names))
    return bare.with_effect("load", "load.payload", on=body, values={"mass": 1.0, "x": 0.3})


@pytest.fixture(scope="module")
def measured(robot: Robot) -> Record:
    """Two poses, one with each payload; the spring is a fifth stiffer than told. Two periods behind one."""
    (spring,) = robot.stiffness_names
    plant = robot.with_parameters({spring: 1.2 * robot.parameter(spring)})
    time = robot.sample_time_s * np.arange(3 * N_SAMPLE)
    period_s = robot.sample_time_s * N_SAMPLE
    draw = np.random.default_rng(1)
    position, torque = [], []
    for angle, mass in zip((0.3, -0.7), MASSES, strict=True):
        phase = draw.uniform(0, 2 * np.pi, (2, len(LINES), 1))
        waves = np.cos(2 * np.pi * LINES[:, None] * time / period_s + phase).sum(axis=1)
        reference = 4 * waves / waves.std() + 10 * np.sin(2 * np.pi * time / period_s)
        under = plant.with_parameters({"effect.load.mass": mass})
        done = under.simulate(reference[..., None], np.array([[angle]] * 2), seed=2)
        position.append(done.position[:, N_SAMPLE:].reshape(2, 2, N_SAMPLE, 1))
        torque.append(done.torque[:, N_SAMPLE:].reshape(2, 2, N_SAMPLE, 1))
    stacked = {"motor_position": ("rad", position), "motor_torque": ("N m", torque)}
    channels = {
        name: Channel("motor", unit, np.stack(parts)[:, None]) for name, (unit, parts) in stacked.items()
    }
    run = DenseRun(
        robot.sample_time_s,
        channels,
        time[:N_SAMPLE],
        np.ones((2, 1, 2, 2, N_SAMPLE), dtype=bool),
        constant_names=("payload_kg",),
        constants=np.broadcast_to(np.array(MASSES)[:, None, None, None], (2, 1, 2, 1)).copy(),
    )
    angle = robot.joint_angle(channels["motor_position"].values.mean(axis=(1, 2, 3, 4)))
    return Record(
        robot.axis_names, "", "zero_order_hold", (run,), angle, line=LINES, variants=("light", "heavy")
    )


def test_each_variant_has_the_constant_of_its_experiments(robot: Robot, measured: Record) -> None:
    nominal, others = variant_robots((measured,), robot, {}, CONSTANTS)
    assert nominal.parameter("effect.load.mass") == MASSES[0]
    assert list(others) == ["heavy"]
    assert others["heavy"].parameter("effect.load.mass") == MASSES[1]
    assert robot.parameter("effect.load.mass") == 1.0


def test_a_fit_of_two_payloads_that_a_table_tells_finds_the_spring(robot: Robot, measured: Record) -> None:
    """Without the constants the load is told wrong in both poses, and the misfit says so."""
    (spring,) = robot.stiffness_names
    context = Context(
        np.random.default_rng(0), map_in_process, lambda *_, **__: None, logging.getLogger("test")
    )
    fit = TorqueResidualFit(free=(spring, "friction.*.viscous"), constants=CONSTANTS).run(
        (measured,), robot, context
    )
    assert fit.parameters.value(spring) == pytest.approx(1.2 * robot.parameter(spring), rel=2e-3)
    untold = measured.replace(variants=())
    wrong = TorqueResidualFit(free=(spring, "friction.*.viscous")).run((untold,), robot, context)
    assert wrong.misfit > 5 * fit.misfit


def of_value(record: Record, values: FloatArray) -> Record:
    return record.replace(runs=(record.run.replace(constants=values),))


def test_constants_that_tell_no_robot_are_refused(robot: Robot, measured: Record) -> None:
    assert measured.run.constants is not None
    untold = measured.replace(variants=())
    with pytest.raises(
        DataRejected, match="payload_kg is 0.5 to 4 in the record; give experiments of another value"
    ):
        variant_robots((untold,), robot, {}, CONSTANTS)
    with pytest.raises(DataRejected, match="payload_kg is not known in all experiments of variant light"):
        variant_robots((of_value(measured, measured.run.constants * np.nan),), robot, {}, CONSTANTS)
    with pytest.raises(DataRejected, match="no constant voltage; it has payload_kg"):
        variant_robots((measured,), robot, {}, {"voltage": "effect.load.mass"})
    with pytest.raises(ConfigurationError, match="effect.tool.mass"):
        variant_robots((measured,), robot, {}, {"payload_kg": "effect.tool.mass"})


def test_a_rigid_fit_refuses_records_of_several_variants_and_says_what_fits_them(
    measured: Record, robot: Robot
) -> None:
    """Each record has one variant, which a run does not refuse; together they are two robots."""
    light, heavy = (part for _, part in parts_by_variant(measured))
    with pytest.raises(
        DataRejected, match=r"several variants \(light, heavy\).*fit.torque_residual fits them together"
    ):
        RigidBodyFit().run((light, heavy), robot)
