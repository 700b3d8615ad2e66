"""The closed loop against MuJoCo in a loop of Python: same controller, friction and reference, another
engine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from oracles.drives import Ripple
from oracles.mujoco_robot import MujocoRobot
from oracles.pinocchio_robot import PinocchioRobot
from oracles.robots import changed, drawn_robot, with_exact_encoders, with_rigid_gears, with_ripple
from oracles.runs import Method, at_rest, measured_at_rest, run

from robid_core import Robot

FloatArray = npt.NDArray[np.float64]

N_SAMPLE = 400


def _six_axis(_: np.random.Generator) -> Robot:
    return with_exact_encoders(Robot.load("six_axis_true"))


ROBOTS: dict[str, Callable[[np.random.Generator], Robot]] = {
    "six_axis_true": _six_axis,
    "tree with sliding joints": lambda g: drawn_robot(
        g, 5, tree=True, prismatic=True, coupled=True, n_bearing=4
    ),
    "two rigid gears": lambda g: with_rigid_gears(drawn_robot(g, 4, n_bearing=2), "axis_2", "axis_4"),
}


def _reference(robot: Robot, generator: np.random.Generator) -> FloatArray:
    """Three sines a motor, up to 20 Hz, so that joints move by some hundredths of a radian."""
    t = robot.sample_time_s * np.arange(N_SAMPLE)
    frequency, phase = generator.uniform(1.0, 20.0, (3, 1)), generator.uniform(0, 6.28, (3, robot.n_axis))
    waves = np.sin(2 * np.pi * frequency[:, :, None] * t + phase[:, :, None])
    return np.asarray(robot.motor_angle(0.3 * waves.sum(axis=0).T))


class Case:
    """A robot with experiments: references (n_lane, n_sample, n_axis) and start angles (n_lane, n_axis)."""

    def __init__(self, name: str, n_lane: int) -> None:
        generator = np.random.default_rng(sum(map(ord, name)))
        self.robot = ROBOTS[name](generator)
        self.reference = np.array([_reference(self.robot, generator) for _ in range(n_lane)])
        self.angle = generator.uniform(-0.6, 0.6, (n_lane, self.robot.n_axis))
        self.rest = at_rest(self.robot, self.angle)

    def mujocos(self, n_step: int, ripple: Ripple | None = None) -> tuple[FloatArray, FloatArray]:
        """Measured position and torque of every lane from MuJoCo's Runge-Kutta, each as `reference`."""
        lanes = zip(self.rest.position, self.rest.holding_torque, self.reference, strict=True)
        twin = MujocoRobot(self.robot, ripple=ripple)
        runs = [twin.closed_loop(z, u, wanted, n_step) for z, u, wanted in lanes]
        return np.array([position for position, _ in runs]), np.array([torque for _, torque in runs])


def _swing(signal: FloatArray) -> FloatArray:
    return np.asarray(np.ptp(signal, axis=1))


@pytest.mark.parametrize("n_lane", [1, 5])  # the simulator runs one experiment alone, and many at once
@pytest.mark.parametrize("name", ROBOTS)
def test_the_same_formula_in_both_engines_gives_the_same_record(name: str, n_lane: int) -> None:
    case = Case(name, n_lane)
    theirs = case.mujocos(8)
    ours = run(case.robot, case.rest, case.reference, method="runge_kutta", n_step=8)
    # Rounding, 1e-16 of motor angles of 100 rad a step, through a stable loop; in torque times the speed gain
    # over the sample time.
    for mine, other in ((ours.position, theirs[0]), (ours.torque, theirs[1])):
        assert (abs(mine - other).max(axis=1) < 1e-10 * _swing(other)).all()
    assert _swing(case.robot.joint_angle(theirs[0])).max() > 0.02


@pytest.mark.parametrize("n_lane", [1, 5])
@pytest.mark.parametrize("name", ROBOTS)
def test_the_default_method_at_its_default_step_gives_the_record_of_the_fine_one(
    name: str, n_lane: int
) -> None:
    case = Case(name, n_lane)
    position, torque = case.mujocos(16)
    ours = case.robot.simulate(case.reference, case.angle)
    # (w h)^2 / 12 of the swings that the feedback feels: 8e-4 at 60 Hz
    assert (abs(ours.position - position).max(axis=1) < 1e-3 * _swing(position)).all()
    assert (abs(ours.torque - torque).max(axis=1) < 1e-2 * _swing(torque)).all()


@pytest.mark.parametrize("n_lane", [1, 5])
def test_ripple_of_torque_and_resolver_is_the_same_in_both_loops(n_lane: int) -> None:
    case = Case("six_axis_true", n_lane)
    limit = case.robot.drives.torque_limit
    ripple = Ripple(0.02 * limit, np.full(6, 12.0), np.full(6, 2e-4), np.full(6, 2.0))
    robot = with_ripple(case.robot, ripple)
    rest = measured_at_rest(robot, at_rest(robot, case.angle), ripple)
    position, torque = case.mujocos(16, ripple)
    # Runge-Kutta: the ripple's law gives its mean over the step, (order v h)^2 / 24 less, 2e-6 of it at 50 rad/s and
    # 1/32 ms. Midpoint: the ripple comes at 12 v = 1000 rad/s and more, where (w h)^2 / 12 is a hundredth of what
    # it moves, and it moves a motor by up to a third of its swing.
    methods: tuple[tuple[Method, int, float], ...] = (
        ("runge_kutta", 32, 1e-6),
        ("implicit_midpoint", 4, 5e-3),
    )
    for method, n_step, tolerance in methods:
        ours = run(robot, rest, case.reference, method=method, n_step=n_step)
        assert (abs(ours.position - position).max(axis=1) < tolerance * _swing(position)).all()
        assert (abs(ours.torque - torque).max(axis=1) < tolerance * _swing(torque)).all()
    without, _ = case.mujocos(16)
    assert (abs(without - position).max(axis=1) > 1e-2 * _swing(position)).any()  # or there was no ripple


def test_encoder_steps_and_torque_limits_are_the_same_in_both_loops() -> None:
    robot = changed(
        Robot.load("six_axis_true"),
        every_axis={"sensors": {"encoder_counts": 8192.0}, "torque_limit": 6.0},
    )
    generator = np.random.default_rng(7)
    reference = 2 * _reference(robot, generator)
    count = 2 * np.pi / 8192  # it starts on whole counts: what is measured before the start is a convention
    motor = np.rint(robot.motor_angle(generator.uniform(-0.3, 0.3, 6)) / count) * count
    rest = at_rest(robot, robot.joint_angle(motor))
    position, torque = MujocoRobot(robot).closed_loop(rest.position[0], rest.holding_torque[0], reference, 8)
    ours = run(robot, rest, reference[None], method="runge_kutta", n_step=8)
    # Equal counts: two true angles that differ by 1e-12 round alike unless one of 2400 lies within 1e-9
    # counts of a half.
    np.testing.assert_allclose(ours.position[0], position, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.torque[0], torque, rtol=0, atol=1e-9 * abs(torque).max())
    share = np.mean(abs(torque) >= 6.0, axis=0)
    np.testing.assert_allclose(ours.saturated[0], share, rtol=0, atol=1e-12)
    assert share.max() > 0.05


def test_the_record_over_pinocchio_in_python_is_the_same() -> None:
    case = Case("six_axis_true", 1)
    short = case.reference[:, :60]
    rest = case.rest.position[0], case.rest.holding_torque[0]
    position, torque = PinocchioRobot(case.robot).closed_loop(*rest, short[0], 4)
    ours = run(case.robot, case.rest, short, method="runge_kutta", n_step=4)
    np.testing.assert_allclose(ours.position[0], position, rtol=0, atol=1e-9 * np.ptp(position))
    np.testing.assert_allclose(ours.torque[0], torque, rtol=0, atol=1e-8 * np.ptp(torque))
