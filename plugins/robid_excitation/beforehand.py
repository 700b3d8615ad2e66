"""What is wrong with an excitation's settings and a robot, told before anything runs: the checks of `run` itself.

A check raises ConfigurationError whose sentence begins with the setting's name; here it becomes a problem at that
setting, for `robid validate`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from robid_core import ConfigurationError, Robot

ARRAYS = 3  # multisine, slow sine and their sum are in memory at once


def problems_of(checks: Sequence[Callable[[], Any]]) -> dict[tuple[str | int, ...], str]:
    """Run checks and return the message of each that fails, by the setting that it names."""
    found: dict[tuple[str | int, ...], str] = {}
    for check in checks:
        try:
            check()
        except ConfigurationError as error:
            setting, colon, message = str(error).partition(": ")
            found |= {(setting,): message} if colon and setting.isidentifier() else {(): str(error)}
    return found


def refuse_wrong_length(setting: str, values: Sequence[float] | None, robot: Robot) -> None:
    """Raise ConfigurationError where a setting that has a value for each axis has another number of them."""
    if values is not None and len(values) != robot.n_axis:
        raise ConfigurationError(
            f"{setting}: {len(values)} factors for the {robot.n_axis} axes of {robot.name}"
        )


def refuse_too_fast(setting: str, speed: float, axis_scale: Sequence[float] | None, robot: Robot) -> None:
    """Raise ConfigurationError where a sine of this speed, rad/s at the motor, is faster than a motor may turn."""
    factors = (
        axis_scale if axis_scale is not None and len(axis_scale) == robot.n_axis else [1.0] * robot.n_axis
    )
    for (name, axis), factor in zip(robot.description.axes.items(), factors, strict=True):
        if axis.speed_limit is not None and speed * factor > axis.speed_limit:
            raise ConfigurationError(
                f"{setting}: {speed * factor:g} rad/s of {name} is above its speed limit, {axis.speed_limit:g} rad/s "
                "at the motor; ask for less"
            )


def refuse_strange_axes(setting: str, table: Mapping[str, Any] | None, robot: Robot) -> None:
    """Raise ConfigurationError where a table by axes names one that the robot does not have."""
    for name in table or ():
        if name not in robot.axis_names:
            raise ConfigurationError(
                f"{setting}: {robot.name} has no axis '{name}'; it has {', '.join(robot.axis_names)}"
            )


def refuse_too_large(setting: str, seconds: float, n_experiment: int, robot: Robot) -> None:
    """Raise ConfigurationError where the references of one configuration alone do not fit into the machine's memory.

    Parameters
    ----------
    setting
        The one that says how long a period is.
    seconds
        Its value.
    n_experiment
        Experiments of one configuration, all blocks together.
    robot
        Its axes and sampling time.
    """
    needed = ARRAYS * 8.0 * n_experiment * seconds / robot.sample_time_s * robot.n_axis
    there = float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    if needed > there:
        raise ConfigurationError(
            f"{setting}: the references of one configuration of {seconds:g} s take {needed / 1e9:.3g} GB, more than "
            f"the {np.floor(there / 1e8) / 10:g} GB of this machine; take a shorter time, or fewer blocks"
        )
