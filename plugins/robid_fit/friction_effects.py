"""A fitted law of friction as numbers of a robot: those of its axis, and effects that hold what comes on top.

The axis keeps Coulomb level, viscous coefficient and offset; effects of the catalogue add an excess at low speed, one
direction's surplus, the load's share. The catalogue's temperature law is no sum, so that it takes level and
coefficient over from the axis; the robot is then as warm as the plateaus were on average.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import ConfigurationError, FloatArray, Robot
from robid_fit.friction_law import LONGEST_DECAY_K, FrictionFit

FRICTION = "friction."
SIDE = "motor"
ISOTHERMAL: dict[str, float] = {"capacity": 1e8, "time_constant": 1e6}  # the thermal side is not seen here
OWN = ("coulomb", "viscous", "offset")
LEAST_SPEED = 1e-6  # of the catalogue's smooth signs


@dataclass(frozen=True, eq=False)
class AxisFriction:
    """Robot and numbers of one axis; `names` are parameters of the robot, told by the fit's own names."""

    robot: Robot
    held: dict[str, float]
    """Parameters that are set without being estimated."""
    names: dict[str, str]
    """Fit's name to robot's name."""


def without_friction_effects(robot: Robot, axes: tuple[str, ...]) -> tuple[Robot, tuple[str, ...]]:
    """Return the robot without effects of friction on some axes' motors, and their labels."""
    labels = tuple(
        label
        for label, entry in robot.description.effects.items()
        if entry.use.startswith(FRICTION) and (entry.on in axes or entry.on is None)
    )
    return robot.without_effect(*labels), labels


def refuse_other_laws(robot: Robot, stage: str) -> None:
    """Check that the rigid model of a robot is whole without its effects.

    Raises
    ------
    ConfigurationError
        Where laws on forces or signals would go into the friction.
    """
    labels = robot.structure.effects
    if labels:
        told = ", ".join(f"{label} ({entry.use})" for label, entry in labels.items())
        raise ConfigurationError(
            f"{stage} takes what the rigid robot needs off the torque, and knows no other effects; {robot.name} has "
            f"{told}: take them out of the robot file, or use diagnosis.effects"
        )


def with_law(robot: Robot, axis: str, fit: FrictionFit, reference_temperature: float) -> AxisFriction:
    """Return a robot with the effects that a law needs.

    Parameters
    ----------
    robot
        Without effects of friction on this axis.
    axis
        Name of the axis.
    fit
        The law.
    reference_temperature
        At which the Coulomb level is told, degC.
    """
    names = {name: f"friction.{axis}.{name}" for name in OWN if name in fit.names}
    held: dict[str, float] = {}
    speed = max(robot.parameter(f"friction.{axis}.speed"), LEAST_SPEED)

    def added(use: str, values: dict[str, float], told: dict[str, str]) -> None:
        nonlocal robot
        label = _free_label(robot, f"{use}_{axis}")
        robot = robot.with_effect(label, f"{FRICTION}{use}", axis, SIDE, values)
        names.update({own: f"effect.{label}.{name}" for own, name in told.items()})

    if "stribeck" in fit.extras:
        known = {"stribeck_speed": fit.of("stribeck_speed"), "exponent": fit.shape.exponent, "speed": speed}
        nothing = {"coulomb": 0.0, "breakaway": max(fit.of("excess"), 0.0), "viscous": 0.0}
        added("stribeck", {**known, **nothing}, {"excess": "breakaway", "stribeck_speed": "stribeck_speed"})
    if "asymmetric" in fit.extras:
        way, other = ("forwards", "backwards") if fit.shape.forwards else ("backwards", "forwards")
        values = {f"coulomb_{one}": 0.0 for one in (way, other)}
        values |= {f"viscous_{way}": max(fit.of("one_way"), 0.0), f"viscous_{other}": 0.0, "speed": speed}
        added("asymmetric", values, {"one_way": f"viscous_{way}"})
    if "load" in fit.extras:
        values = {"load_coulomb": float(np.clip(fit.of("load"), 0.0, 1.0)), "load_excess": 0.0}
        added(
            "load_dependent",
            {"coulomb": 0.0, "viscous": 0.0, "speed": speed, **values},
            {"load": "load_coulomb"},
        )
    if "temperature" in fit.extras:
        warm = {"start": reference_temperature, "ambient": reference_temperature, "speed": speed}
        decay = fit.of("decay") if "decay" in fit.names else LONGEST_DECAY_K
        viscous = fit.of("viscous") if "viscous" in fit.names else robot.parameter(f"friction.{axis}.viscous")
        values = {"coulomb": max(fit.of("coulomb"), 0.0), "coulomb_slope": fit.of("coulomb_slope")}
        values |= {"viscous_hot": 0.0, "viscous_cold": max(viscous, 0.0), "decay": decay}
        told = {"coulomb": "coulomb", "coulomb_slope": "coulomb_slope"}
        told |= {"viscous": "viscous_cold"} if "viscous" in fit.names else {}
        told |= {"decay": "decay"} if "decay" in fit.names else {}
        added("temperature", {**values, **warm, **ISOTHERMAL}, told)
        held = {f"friction.{axis}.coulomb": 0.0, f"friction.{axis}.viscous": 0.0}
    return AxisFriction(robot, held, names)


def _free_label(robot: Robot, wanted: str) -> str:
    taken, number, label = robot.description.effects, 1, wanted
    while label in taken:
        number += 1
        label = f"{wanted}_{number}"
    return label


def possible(name: str, value: float) -> float:
    """Return an estimate within what a robot can have: levels that scatter below zero are none."""
    return value if name.endswith((".offset", ".coulomb_slope")) else max(value, 0.0)


def curve_of(fit: FrictionFit, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Measured torque less what is not the speed's, and what is, (n_plateau,) each."""
    by_speed = np.array(
        [
            not name.startswith(("load", "coulomb_slope", "gravity"))
            for name in fit.names[: fit.columns.shape[1]]
        ]
    )
    value = fit.value[: fit.columns.shape[1]]
    fitted: FloatArray = fit.columns[:, by_speed] @ value[by_speed]
    return torque - fit.columns[:, ~by_speed] @ value[~by_speed], fitted
