"""What can be seen before a fit: against the inverse of the whole information, and where nothing can be seen."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import FreeParameters, NotIdentifiable, Robot
from robid_core.estimation.torque.periodic import periodic_motion_of
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.residual import PeriodicBlock, TorqueProblem
from robid_core.residual.linear_fit import best_start
from robid_core.residual.visibility import visibility

T, N = 1e-3, 1000
LINES = np.array([3, 11, 24, 37])
SPRING = "gear_stiffness.axis_1"


@pytest.fixture(scope="module")
def robot() -> Robot:
    """Return one axis without Coulomb friction, a cogging of no size at its motor."""
    bare = Robot.load("one_axis").with_parameters({"friction.axis_1.coulomb": 0.0})
    return bare.with_effect("cog", "drive.cogging", "axis_1", values={"amplitude": 0.0, "order": 6.0})


def problem_of(robot: Robot, plant: Robot, names: tuple[str, ...]) -> TorqueProblem:
    """Periods of a plant under four lines, without noise, as a problem of the robot."""
    time = T * np.arange(N)
    waves = [np.sin(2 * np.pi * line * time / (N * T) + line) for line in LINES]
    speed = np.tile(8.0 * np.sum(waves, axis=0), 6)[None, :, None]
    run = plant.simulate(speed, np.array([[0.4]]))
    rows = (1, 1, 1, 2, N, 1)
    motion = periodic_motion_of(
        run.position[:, -2 * N :].reshape(rows), run.torque[:, -2 * N :].reshape(rows), T, LINES, 60.0
    )
    laws = SpeedFunctions.of_widths((5.0,), 1)
    block = PeriodicBlock.of_record(robot, motion, laws)
    return TorqueProblem(FreeParameters.of_robot(robot, names), (block,), laws.names)


def test_shares_are_those_of_the_whole_inverse(robot: Robot) -> None:
    """Projecting the other unknowns out must not change what a parameter's variance is; a rank counts directions."""
    names = (SPRING, "gear_damping.axis_1", "mass.axis_1", "effect.cog.phase", "friction.axis_1.viscous")
    problem = problem_of(robot, robot, names)
    (block,), point = problem.blocks, np.zeros(problem.n_unknown)
    block.renew_signals(problem.free, np.zeros(5), np.zeros_like(block.motion.torque_spectrum), np.zeros(1))
    weights = problem.weightings(point, [block.weight(robot, np.zeros((3, 1)), 1e-3)])
    about = problem.linearise(point, weights)
    seen = visibility(problem, about)
    variance = np.diag(np.linalg.inv(about.whole))[:5]
    # Of what is seen a thousand times better than before, the smallest information is rounding of the largest.
    np.testing.assert_allclose(seen.share, np.sqrt(variance) / problem.prior[:5], rtol=1e-3, atol=1e-6)
    assert seen.share[3] == pytest.approx(1.0)  # of no size, a phase shows nothing
    assert seen.share[0] < 0.01
    assert seen.rank < 5
    assert f"{seen.rank} of 5 directions" in str(seen)
    with pytest.raises(
        NotIdentifiable, match=r"do not determine effect.cog.phase: fix .*fixed: \[effect.cog.phase\]"
    ) as refused:
        seen.check(np.ones(5, dtype=bool))
    assert refused.value.names == ("effect.cog.phase",)
    seen.check(np.arange(5) != 3)


def test_of_several_starts_the_best_is_taken(robot: Robot) -> None:
    """A plant whose spring is 18 times as stiff as told: from there alone the linear model ends elsewhere."""
    plant = robot.with_parameters({SPRING: 18 * robot.parameter(SPRING)})
    problem = problem_of(robot, plant, (SPRING, "gear_damping.axis_1", "friction.axis_1.viscous"))
    told: list[str] = []
    near = np.array([np.log(15.0), 0.0, 0.0])
    alone, _ = best_start(problem, (near,), 5, lambda done, of, what: told.append(what))
    both, agree = best_start(problem, (np.zeros(3), near), 5, lambda done, of, what: told.append(what))
    assert told == ["linear model", "linear model, start 1 of 2", "linear model, start 2 of 2"]
    assert agree == 1
    np.testing.assert_array_equal(both[0], alone[0])
    assert np.exp(both[0]) == pytest.approx(18, rel=0.05)
