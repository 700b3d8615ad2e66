"""Whether a record is sampled as the drives of its robot are, which its simulations and fits take for granted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid_core.errors import ConfigurationError

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

ALIKE = 1e-3  # of a sampling time: a clock that is off by more is another one


def other_sampling(sample_time_s: float, robot: Robot) -> str:
    """Say that a record of this sampling time is not one of the robot's drives; empty where it is.

    >>> import robid_core as robid
    >>> robot = robid.Robot.load("one_axis")
    >>> robid.other_sampling(robot.sample_time_s, robot)
    ''
    """
    if abs(sample_time_s / robot.sample_time_s - 1) <= ALIKE:
        return ""
    return (
        f"the record is sampled every {sample_time_s:g} s and the drives of {robot.name} every {robot.sample_time_s:g} "
        "s; set sample_time_s in the robot file"
    )


def check_sampling(sample_time_s: float, robot: Robot) -> None:
    """Raise ConfigurationError where a record is sampled otherwise than the drives of its robot."""
    if wrong := other_sampling(sample_time_s, robot):
        raise ConfigurationError(wrong)
