"""Resonance against amplitude: what a weak and a strong excitation say of the same robot (thesis section 3.1.3).

One plant with linear springs and friction, and the same with gears that stiffen as they deflect: friction fades as the
amplitude grows, a stiffening spring raises the resonance.
"""

from __future__ import annotations

import numpy as np

from robid_core import Robot, load_plugin
from studies.frf_methods.measurement import chance, measure, quiet, references

from reference.excitation_class import shipped_class  # isort: skip
from reference.plants import ReferencePlant, reference_plant  # isort: skip
from robid_core import FloatArray

SHARES = (0.05, 0.1, 0.2, 0.4)
"""Of the torque limit, for the multisine's peaks; the worked example takes up to 0.5."""
AXES = ("axis_1", "axis_2", "axis_3")
BLOCKS = 16
SEED = 200_001
RISE, AT_TORQUE = 0.5, 0.1
"""Share of its stiffness that a gear gains at the deflection under so much of its motor's torque limit."""


def stiffening(robot: Robot) -> Robot:
    """The robot with a cubic spring beside that of each of three gears, k x + c x^3: 3 c x^2 = RISE k at AT_TORQUE."""
    description = robot.description
    data = description.model_dump(mode="json", by_alias=True)
    for name in AXES:
        axis = robot.axis_names.index(name)
        stiffness = robot.parameters()[f"gear_stiffness.{name}"]
        deflection = (
            AT_TORQUE * robot.drives.torque_limit[axis] / (abs(robot.drives.gear[axis, axis]) * stiffness)
        )
        cubic = RISE * stiffness / (3 * deflection**2)
        data["effects"][f"stiffening_{name}"] = {
            "use": "transmission.stiffening",
            "on": name,
            "with": {"cubic": cubic},
        }
    return Robot(type(description).model_validate(data, strict=False))


def responses(plant: ReferencePlant, robot: Robot, pose: int, share: float) -> tuple[FloatArray, FloatArray]:
    """Frequencies and |G_aa| over the line, (n_freq,) and (n_freq, n_axis), friction's scatter removed."""
    excitation = shipped_class(plant, torque_share=share)
    reference = references(excitation, BLOCKS, chance(plant.index, pose, SEED))
    record = measure(robot, plant.pose[pose - 1], excitation, reference, 1, n_period=1)
    context = quiet()
    smooth = load_plugin("robid.stages", "compensate.friction")().run(record, plant.nominal, context)
    frf = load_plugin("robid.stages", "frf.jio")().run(smooth, context)
    return frf.frequency_hz, np.abs(np.einsum("faa->fa", frf.response[0]))


def extremum(
    frequency_hz: FloatArray, size: FloatArray, sign: int, about_hz: float | None = None
) -> tuple[float, float]:
    """Highest (sign 1) or lowest (-1) place of a response: a parabola through log size over log frequency.

    Within a quarter of `about_hz`, or away from the ends of the band.
    """
    y, x = sign * np.log(size), np.log(frequency_hz)
    allowed = np.zeros(len(x), dtype=bool)
    allowed[2:-2] = True
    if about_hz is not None:
        allowed &= np.abs(x - np.log(about_hz)) < 0.25
    k = int(np.argmax(np.where(allowed, y, -np.inf)))
    a, b, c = np.polyfit(x[k - 1 : k + 2] - x[k], y[k - 1 : k + 2], 2)
    at = float(np.clip(-b / (2 * a), x[k - 1] - x[k], x[k + 1] - x[k])) if a < 0 else 0.0
    return float(np.exp(x[k] + at)), float(np.exp(sign * (a * at**2 + b * at + c)))


def rows(number: int = 1, pose: int = 1) -> list[dict[str, str | float]]:
    """Deepest antiresonance and highest resonance of each of the first three axes, over the amplitude.

    The strongest excitation of the robot with linear springs says which ones are followed.
    """
    plant = reference_plant(number)
    robots = {"linear springs": plant.robot, "stiffening gears": stiffening(plant.robot)}
    followed: dict[tuple[str, int], float] = {}
    table: list[dict[str, str | float]] = []
    for title, robot in robots.items():
        for share in sorted(SHARES, reverse=True):
            frequency, size = responses(plant, robot, pose, share)
            for name in AXES:
                own = size[:, robot.axis_names.index(name)]
                low, high = (extremum(frequency, own, sign, followed.get((name, sign))) for sign in (-1, 1))
                followed.setdefault((name, -1), low[0])
                followed.setdefault((name, 1), high[0])
                table.append(
                    {
                        "springs": title,
                        "torque_share": share,
                        "axis": name,
                        "antiresonance_hz": low[0],
                        "depth": low[1],
                        "resonance_hz": high[0],
                        "peak": high[1],
                    }
                )
    return table
