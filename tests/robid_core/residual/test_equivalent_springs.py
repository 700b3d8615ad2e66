"""Springs beside nonlinear ones: equivalent gains as theory has them, and the start of a fit as it should be."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from robid_core import Robot
from robid_core.residual.equivalent_springs import laws_of_springs, springs_and_laws
from robid_core.robot.forces_along import RobotMotion

N = 200_000
DEVIATION = 2e-3  # rad, of the deflection


def share_with(law: str, values: dict[str, float]) -> tuple[float, float]:
    """Stiffness and damping of spring and law under a Gaussian deflection, over those of the spring."""
    alone = Robot.load("one_axis")
    robot = alone.with_effect("law", law, "axis_1", values=values)
    (row,) = robot.mechanism.spring_directions
    deflection, rate = (
        np.random.default_rng(1).standard_normal((2, 1, N)) * np.array([DEVIATION, 0.1])[:, None, None]
    )
    position, speed = (values[..., None] * row / (row @ row) for values in (deflection, rate))
    motion = RobotMotion(position, speed, 1e-3)
    shares = springs_and_laws([robot], [alone], [motion], ["law"])
    return shares["gear_stiffness.axis_1"], shares["gear_damping.axis_1"]


def test_a_cubic_spring_is_as_stiff_as_three_times_its_variance() -> None:
    """Gelb and Vander Velde 1968: N = 3 c sigma^2; of 200 000 draws within 1.5 % (four standard errors of x^4)."""
    stiffness, damping = share_with("transmission.stiffening", {"cubic": 2e9})
    assert stiffness - 1 == pytest.approx(3 * 2e9 * DEVIATION**2 / 8e4, rel=0.015)
    assert damping == pytest.approx(1.0, abs=0.03)


def test_a_gap_is_as_stiff_as_the_share_of_time_on_its_flanks() -> None:
    """Its corners are round within a tenth: another one percent."""
    gap = 2e-3
    stiffness, _ = share_with("transmission.backlash", {"gap": gap})
    on_flanks = scipy.special.erfc(gap / 2 / DEVIATION / np.sqrt(2))
    assert stiffness == pytest.approx(on_flanks, rel=0.02)


def test_only_effects_along_springs_count() -> None:
    robot = Robot.load("one_axis").with_effect("a", "friction.stribeck", "axis_1", side="arm")
    assert laws_of_springs(robot) == ()
    robot = robot.with_effect("b", "transmission.backlash", "axis_1").with_effect(
        "c", "load.cable_spring", "axis_1"
    )
    assert laws_of_springs(robot) == ("b",)
