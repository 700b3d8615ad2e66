"""A recording is fitted and diagnosed with a robot file that tells no limits and no controller."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from robid_core import MILESTONE, Context, Record, Robot
from robid_core.stage import map_in_process
from robid_diagnosis.closed_loop import ClosedLoopSimulation
from robid_diagnosis.effects import Effects
from robid_diagnosis.prediction import Prediction
from robid_fit.rigid import RigidBodyFit
from robid_fit.torque_residual import TorqueResidualFit

LACKS = (
    "the robot file of one_axis lacks torque_limit of axis_1 (Largest torque, N m) and controller of axis_1"
)
FRICTION = ("friction.stribeck@axis_1",)


def without_limits(robot: Robot) -> Robot:
    """The same robot, its limits and controllers not told."""
    nothing = {"torque_limit": None, "speed_limit": None, "controller": None}
    axes = {name: axis.model_copy(update=nothing) for name, axis in robot.description.axes.items()}
    description = robot.description.model_copy(update={"axes": axes})
    return replace(robot, description=description, base=description)


def context() -> Context:
    return Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))


@pytest.fixture(scope="module")
def record(told: Robot, plant_of: Callable[..., Robot], measured: Callable[..., Record]) -> Record:
    """Of springs, dampers and friction a third off, with the references of the drives."""
    return measured(plant_of(told, 5), 6, with_reference=True)


def test_the_torque_fit_finds_the_same(told: Robot, record: Record) -> None:
    """The limit only widens a prior of friction's functions: what the data tell does not hang on it."""
    stage = TorqueResidualFit(free=("gear_*",), passes=4)
    with_limits = stage.run((record,), told, context()).parameters
    without = stage.run((record,), without_limits(told), context()).parameters
    assert with_limits.names == without.names
    apart = np.abs(with_limits.estimate - without.estimate)
    assert (apart < 0.1 * with_limits.standard_error).all(), apart / with_limits.standard_error


def test_a_diagnosis_says_what_it_left_out_and_why(
    told: Robot, record: Record, caplog: pytest.LogCaptureFixture
) -> None:
    """What takes limits is announced before the search, too: who needs it can stop and complete the robot file."""
    bare = without_limits(told)
    fit = RigidBodyFit().run((record,), bare)
    simulated = ClosedLoopSimulation().run(record, fit, bare, context())
    assert simulated.verdict.startswith(f"The closed loop was not simulated: {LACKS}")
    assert not simulated.time
    predicted = Prediction().run((record,), bare, context(), fit)
    assert f"The closed loop was not simulated: {LACKS}" in predicted.verdict
    assert {one.quantity for one in predicted.errors} == {"torque in open loop"}
    with caplog.at_level(MILESTONE):
        explained = Effects(only=FRICTION, most=1, passes=4).run((record,), bare, context())
    assert caplog.messages[0].startswith(
        "experiments that separate ties will not be simulated: the robot file of one_axis lacks torque_limit of axis_1"
    )
    assert f"The closed loop could not be simulated: {LACKS}"[:60] in explained.verdict
    assert explained.response_check is not None
    assert "lacks controller of axis_1" in explained.response_check.reason
