"""excitation.constant_velocity: one axis after another at constant speeds, within travel and torque."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from robid_core import Configurations, Context, Excitation, MotionRefused, Robot
from robid_core.estimation.excitation.velocity_sweep import plateaus
from robid_core.residual import rigid_drives
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_core.testing.robots import example_robot
from robid_excitation.constant_velocity import ConstantVelocity, motor_room
from robid_excitation.rigid import motion_limits

SETTINGS: dict[str, Any] = {"steps": 4, "plateau_s": 0.3, "longest_s": 1.0, "highest_share": 0.2}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return example_robot(2)


@pytest.fixture(scope="module")
def standing(robot: Robot) -> Configurations:
    return Configurations(robot.axis_names, np.array([[0.4, -0.9], [-0.3, 0.5]]))


@pytest.fixture(scope="module")
def excitation(robot: Robot, standing: Configurations) -> Excitation:
    return ConstantVelocity(**SETTINGS).run(standing, robot, context())


def context() -> Context:
    log = logging.getLogger("test.sweep")
    return Context(np.random.default_rng(1), map_in_process, lambda done, total, note="": None, log)


def test_each_experiment_moves_its_own_axis_and_no_other(excitation: Excitation) -> None:
    assert excitation.reference.shape[:3] == (2, 1, 2)
    moved = np.abs(excitation.reference).max(axis=(0, 1, 3))
    assert (moved[~np.eye(2, dtype=bool)] == 0).all()
    assert (moved[np.eye(2, dtype=bool)] > 50).all()
    assert len(excitation.line) == 0
    assert np.abs(excitation.reference.mean(axis=3)).max() < 1e-12
    assert (excitation.reference[:, :, :, [0, -1]] == 0).all()


def test_plateaus_are_the_ladder_in_both_directions(excitation: Excitation, robot: Robot) -> None:
    for place in np.ndindex(2, 2):
        reference = excitation.reference[place[0], 0, place[1]]
        found = plateaus(reference, robot.sample_time_s)
        assert {one.axis for one in found} == {place[1]}
        speeds = np.array([one.speed for one in found])
        np.testing.assert_array_equal(speeds[::2], -speeds[1::2])
        # 0.005 to 0.2 of 400 rad/s, moved by less than half a sample's share of 300 samples.
        np.testing.assert_allclose(speeds[::2], np.geomspace(2.0, 80.0, 4), rtol=0.5 / 300)
        assert all((one.last - one.first) * robot.sample_time_s >= 0.3 - 1e-9 for one in found)


def test_the_simulated_robot_runs_at_constant_speed_within_its_limits(
    excitation: Excitation, robot: Robot, standing: Configurations
) -> None:
    start = robot.motor_angle(standing.angle)[:, None] - np.stack(
        [excitation.start_offset(c)[0] for c in range(2)]
    )
    simulated = robot.simulate(excitation.reference.reshape(4, -1, 2), robot.joint_angle(start.reshape(4, 2)))
    limits = robot.limits
    assert (simulated.position.max(axis=(0, 1)) <= limits.upper).all()
    assert (simulated.position.min(axis=(0, 1)) >= limits.lower).all()
    assert (np.abs(simulated.torque).max(axis=(0, 1)) <= 0.9 * robot.drives.torque_limit).all()
    for lane in range(4):
        axis = lane % 2
        reference = excitation.reference.reshape(4, -1, 2)[lane]
        for one in plateaus(reference, robot.sample_time_s):
            run = simulated.position[lane, one.samples, axis]
            speed = (run[-1] - run[0]) / (robot.sample_time_s * (len(run) - 1))
            assert speed == pytest.approx(one.speed, rel=0.02)


def test_all_axes_together_are_one_experiment(robot: Robot, standing: Configurations) -> None:
    excitation = ConstantVelocity(**SETTINGS, together=True).run(standing, robot, context())
    assert excitation.reference.shape[2] == 1
    found = plateaus(excitation.reference[0, 0, 0], robot.sample_time_s)
    assert [one.axis for one in found] == [0] * 8 + [1] * 8


def test_motors_of_a_coupled_wrist_share_the_room_of_their_joints() -> None:
    robot = example_robot(2)
    coupled = Robot(robot.description.model_copy(update={"coupling": ((0.01, 0.0), (0.004, 0.01))}))
    angle = np.array([0.5, 1.0])
    limits = motion_limits(coupled, angle, np.full(2, np.inf), 0.9)
    drives = rigid_drives(coupled)
    # Joints may go 1.5 and 1 rad; motor 1 moves both, motor 2 the second alone. Motor limits are farther away.
    assert motor_room(limits, drives, angle, 0, together=False) == pytest.approx(min(1.5 / 0.01, 1.0 / 0.004))
    assert motor_room(limits, drives, angle, 1, together=False) == pytest.approx(100.0, abs=60)
    together = [motor_room(limits, drives, angle, axis, together=True) for axis in (0, 1)]
    assert 0.004 * together[0] + 0.01 * together[1] <= 1.0 + 1e-12


def test_the_ladder_ends_where_the_travel_does(robot: Robot, standing: Configurations) -> None:
    narrow = ConstantVelocity(**{**SETTINGS, "highest_share": 0.9}, reach_rad=0.1).run(
        standing, robot, context()
    )
    travel = np.cumsum(narrow.reference, axis=3) * robot.sample_time_s
    assert np.abs(robot.joint_angle(np.ptp(travel, axis=3))).max() <= 0.2 * (1 + 1e-9)
    assert np.abs(narrow.reference).max() > 10.0


def test_what_does_not_fit_is_refused_with_what_would(robot: Robot, standing: Configurations) -> None:
    asked = ConstantVelocity(**SETTINGS, speeds_rad_s=(5.0, 100.0), reach_rad=0.1)
    with pytest.raises(
        MotionRefused, match=r"configuration 1: axis_1: 100 rad/s does not fit .* highest that does is"
    ):
        asked.run(standing, robot, context())
    tiny = ConstantVelocity(**SETTINGS, reach_rad=0.03)
    with pytest.raises(MotionRefused, match=r"allows \d\.\d+ rad/s, less than the lowest speed of 2 rad/s"):
        tiny.run(standing, robot, context())
    with pytest.raises(ValidationError, match=r"lowest_share: 0\.6 is not below highest_share"):
        ConstantVelocity(lowest_share=0.6)
    with pytest.raises(ValidationError, match="longest_s: 0.1 s is less than plateau_s"):
        ConstantVelocity(longest_s=0.1)


def test_loops_that_need_longer_to_settle_are_told(
    robot: Robot, standing: Configurations, caplog: pytest.LogCaptureFixture
) -> None:
    ConstantVelocity(**SETTINGS, settle_rad=0.5).run(standing, robot, context())
    # 2 x 0.3 N m / 0.64 N m/rad, and 0.08 / 0.64 s.
    assert "axis_1 breaks away 0.938 rad after a reversal" in caplog.text
    assert "settle_rad: 0.938 and settle_s: 0.4 leave it enough" in caplog.text
    caplog.clear()
    ConstantVelocity(**SETTINGS).run(standing, robot, context())
    assert "breaks away" not in caplog.text


def test_a_motor_that_gravity_keeps_busy_is_not_swept(robot: Robot) -> None:
    axes = {
        name: axis.model_copy(update={"torque_limit": 1.16}) for name, axis in robot.description.axes.items()
    }
    weak = Robot(robot.description.model_copy(update={"axes": axes}))
    leaning = Configurations(robot.axis_names, np.array([[1.2, 0.0]]))
    # 0.73 N m of gravity where it stands and 0.79 N m with the arm level, 0.3 N m of friction; 1.04 N m are allowed.
    with pytest.raises(MotionRefused, match="leave no torque for the ramps"):
        ConstantVelocity(**SETTINGS).run(leaning, weak, context())


def test_the_plan_tells_what_is_coming() -> None:
    first, second = ConstantVelocity(steps=6).plan_lines({})
    assert "one axis after another, 6 speeds in both directions" in first
    assert "12 plateaus an axis" in first
    assert "at least" in second


def test_the_stage_keeps_the_contract() -> None:
    check_stage(
        ConstantVelocity,
        steps=2,
        plateau_s=0.1,
        longest_s=0.5,
        settle_s=0.05,
        settle_rad=0.1,
        highest_share=0.1,
    )
