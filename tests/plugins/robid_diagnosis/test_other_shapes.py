"""A law with a second minimum is found in the first: sliders whose spread a search begins at the wrong end of."""

from __future__ import annotations

import numpy as np
import pytest

import robid_core as robid
from robid_core import Record, Robot

TRUE = {"stiffness": 8e3, "torque": 15.0, "spread": 10.0}  # a tenth of the spring, 0.3 of the friction


def measured(seed: int) -> tuple[Robot, Record]:
    """Eight experiments of one axis whose springs, dampers and friction are 25 % off, and that hides the sliders."""
    robot = robid.Robot.load("one_axis")
    drawn = np.random.default_rng(seed)
    wrong = {
        name: robot.parameter(name) * np.exp(0.25 * drawn.standard_normal())
        for name in robot.layout
        if robot.parameter_kind(name) in ("stiffness", "damping", "friction") and not name.endswith("offset")
    }
    plant = robot.with_parameters(wrong).with_effect(
        "hidden", "transmission.maxwell_slip", "axis_1", values=TRUE
    )
    where = robid.use("design.candidates", count=4)(robot, seed=seed + 1)
    excitation = robid.use(
        "excitation.multisine",
        band_hz=[3, 60],
        lines=80,
        period_s=3,
        blocks=2,
        slow_sine_rad_s=6,
        beyond_limits="scale",
    )(robot, where, seed=seed + 2)
    return robot, robid.use("acquisition.simulated", periods=2)(where, excitation, plant, seed=seed + 3)


@pytest.mark.parametrize(
    "seed", [41, pytest.param(42, marks=pytest.mark.full), pytest.param(43, marks=pytest.mark.full)]
)
def test_sliders_are_found_with_the_spread_that_they_have(seed: int) -> None:
    """Sizes within four stated errors and 1 %; the minimum beside it is 28 % and 50 % off, at a misfit of 2.6."""
    robot, record = measured(seed)
    sought = {"response_check": [], "separate": False, "only": ["transmission.maxwell_slip"]}
    found = robid.use("diagnosis.effects", **sought)(record, robot, seed=1).findings[0]
    assert found.effect == "transmission.maxwell_slip"
    for name, value, error in zip(found.names, found.value, found.standard_error, strict=True):
        assert abs(value - TRUE[name]) < min(4 * error, 0.01 * TRUE[name])
