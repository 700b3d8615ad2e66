"""A gear that stiffens as much as it is stiff: fits of a robot file that states it find the spring beside it."""

from __future__ import annotations

import functools

import pytest

import robid_core as robid
from robid_core import Fit, Record, Robot

CUBIC = 1e9  # N m/rad^3: a third of the gear's torque under gravity


def stiffening(name: str) -> Robot:
    return Robot.load(name).with_effect("winds", "transmission.stiffening", "axis_1", values={"cubic": CUBIC})


@functools.cache
def record() -> Record:
    nominal = Robot.load("one_axis")
    poses = robid.use("design.candidates", count=4)(nominal, seed=4)
    motion = {"band_hz": (4.0, 80.0), "lines": 60, "period_s": 4.0, "blocks": 2, "slow_sine_rad_s": 9.0}
    excitation = robid.use("excitation.multisine", **motion)(poses, nominal, seed=4)
    return robid.use("acquisition.simulated")(poses, excitation, stiffening("one_axis_true"), seed=4)


def fitted(robot: Robot) -> Fit:
    return robid.use("fit.torque_residual")(record(), robot)


@pytest.mark.parametrize(("told", "most"), [("one_axis_true", 1.1), ("one_axis", 1.5)])
def test_the_spring_is_found_from_where_it_is_and_from_43_percent_above(told: str, most: float) -> None:
    """Both fits ended at misfits of millions, at 71 700 N m/rad: the linear spring that is nearest to both."""
    fit = fitted(stiffening(told))
    found = dict(zip(fit.parameters.names, fit.parameters.estimate, strict=True))
    assert found["gear_stiffness.axis_1"] == pytest.approx(5.6e4, rel=1e-3)
    assert fit.misfit < most
