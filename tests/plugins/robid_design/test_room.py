"""Room about a robot: distances of lines against a search, the floor, links that would meet, either backend."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from scipy.optimize import minimize

from robid_core import ConfigurationError, Context, Robot
from robid_core.stage import map_in_process
from robid_design.candidates import RandomCandidates
from robid_design.room import Room, distance_of_lines, link_ends, link_points


def context(seed: int = 0) -> Context:
    log = logging.getLogger("test.room")
    return Context(np.random.default_rng(seed), map_in_process, lambda done, total, note="": None, log)


def searched(points: np.ndarray) -> float:
    """Distance of lines 0-1 and 2-3 by a bounded minimisation from four starts: convex in the two shares."""

    def square(share: np.ndarray) -> float:
        one, other = (points[k] + s * (points[k + 1] - points[k]) for k, s in ((0, share[0]), (2, share[1])))
        return float(((one - other) ** 2).sum())

    starts = ([0.2, 0.2], [0.2, 0.8], [0.8, 0.2], [0.8, 0.8])
    return min(minimize(square, start, bounds=[(0, 1)] * 2, tol=1e-15).fun for start in starts) ** 0.5


def test_distances_of_lines_are_those_of_a_search() -> None:
    """Crossing, beside one another, parallel, and without length; a search ends within 1e-6 of what is smooth."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(40, 4, 3))
    points[10:15, 3] = points[10:15, 2] + (points[10:15, 1] - points[10:15, 0])  # parallel
    points[15:20, 1] = points[15:20, 0]
    points[20:25, 3] = points[20:25, 2]
    points[25:28, 1], points[25:28, 3] = points[25:28, 0], points[25:28, 2]
    found = distance_of_lines(points, (0, 1), (2, 3))
    np.testing.assert_allclose(found, [searched(p) for p in points], atol=1e-6)


def test_links_lead_from_the_base_to_the_end() -> None:
    robot = Robot.load("six_axis")
    assert link_ends(robot) == [(k, k + 1) for k in range(7)]
    joint = np.random.default_rng(2).uniform(-1, 1, (3, 12))
    points = link_points(robot, joint)
    lengths = [np.linalg.norm(points[:, b] - points[:, a], axis=1) for a, b in link_ends(robot)]
    for length in lengths:  # rigid links: alike in all poses
        np.testing.assert_allclose(length, length[0], atol=1e-12)
    tool = link_points(robot, joint, (0.0, 0.0, 0.5))
    np.testing.assert_allclose(np.linalg.norm(tool[:, -1] - tool[:, -2], axis=1), 0.5, atol=1e-12)


def test_candidates_stay_above_the_floor() -> None:
    robot = Robot.load("six_axis")
    radius, tool = 0.05, (0.0, 0.0, 0.2)
    free = RandomCandidates(count=60, gravity_share=1.0).run(robot, context()).angle
    room = {"floor_m": 0.1, "link_radius_m": radius, "tool_m": tool}
    kept = RandomCandidates(count=60, gravity_share=1.0, room=room).run(robot, context()).angle
    lowest = []
    for angle in (free, kept):
        points = link_points(robot, robot.equilibrium(angle).joint, tool)
        lowest.append(points[:, 2:, 2].min(axis=1) - radius)
    assert (lowest[0] < 0.1).any(), "without a floor some reach below it"
    assert (lowest[1] >= 0.1).all()


def test_configurations_below_the_base_are_said_where_no_floor_is_stated(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Those whose lowest joint or end is below it, by their numbers; nothing where a floor is stated."""
    robot = Robot.load("six_axis")
    free = RandomCandidates(count=200).run(robot, context(3))
    points = link_points(robot, robot.equilibrium(free.angle).joint)
    height = points[:, 2:, 2].min(axis=1)  # the base and the first axis, which stands on it, do not move
    low = np.flatnonzero(height < 0)
    assert (
        f"configurations {', '.join(str(k + 1) for k in low[:6])} and {len(low) - 6} more of 200"
        in caplog.text
    )
    assert f"reach {-height.min():.2g} m below the plane of the base" in caplog.text
    caplog.clear()
    RandomCandidates(count=200, room=Room(floor_m=-1.0)).run(robot, context(3))
    assert not caplog.text


def test_links_that_fold_onto_one_another_are_refused() -> None:
    """The upper arm folded onto the forearm, axis 3 turned by nearly half a turn; stretched out it is clear."""
    robot = Robot.load("six_axis")
    joint = np.zeros((60, 12))
    joint[:, robot.mechanism.arm[2]] = np.linspace(-np.pi, np.pi, 60)
    kept = Room(link_radius_m=0.06).is_kept(robot, joint)
    points = link_points(robot, joint)
    nearest = np.min(
        [
            distance_of_lines(points, one, other)
            for k, one in enumerate(link_ends(robot))
            for other in link_ends(robot)[k + 2 :]
            if distance_of_lines(link_points(robot, np.zeros((1, 12))), one, other)[0] > 0.12
        ],
        axis=0,
    )
    assert kept.any()
    assert not kept.all()
    assert (kept == (nearest > 0.12)).all()
    assert Room().is_kept(robot, joint).all()


def test_a_floor_that_nothing_clears_is_told() -> None:
    with pytest.raises(ConfigurationError, match="or ask for less room"):
        RandomCandidates(count=3, room={"floor_m": 50.0}).run(Robot.load("six_axis"), context())


def test_poses_of_either_backend_leave_the_same_candidates() -> None:
    pytest.importorskip("torch")
    pytest.importorskip("pytorch_kinematics")
    kernel, batched = (Robot.load("six_axis", dynamics=name) for name in ("kernel", "torch"))
    joint = np.random.default_rng(4).uniform(-2, 2, (50, 12))
    np.testing.assert_allclose(link_points(batched, joint), link_points(kernel, joint), rtol=0, atol=1e-12)
    stage = RandomCandidates(count=30, room={"floor_m": 0.1, "link_radius_m": 0.05})
    np.testing.assert_array_equal(*(stage.run(robot, context()).angle for robot in (kernel, batched)))
