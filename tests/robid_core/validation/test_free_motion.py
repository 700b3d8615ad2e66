"""Half a second of free motion against MuJoCo and scipy, and the order at which both methods converge."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from oracles.mujoco_robot import MujocoRobot
from oracles.pinocchio_robot import PinocchioRobot
from oracles.robots import changed, drawn_robot, with_rigid_gears, without_feedback
from oracles.runs import Method, at_rest, free_motion
from scipy.integrate import solve_ivp

from robid_core import Robot
from robid_core.mechanics.reference import acceleration_by_solving

FloatArray = npt.NDArray[np.float64]

N_SAMPLE = 500
ORDERS: dict[Method, int] = {"implicit_midpoint": 2, "runge_kutta": 4}
ROBOTS: dict[str, Callable[[np.random.Generator], Robot]] = {
    "six axes": lambda _: changed(
        Robot.load("six_axis_true"), every_axis={"friction": {"coulomb": 0.3, "viscous": 2e-3, "speed": 20.0}}
    ),
    "tree with sliding joints": lambda g: drawn_robot(
        g, 5, tree=True, prismatic=True, coupled=True, n_bearing=4
    ),
    "two rigid gears": lambda g: with_rigid_gears(drawn_robot(g, 4, n_bearing=2), "axis_2", "axis_4"),
}


class Fall:
    """A robot let go at rest: its springs bent by gravity, its motors' torque against what held it."""

    def __init__(self, robot: Robot, generator: np.random.Generator) -> None:
        self.robot = without_feedback(robot)
        rest = at_rest(self.robot, generator.uniform(-0.6, 0.6, robot.n_axis))
        self.start = (rest.position[0], np.zeros(rest.position.shape[1]), -rest.holding_torque[0])

    def ours(self, method: Method, n_step: int) -> FloatArray:
        """Coordinates at every sample, (n_sample, n_coordinate)."""
        # the first step extrapolates with the acceleration of the start, which rest does not have
        first = MujocoRobot(self.robot).acceleration(*self.start)
        return free_motion(self.robot, *self.start, N_SAMPLE, first, method, n_step)[0]

    def mujocos(self, n_step: int) -> FloatArray:
        """The same from MuJoCo's Runge-Kutta."""
        return MujocoRobot(self.robot).free_motion(*self.start, N_SAMPLE, n_step)[0]

    def error(self, motion: FloatArray, truth: FloatArray) -> FloatArray:
        """Largest deviation of each coordinate relative to how far it moved."""
        travel = abs(truth - self.start[0]).max(axis=0)
        return np.asarray(abs(motion - truth).max(axis=0) / travel)


@pytest.fixture(scope="module", params=ROBOTS)
def fall(request: pytest.FixtureRequest) -> Fall:
    generator = np.random.default_rng(sum(map(ord, request.param)))
    return Fall(ROBOTS[request.param](generator), generator)


def test_two_programs_with_the_same_formula_take_the_same_steps(fall: Fall) -> None:
    # Runge-Kutta of order four at the same step is the same sum in both: what differs is rounding, 1e-16 a
    # step on motor angles of 100 rad, carried over 4000 steps of a motion that swings and does not diverge,
    # relative to travels of 1e-4 rad.
    theirs = fall.mujocos(8)
    assert (fall.error(fall.ours("runge_kutta", 8), theirs) < 1e-9).all()
    joints = fall.robot.mechanism.constraint_map
    travel = abs((theirs - fall.start[0]) @ joints.T).max(axis=0)
    assert travel.max() > 0.2  # a fall, not a tremble: velocity terms and the change of M count


def test_both_methods_have_their_order_and_the_limit_that_mujoco_has(fall: Fall) -> None:
    truth = fall.mujocos(64)
    midpoint = [fall.error(fall.ours("implicit_midpoint", n), truth).max() for n in (4, 8, 16)]
    runge_kutta = [fall.error(fall.ours("runge_kutta", n), truth).max() for n in (4, 8, 16)]
    # Every halving divides the error by 4 and by 16; the next order of the remainder is below a fifth of that
    # at these steps (w h below 0.25 for the fastest modes).
    for errors, order in ((midpoint, 2), (runge_kutta, 4)):
        measured = np.log2(np.array(errors[:-1]) / errors[1:])
        assert (abs(measured - order) < 0.25).all(), (order, errors)
    # (w t) (w h)^2 / 12 of a swing of w = 60 rad/s that lasts through the fall: 1e-3 at the default step, w =
    # 200 three times it
    assert midpoint[0] < 5e-3
    assert runge_kutta[1] < 1e-6


def test_the_fall_of_six_axes_is_that_of_scipy_over_pinocchio() -> None:
    fall = Fall(Robot.load("six_axis_true"), np.random.default_rng(1))
    oracle = PinocchioRobot(fall.robot)
    # The sample k of a motion is the state after k sample times.
    exact, _ = oracle.motion(*fall.start, (N_SAMPLE - 1) * fall.robot.sample_time_s)
    travel = abs(exact - fall.start[0]).max()
    tolerance: dict[Method, float] = {"implicit_midpoint": 2e-4, "runge_kutta": 1e-7}
    for method, limit in tolerance.items():
        end = fall.ours(method, 16)[-1]
        assert abs(end - exact).max() < limit * travel


def test_both_methods_converge_to_scipy_over_the_written_out_model() -> None:
    # A robot small enough for the slow twin: dense Jacobians in numpy, about a millisecond an evaluation.
    generator = np.random.default_rng(2)
    robot = without_feedback(drawn_robot(generator, 2, n_bearing=1))
    robot = changed(robot, every_axis={"friction": {"coulomb": 0.2, "viscous": 2e-3, "speed": 10.0}})
    rest, d = at_rest(robot, [[0.3, -0.8]]), robot.drives
    law = (d.coulomb, d.viscous, d.friction_speed, d.friction_offset)
    z, n, duration = rest.position[0], rest.position.shape[1], 50
    torque = rest.holding_torque[0] + [0.5, -0.8]

    def slope(_: float, x: FloatArray) -> FloatArray:
        change = acceleration_by_solving(robot.mechanism, *robot.spring_arrays(), law, x[:n], x[n:], torque)
        return np.concatenate((x[n:], change))

    x0 = np.concatenate((z, np.zeros(n)))
    exact = solve_ivp(slope, (0, duration * 1e-3), x0, method="DOP853", rtol=1e-9, atol=1e-12).y[:, -1]
    for method, order in ORDERS.items():
        errors = []
        for n_step in (2, 4, 8):
            _, end = free_motion(
                robot,
                z,
                np.zeros(n),
                torque,
                duration,
                slope(0.0, x0)[n:],
                method,
                n_step,
            )
            errors.append(abs(end.ravel() - exact)[:n].max())
        measured = np.log2(np.array(errors[:-1]) / errors[1:])
        assert (abs(measured - order) < 0.25).all(), (method, errors)
        assert errors[-1] < 1e-3 * abs(exact[:n] - z).max()
