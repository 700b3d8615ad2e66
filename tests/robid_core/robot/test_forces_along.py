"""Laws along a motion against the simulator that ran them: prescribed motion and closed loops are the oracle."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import ConfigurationError, ForcesAlong, Robot, RobotMotion, forces_along
from robid_core.mechanics import MotorMotion

STEP = 2.5e-4
ANGLE = np.array(
    [[0.1, 0.5, 0.2, 0.1, 0.3, 0.1], [-0.6, 0.1, 0.4, -0.8, -0.4, 1.0], [0.9, -0.3, 0.0, 0.5, 0.9, 0.2]]
)


@pytest.fixture(scope="module")
def six() -> Robot:
    """Sampled in the steps of the integration, so that every step can be seen."""
    robot = Robot.load("six_axis")
    return Robot(robot.description.model_copy(update={"sample_time_s": STEP}))


def along(robot: Robot, coordinates: np.ndarray, torque: np.ndarray | None = None) -> ForcesAlong:
    """The laws along the steps between simulated coordinates (n_lane, n_step + 1, n_coordinate)."""
    before, after = coordinates[:, :-1], coordinates[:, 1:]
    motion = RobotMotion(0.5 * (before + after), (after - before) / STEP, STEP, torque=torque)
    return forces_along(robot, motion)


def waves(n_lane: int, n_sample: int) -> np.ndarray:
    generator, time = np.random.default_rng(2), STEP * np.arange(n_sample)
    phase = generator.uniform(0, 2 * np.pi, (n_lane, 1, 6))
    window = np.sin(np.pi * np.arange(n_sample) / n_sample)[:, None] ** 2
    return 12.0 * window * np.sin(2 * np.pi * 12 * time[:, None] + phase)


def moved(robot: Robot, n_sample: int = 600) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates, torques and state of the laws of a closed loop."""
    run = robot.simulate(waves(3, n_sample), ANGLE, keep_coordinates=True)
    assert run.coordinates is not None
    coordinates = np.concatenate((run.coordinates, run.state.position[:, None]), axis=1)
    return coordinates, run.torque, run.state.law_state


BRISTLES = {
    "at_motor": ("friction.lugre", "axis_4", "motor"),
    "at_arm": ("friction.dahl", "axis_2", "arm"),
    "in_gear": ("transmission.bouc_wen", "axis_3", "gear"),
    "in_bearing": ("transmission.maxwell_slip", "axis_1_y", "bearing"),
}


def test_states_of_laws_are_those_that_the_simulator_ended_in(six: Robot) -> None:
    robot = six
    for label, (use, on, side) in BRISTLES.items():
        robot = robot.with_effect(label, use, on, side)
    coordinates, _, state = moved(robot)
    found = along(robot, coordinates)
    ours = np.concatenate([force.run.state for force in found.forces], axis=1)
    assert ours.shape == state.shape
    assert (abs(state) > 0).all(axis=0).sum() >= 4
    # The same steps of the same law; coordinates of 70 rad are rounded to 1e-14, over a step 6e-11 rad/s.
    np.testing.assert_allclose(ours, state, rtol=1e-7, atol=1e-9 * abs(state).max())


@pytest.mark.parametrize(
    ("use", "values"),
    [
        ("friction.stribeck", {"speed": 5.0}),
        ("friction.lugre", {}),
        ("friction.load_dependent", {"load_coulomb": 0.2, "speed": 5.0}),
        ("friction.elasto_plastic", {}),
        ("friction.viscous", {}),
    ],
)
def test_a_law_at_a_motor_takes_the_torque_that_prescribed_motion_takes_more(
    six: Robot, use: str, values: dict[str, float]
) -> None:
    robot = six.with_effect("rub", use, "axis_2", "motor", values)
    generator, time = np.random.default_rng(1), STEP * np.arange(800)
    phase = generator.uniform(0, 2 * np.pi, (3, 1, 6))
    acceleration = 600 * np.cos(2 * np.pi * 10 * time[:, None] + phase)
    motion = MotorMotion(six.motor_angle(ANGLE), np.zeros((3, 6)), acceleration)
    with_law, without = robot.prescribe(motion), six.prescribe(motion, keep_coordinates=True)
    assert without.coordinates is not None
    more = (with_law.torque - without.torque)[:, :-1]
    assert not more[..., [0, 2, 3, 4, 5]].any()
    (rub,) = along(robot, without.coordinates).of("rub")
    # The simulator linearises a law about a midpoint that is extrapolated from the step before: what it is off by is
    # of second order in the step, and shows where friction turns.
    error = np.sqrt(((rub.run.force - more[..., 1]) ** 2).mean() / (more[..., 1] ** 2).mean())
    assert error < 2e-3
    np.testing.assert_allclose(rub.run.force, more[..., 1], rtol=0, atol=0.03 * abs(more[..., 1]).max())


def test_the_load_is_what_gears_pass(six: Robot) -> None:
    robot = six.with_effect("hard", "transmission.stiffening", "axis_2", values={"cubic": 2e10})
    robot = robot.with_effect("hook", "transmission.bouc_wen", "axis_3")
    robot = robot.with_effect("seal", "friction.load_dependent", "axis_2", "motor")
    coordinates, torque, _ = moved(robot)
    found = along(robot, coordinates)
    # What the motor's torque leaves after rotor and friction goes through the gear.
    position = coordinates[..., :6]
    acceleration = np.diff(position, n=2, axis=1) / STEP**2
    taken = np.zeros_like(torque)
    for force in found.forces:
        if not force.term.direction[6:].any():
            taken += force.run.force[..., None] * force.term.direction[:6]
    d = robot.drives
    # A second difference is the mean acceleration of two steps.
    acting, load = (0.5 * (x[:, 1:] + x[:, :-1]) for x in (torque - taken, found.load))
    passed = (acting - d.rotor_inertia * acceleration) @ np.linalg.inv(d.gear)
    error = np.sqrt(((load - passed) ** 2).mean(axis=(0, 1)) / load.var(axis=(0, 1)))
    assert (error < 5e-3).all()
    (seal,) = found.of("seal")
    np.testing.assert_array_equal(seal.load, found.load @ d.gear[:, 1])


def test_laws_that_are_asked_for_see_the_load_that_all_give(six: Robot) -> None:
    robot = six.with_effect("hard", "transmission.stiffening", "axis_2").with_effect(
        "oil", "friction.viscous", "axis_1"
    )
    robot = robot.with_effect("seal", "friction.load_dependent", "axis_2", "motor")
    coordinates, _, _ = moved(robot, 100)
    before, after = coordinates[:, :-1], coordinates[:, 1:]
    motion = RobotMotion(0.5 * (before + after), (after - before) / STEP, STEP)
    every, asked = forces_along(robot, motion), forces_along(robot, motion, ["seal"])
    assert [force.term.label for force in asked.forces] == ["hard", "seal"]
    np.testing.assert_array_equal(asked.load, every.load)
    np.testing.assert_array_equal(asked.of("seal")[0].run.force, every.of("seal")[0].run.force)


def test_a_rigid_gear_needs_the_torque_of_its_motor(six: Robot) -> None:
    axes = {
        n: a.model_copy(update={"gear": None}) if n == "axis_2" else a
        for n, a in six.description.axes.items()
    }
    robot = Robot(six.description.model_copy(update={"axes": axes}))
    coordinates, torque, _ = moved(robot, 200)
    assert np.isnan(along(robot, coordinates).load[..., 1]).all()
    rubbing = robot.with_effect("seal", "friction.load_dependent", "axis_2")
    with pytest.raises(
        ConfigurationError, match="'seal' asks for the load of a rigid gear.*torque of the motors"
    ):
        along(rubbing, coordinates)
    d = robot.drives
    found = along(rubbing, coordinates, torque)
    (seal,) = found.of("seal")
    acceleration = np.gradient(np.diff(coordinates[..., 1], axis=1) / STEP, STEP, axis=1)
    # What brakes the motor before the gear, the seal itself among it, is not passed.
    braking = sum(force.run.force for force in found.forces if force.term.direction[1] == 1.0)
    passed = torque[..., 1] - d.rotor_inertia[1] * acceleration - braking
    np.testing.assert_allclose(seal.load, passed, rtol=1e-9, atol=1e-9 * np.abs(passed).max())
