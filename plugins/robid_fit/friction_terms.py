"""Terms of a law of friction on the plateaus of one motor.

    torque = F_c s + d v + F_0                                          always; s the direction, v the speed
           + (F_s - F_c) exp(-|v / v_S|^n) s                            "stribeck" (Bo and Pavelescu 1982)
           + e v  one way                                               "asymmetric" (Armstrong-Helouvry 1991)
           + a |T| s                                                    "load" (Hamon, Gautier and Garrec 2010)
           + c (T - T_0) s,  d exp(-(T - T_0) / T_d) in place of d      "temperature" (Bittencourt and Gunnarsson 2012)
           + g_c cos q + g_s sin q  in each configuration               "gravity": an error of the robot file

A Coulomb level that differs by direction is a constant torque on plateaus, F_0: motion at constant speed cannot tell
the two apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid_core import FloatArray
from robid_fit.plateau_torques import AxisPlateaus

Extra = Literal["stribeck", "asymmetric", "load", "temperature", "gravity"]
EXTRAS: tuple[Extra, ...] = ("stribeck", "asymmetric", "load", "temperature", "gravity")
SHAPED: dict[Extra, int] = {"stribeck": 1, "temperature": 1}
"""Numbers of an extra that its torque is not linear in."""


@dataclass(frozen=True)
class Shape:
    """Parameters of a friction law in which it is not linear."""

    stribeck_speed: float = 1.0
    exponent: float = 2.0
    decay: float = np.inf
    """Warming that takes the viscous coefficient to 1/e, K."""
    forwards: bool = True
    """Which way is the stiffer one of an asymmetric law."""


def base_names(table: AxisPlateaus) -> tuple[str, ...]:
    """Of Coulomb level, viscous coefficient and offset those that these plateaus tell.

    One speed tells no viscous coefficient, one direction no offset.
    """
    sizes = np.abs(table.speed)
    both = (table.speed > 0).any() and (table.speed < 0).any()
    return (
        "coulomb",
        *(("viscous",) if sizes.max() > 1.2 * sizes.min() else ()),
        *(("offset",) if both else ()),
    )


def reference_temperature(table: AxisPlateaus) -> float:
    """T_0: mean over the plateaus, degC."""
    return float(table.temperature.mean())


def stribeck_or_viscous(table: AxisPlateaus, shape: Shape, name: str, values: FloatArray) -> FloatArray:
    """Columns of the excess by Stribeck speed, or of viscous friction by decay, (n_plateau, n_value)."""
    if name == "stribeck_speed":
        ratio = np.abs(table.speed[:, None] / values) ** shape.exponent
        excess: FloatArray = table.direction[:, None] * np.exp(-ratio)
        return excess
    rise = table.temperature - reference_temperature(table)
    viscous: FloatArray = table.speed[:, None] * np.exp(-rise[:, None] / values)
    return viscous


def columns_of(
    table: AxisPlateaus, base: Sequence[str], extras: Sequence[Extra], shape: Shape
) -> tuple[tuple[str, ...], FloatArray]:
    """Names and columns (n_plateau, n_column) of what a law is linear in."""
    direction, speed = table.direction, table.speed
    own = {"coulomb": direction, "viscous": speed, "offset": np.ones(table.n_plateau)}
    rise = table.temperature - reference_temperature(table)
    if "temperature" in extras:
        own["viscous"] = stribeck_or_viscous(table, shape, "decay", np.array([shape.decay]))[:, 0]
    found = {name: own[name] for name in base}
    if "stribeck" in extras:
        speeds = np.array([shape.stribeck_speed])
        found["excess"] = stribeck_or_viscous(table, shape, "stribeck_speed", speeds)[:, 0]
    if "asymmetric" in extras:
        found["one_way"] = np.where((speed > 0) == shape.forwards, speed, 0.0)
    if "load" in extras:
        found["load"] = table.load * direction
    if "temperature" in extras:
        found["coulomb_slope"] = rise * direction
    if "gravity" in extras:
        for number in np.unique(table.configuration).tolist():
            here = table.configuration == number
            found[f"gravity_cosine_{number}"] = here * table.cosine
            found[f"gravity_sine_{number}"] = here * table.sine
    return tuple(found), np.stack(list(found.values()), axis=1)
