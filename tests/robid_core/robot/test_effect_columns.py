"""Columns of effects are derivatives of what the simulator says: of prescribed motion, in time and in frequency."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot, RobotMotion, effect_columns, forces_along
from robid_core.estimation.torque.periodic import periodic_motion_of
from robid_core.estimation.torque.spectra import FINER
from robid_core.mechanics import MotorMotion, periodic_motion

STEP = 2.5e-4
ANGLE = np.array([[0.1, 0.5, 0.2, 0.1, 0.3, 0.1], [-0.6, 0.1, 0.4, -0.8, -0.4, 1.0]])
AT_MOTOR = [
    ("friction.stribeck", {"speed": 5.0}, {"coulomb", "breakaway", "viscous"}),
    ("friction.load_dependent", {"speed": 5.0}, {"coulomb", "load_coulomb", "load_excess", "viscous"}),
    ("friction.lugre", {}, set()),
    ("friction.asymmetric", {"speed": 5.0}, None),
]


def waves(n_sample: int, sample_time: float) -> np.ndarray:
    """Motor angles about the poses, a whole period, rad, (2, n_sample, 6)."""
    generator, time = np.random.default_rng(3), np.arange(n_sample) / n_sample
    angle = np.repeat(Robot.load("six_axis").motor_angle(ANGLE)[:, None], n_sample, axis=1)
    for line, speed in ((1, 8.0), (7, 6.0), (13, 4.0)):
        omega = 2 * np.pi * line / (n_sample * sample_time)
        angle += speed / omega * np.sin(2 * np.pi * line * time[:, None] + generator.uniform(0, 6, (2, 1, 6)))
    return angle


@pytest.fixture(scope="module")
def six() -> Robot:
    return Robot.load("six_axis")


@pytest.mark.parametrize(("use", "values", "linear"), AT_MOTOR)
def test_columns_at_a_motor_are_differences_of_prescribed_motions(
    six: Robot, use: str, values: dict[str, float], linear: set[str] | None
) -> None:
    robot = six.with_effect("rub", use, "axis_2", "motor", values)
    stepwise = Robot(robot.description.model_copy(update={"sample_time_s": STEP}))
    motion = periodic_motion(waves(500, 1e-3), 1e-3, STEP, 400.0)
    run = stepwise.prescribe(motion, keep_coordinates=True)
    assert run.coordinates is not None
    before, after = run.coordinates[:, :-1], run.coordinates[:, 1:]
    names = [name for name in robot.layout if name.startswith("effect.rub.")]
    middle = RobotMotion(0.5 * (before + after), (after - before) / STEP, STEP)
    columns = effect_columns(robot, names, middle)
    assert [column.name for column in columns] == names
    if linear is not None:
        assert {column.name.rpartition(".")[2] for column in columns if column.linear} == linear
    for column in columns:
        assert column.channel == "force"
        assert np.flatnonzero(column.direction).tolist() == [1]
        value = robot.parameter(column.name)
        step = 1e-3 * abs(value) or 1e-3
        ends = [
            stepwise.with_parameters({column.name: value + way * step}) for way in (-1, 1) if value or way > 0
        ]
        torques = [end.prescribe(motion).torque[:, :-1, 1] for end in ends]
        low = torques[0] if value else run.torque[:, :-1, 1]
        expected = (torques[-1] - low) / (step * len(ends))
        # The simulator extrapolates the midpoint at which it linearises: second order in its step.
        size = np.sqrt((expected**2).mean())
        assert np.sqrt(((column.values - expected) ** 2).mean()) < 0.02 * size + 1e-12, column.name


def test_in_frequency_a_column_is_that_of_a_held_torque(six: Robot) -> None:
    robot = six.with_effect("rub", "friction.stribeck", "axis_2", "motor", {"speed": 5.0})
    n_sample, angle = 1000, waves(1000, 1e-3)
    motion = _whole(periodic_motion(angle, 1e-3, robot.step_s, 250.0), 3)
    run = robot.prescribe(motion, keep_coordinates=True)
    assert run.coordinates is not None
    rows = (2, 1, 1, 1, n_sample, 6)
    recorded = periodic_motion_of(angle.reshape(rows), np.zeros(rows), 1e-3, np.array([1, 7, 13]), 100.0)
    fine = RobotMotion.periodic(run.coordinates[:, -n_sample:], 1e-3, FINER)
    names = ["effect.rub.coulomb", "effect.rub.stribeck_speed"]
    for column in effect_columns(robot, names, fine):
        torque = column.values[..., None] * column.direction[:6]
        ours = recorded.held_spectrum(torque[:, None])[:, 0, :, 1]
        step = 1e-3 * robot.parameter(column.name)
        ends = [
            robot.with_parameters({column.name: robot.parameter(column.name) + way * step}) for way in (-1, 1)
        ]
        low, high = (
            end.prescribe(_whole(periodic_motion(angle, 1e-3, robot.step_s, 250.0), 3)).torque[
                :, -n_sample:, 1
            ]
            for end in ends
        )
        theirs = np.fft.rfft((high - low) / (2 * step), axis=1)[:, : ours.shape[1]] / n_sample
        theirs = theirs / recorded.mean_share(recorded.omega, robot.step_s).real
        assert np.sqrt((abs(ours - theirs) ** 2).sum() / (abs(theirs) ** 2).sum()) < 5e-3, column.name


def _whole(motion: MotorMotion, periods: int) -> MotorMotion:
    return MotorMotion(motion.angle, motion.speed, np.tile(motion.acceleration, (1, periods, 1)))


def test_an_effect_of_several_laws_has_a_column_for_each(six: Robot) -> None:
    robot = six.with_effect("wave", "transmission.kinematic_error", "axis_2", values={"amplitude": 1e-4})
    motion = RobotMotion.periodic(_moving(robot), 1e-3, 4)
    gear, motor = effect_columns(robot, ["effect.wave.amplitude"], motion)
    np.testing.assert_array_equal(gear.direction, robot.mechanism.spring_directions[1])
    assert np.flatnonzero(motor.direction).tolist() == [1]
    for column, law in zip((gear, motor), forces_along(robot, motion).of("wave"), strict=True):
        assert abs(law.run.force).max() > 0
        np.testing.assert_allclose(column.values * 1e-4, law.run.force, rtol=1e-6, atol=1e-9)


def _still(robot: Robot) -> np.ndarray:
    rest = robot.equilibrium(ANGLE).position
    return np.repeat(rest[:, None], 40, axis=1)


def test_columns_of_signals_are_per_unit_of_what_the_law_changes(six: Robot) -> None:
    robot = six.with_effect("cog", "drive.cogging", "axis_3", values={"amplitude": 0.3, "order": 6.0})
    robot = robot.with_effect("resolver", "sensing.resolver_ripple", "axis_1", values={"order": 2.0})
    robot = robot.with_effect("lag", "drive.current_loop", "axis_2")
    motion = RobotMotion.periodic(_moving(robot), 1e-3, 4)
    torque = np.random.default_rng(0).standard_normal((2, 160, 6))
    asked = RobotMotion(motion.position, motion.speed, motion.step, motion.settle, torque)
    names = ["effect.cog.amplitude", "effect.cog.phase", "effect.resolver.amplitude"]
    size, phase, angle = effect_columns(robot, names, asked)
    turn = 6 * motion.position[..., 2]
    # A step of 0.25 ms at up to 8 rad/s: its mean is (0.5 * 6 * 2e-3)^2 / 6 = 6e-6 off the middle.
    np.testing.assert_allclose(size.values, np.sin(turn), atol=1e-12)
    np.testing.assert_allclose(phase.values, 0.3 * np.cos(turn), atol=1e-5)
    assert (size.channel, phase.channel, angle.channel) == ("torque", "torque", "position")
    assert (size.linear, phase.linear, angle.linear) == (True, False, True)
    np.testing.assert_array_equal(angle.direction, np.eye(len(angle.direction))[0])
    with pytest.raises(ConfigurationError, match="give the motion the torque of the motors"):
        effect_columns(robot, names[:1], motion)
    coarse = RobotMotion(motion.position, motion.speed, 1e-3, motion.settle, torque)
    with pytest.raises(ConfigurationError, match=r"cog.phase' is of a law that runs every 0.00025 s"):
        effect_columns(robot, names[1:2], coarse)


def _moving(robot: Robot) -> np.ndarray:
    coordinates = _still(robot)
    coordinates[..., :6] += np.sin(2 * np.pi * np.arange(40) / 40)[:, None] * 0.05
    return coordinates


@pytest.mark.parametrize(
    "name", ["gear_stiffness.axis_1", "effect.tool.mass", "effect.rub.nothing", "effect.no.coulomb"]
)
def test_what_is_no_parameter_of_a_law_has_no_column(six: Robot, name: str) -> None:
    robot = six.with_effect("tool", "load.payload", "axis_6").with_effect(
        "rub", "friction.stribeck", "axis_2"
    )
    with pytest.raises(ConfigurationError, match=f"'{name}' is no parameter of a law"):
        effect_columns(robot, [name], RobotMotion.periodic(_still(robot), 1e-3, 1))


def test_a_law_that_runs_once_a_sample_is_asked_at_the_samples(six: Robot) -> None:
    robot = six.with_effect("late", "sensing.delay", "axis_1")
    with pytest.raises(ConfigurationError, match="give the motion there"):
        effect_columns(robot, ["effect.late.delay"], RobotMotion.periodic(_moving(robot), 1e-3, 4))
    motion = RobotMotion.periodic(_moving(robot), 1e-3, 1)
    (late,) = effect_columns(robot, ["effect.late.delay"], motion)
    # What is measured is late: its derivative for the delay is minus the speed, some time ago.
    omega, time = 2 * np.pi / 0.04, 1e-3 * np.arange(40)
    expected = -0.05 * omega * np.cos(omega * (time - robot.parameter("effect.late.delay")))
    np.testing.assert_allclose(
        late.values, np.tile(expected, (2, 1)), rtol=0, atol=0.02 * abs(expected).max()
    )
