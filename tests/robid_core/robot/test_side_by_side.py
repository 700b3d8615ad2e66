"""Many robots under one motion at once: each comes out as it does alone, bit by bit, whatever runs beside it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import pytest

from robid_core import ConfigurationError, Robot
from robid_core.mechanics import MechanicalModel, MotorMotion, prescribe
from robid_core.robot.effects import force_terms
from robid_core.robot.side_by_side import prescribe_many

FloatArray = npt.NDArray[np.float64]


def motion_of(robot: Robot, n_exp: int, n_sample: int = 15) -> MotorMotion:
    """Return motors shaken from rest at poses drawn once."""
    generator = np.random.default_rng(4)
    n_axis, n_step = robot.n_axis, round(robot.sample_time_s / robot.step_s)
    motor = robot.motor_angle(generator.uniform(-0.5, 0.5, (n_exp, n_axis)))
    acceleration = 300 * generator.standard_normal((n_exp, n_sample * n_step, n_axis))
    return MotorMotion(motor, generator.standard_normal((n_exp, n_axis)), acceleration)


def assert_alone_and_together(
    robots: list[Robot], motion: MotorMotion, n_thread: int = 1
) -> list[FloatArray]:
    together = prescribe_many(robots, motion, keep_coordinates=True, n_thread=n_thread)
    for robot, run in zip(robots, together, strict=True):
        alone = robot.prescribe(motion, keep_coordinates=True)
        np.testing.assert_array_equal(run.torque, alone.torque)
        np.testing.assert_array_equal(run.position, alone.position)
        np.testing.assert_array_equal(run.coordinates, alone.coordinates)
        np.testing.assert_array_equal(run.state.position, alone.state.position)
        np.testing.assert_array_equal(run.state.law_state, alone.state.law_state)
    return [run.torque for run in together]


def changed(robot: Robot, factors: Mapping[str, float]) -> Robot:
    return robot.with_parameters({name: robot.parameter(name) * factor for name, factor in factors.items()})


@pytest.mark.parametrize("n_exp", [1, 3])
def test_every_number_of_springs_bodies_and_drives_may_differ(n_exp: int) -> None:
    six = Robot.load("six_axis")
    names = [
        name for name in six.layout if six.parameter_kind(name) in ("stiffness", "damping", "gear", "inertia")
    ]
    names += [name for name in six.layout if name.startswith("friction.axis_2") and six.parameter(name)]
    some = [name for name in names[::9] if six.parameter(name)]
    robots = [six, *(changed(six, {name: 1.01}) for name in some)]
    torques = assert_alone_and_together(robots, motion_of(six, n_exp), n_thread=2)
    assert len(some) >= 8
    for name, torque in zip(some, torques[1:], strict=True):
        assert (torque != torques[0]).any(), name


LAWS = {
    "bristle": ("friction.lugre", "axis_4", "motor", ("coulomb", "stiffness", "damping")),
    "grease": ("friction.stribeck", "axis_2", "motor", ("stribeck_speed", "breakaway")),
    "load": ("friction.load_dependent", "axis_3", "gear", ("load_coulomb",)),
    "hook": ("transmission.bouc_wen", "axis_6", "gear", ("sharpness", "torque")),
    "hard": ("transmission.stiffening", "axis_2", "gear", ("cubic",)),
    "play": ("transmission.backlash", "axis_5", "gear", ("gap",)),
}
"""State laws, laws under load, nonlinear springs: plugin, axis, side, parameters that differ."""


def nonlinear(six: Robot) -> Robot:
    for label, (use, axis, side, _) in LAWS.items():
        six = six.with_effect(label, use, axis, side)
    return six


def test_laws_with_parameters_of_their_own_in_each_lane() -> None:
    robot = nonlinear(Robot.load("six_axis"))
    names = [f"effect.{label}.{name}" for label, (*_, rows) in LAWS.items() for name in rows]
    robots = [robot, *(changed(robot, {name: 1.2}) for name in names)]
    torques = assert_alone_and_together(robots, motion_of(robot, 1))
    for name, torque in zip(names, torques[1:], strict=True):
        assert (torque != torques[0]).any(), name


def test_modes_of_flexible_links_and_rigid_gears_that_differ() -> None:
    flexible = Robot.load("six_axis_flex")
    names = [name for name in flexible.layout if name.startswith("modal_")][::12]
    assert_alone_and_together(
        [flexible, *(changed(flexible, {name: 1.1}) for name in names)], motion_of(flexible, 1)
    )
    six = Robot.load("six_axis").description
    axes = {
        n: a.model_copy(update={"gear": None}) if n in ("axis_1", "axis_5") else a
        for n, a in six.axes.items()
    }
    robots = []
    for share in (
        0.0,
        0.2,
        0.3,
    ):  # of the wrist's coupling; where it is 0, the gears of one robot have fewer entries
        gear = np.diag([1 / a.gear_ratio for a in six.axes.values()])
        gear[5, 4] = share * gear[4, 4]
        robots.append(
            Robot(six.model_copy(update={"axes": axes, "coupling": tuple(map(tuple, gear.tolist()))}))
        )
    robots = [robot.with_effect("load", *LAWS["load"][:3]) for robot in robots]
    assert_alone_and_together(robots, motion_of(robots[0], 1))


def test_a_run_goes_on_from_the_states_that_robots_ended_in() -> None:
    robot = nonlinear(Robot.load("six_axis"))
    robots = [changed(robot, {"effect.bristle.stiffness": factor}) for factor in (0.5, 1.0, 2.0)]
    motion = motion_of(robot, 2, 20)
    whole = prescribe_many(robots, motion)
    first = prescribe_many(robots, MotorMotion(motion.angle, motion.speed, motion.acceleration[:, :40]))
    moved = first[0].state
    rest = MotorMotion(moved.position[:, :6], moved.speed[:, :6], motion.acceleration[:, 40:])
    second = prescribe_many(robots, rest, [run.state for run in first])
    for run, end in zip(whole, second, strict=True):
        np.testing.assert_array_equal(end.torque, run.torque[:, 10:])


def test_robots_of_other_structure_run_beside_but_not_in_the_same_lanes() -> None:
    six = Robot.load("six_axis")
    robots = [
        six,
        six.with_effect("rub", "friction.viscous", "axis_2", "motor"),
        changed(six, {"mass.axis_4": 2.0}),
    ]
    motion = motion_of(six, 1)
    assert_alone_and_together(robots, motion)
    models = [
        MechanicalModel(robot.mechanism, *robot.spring_arrays(), force_terms(robot)) for robot in robots
    ]
    state = six.standing(six.joint_angle(motion.angle))
    with pytest.raises(ConfigurationError, match="differ in joints, gears or laws"):
        prescribe(models[:2], [state, state], motion)
    with pytest.raises(ConfigurationError, match="no robot"):
        prescribe([], [], motion)
    with pytest.raises(ConfigurationError, match="1 experiments and a state of 2"):
        prescribe(models[:1], [six.standing(np.zeros((2, 6)))], motion)
