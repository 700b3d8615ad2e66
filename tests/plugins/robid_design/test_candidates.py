"""design.candidates: spread, limits, weight, and what happens where nothing fits."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from robid_core import ConfigurationError, Context, Robot
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_design.candidates import RandomCandidates, draw_configurations, latin_hypercube


def context(seed: int = 0) -> Context:
    log = logging.getLogger("test.candidates")
    return Context(np.random.default_rng(seed), map_in_process, lambda done, total, note="": None, log)


def test_every_strip_of_every_joint_is_used_once() -> None:
    lower, upper = np.array([-2.0, 0.0, 1.0]), np.array([2.0, 0.5, 9.0])
    points = latin_hypercube(20, lower, upper, np.random.default_rng(1))
    strips = np.floor((points - lower) / (upper - lower) * 20).astype(int)
    assert (np.sort(strips, axis=0) == np.arange(20)[:, None]).all()
    # Joints are shuffled independently: no pair of them goes along.
    assert np.abs(np.corrcoef(strips.T) - np.eye(3)).max() < 0.7


def test_configurations_stay_inside_and_bear_their_weight() -> None:
    robot = Robot.load("one_axis")
    # Gravity needs up to 1.97 N m of 20 at -2 to 2 rad: a share of 0.05 leaves only part of the range.
    stage = RandomCandidates(count=60, margin=0.1, gravity_share=0.05)
    found = stage.run(robot, context())
    assert found.angle.shape == (60, 1)
    assert np.abs(found.angle).max() <= 2.0 - 0.1 * 4.0
    assert np.abs(robot.gravity_torque(found.angle)).max() <= 0.05 * 20
    assert np.ptp(found.angle) > 1.0
    free = RandomCandidates(count=60).run(robot, context())
    assert np.abs(robot.gravity_torque(free.angle)).max() > 0.05 * 20


def test_same_seed_gives_the_same_configurations() -> None:
    robot = Robot.load("one_axis")
    first, again, other = (RandomCandidates(count=5).run(robot, context(seed)) for seed in (3, 3, 4))
    assert first.angle.tobytes() == again.angle.tobytes()
    assert (first.angle != other.angle).all()


def test_a_joint_without_limits_gets_a_turn() -> None:
    robot = Robot.load("one_axis")
    axis = robot.description.axes["axis_1"].model_copy(update={"position_limits": None})
    free = Robot(robot.description.model_copy(update={"axes": {"axis_1": axis}}))
    angle = RandomCandidates(count=50, margin=0.0).run(free, context()).angle
    assert np.abs(angle).max() <= np.pi
    assert np.abs(angle).max() > 2.5


def test_where_hardly_any_configuration_will_do_it_says_so() -> None:
    lower, upper = np.zeros(2), np.ones(2)
    with pytest.raises(ConfigurationError, match="of 800 configurations .* none is acceptable, 4 were asked"):
        draw_configurations(4, lower, upper, lambda angle: angle[:, 0] > 2, np.random.default_rng(0))
    some = draw_configurations(4, lower, upper, lambda angle: angle[:, 0] > 0.9, np.random.default_rng(0))
    assert some.shape == (4, 2)
    assert (some[:, 0] > 0.9).all()


@pytest.mark.parametrize(
    "settings", [{"count": 0}, {"count": 3, "margin": 0.5}, {"count": 3, "gravity_share": 0.0}]
)
def test_settings_that_cannot_be_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        RandomCandidates(**settings)


def test_the_contract_of_stages_is_kept() -> None:
    check_stage(RandomCandidates, count=3)
