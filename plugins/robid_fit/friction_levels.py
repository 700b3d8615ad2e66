"""Coulomb level and offset of each motor that come nearest to friction as a free function of speed.

A robot file has ``coulomb tanh(v / speed) + viscous v + offset``. What the free functions found beside the viscous part
is told in these two numbers by least squares over the speeds that were measured; `speed` stays the file's.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robid_core import Robot
from robid_core.estimation.torque.spectra import PeriodicMotion, speed_functions

FloatArray = npt.NDArray[np.float64]


def friction_levels(
    robot: Robot, motion: PeriodicMotion, widths: tuple[float, ...], coefficient: FloatArray
) -> dict[str, float]:
    """Return `friction.<axis>.coulomb` and `.offset`, N m.

    Parameters
    ----------
    robot
        With the speeds of its friction.
    motion
        What was measured.
    widths
        Of the free functions, rad/s.
    coefficient
        Of `speed_functions(widths)` and, last, of a constant torque, N m, shape (n_law + 1, n_axis).
    """
    speed = motion.fine_speed().reshape(-1, robot.n_axis)
    torque = coefficient[-1] + sum(
        level * law(speed) for level, law in zip(coefficient[:-1], speed_functions(widths), strict=True)
    )
    found = {}
    for a, name in enumerate(robot.axis_names):
        columns = np.stack(
            (np.tanh(speed[:, a] / robot.drives.friction_speed[a]), np.ones(len(speed))), axis=1
        )
        level, offset = np.linalg.lstsq(columns, torque[:, a], rcond=None)[0].tolist()
        found[f"friction.{name}.coulomb"] = max(level, 0.0)
        found[f"friction.{name}.offset"] = offset
    return found
