"""Elastic modes of the robot: natural frequencies, shapes, and which springs hold their energy.

Undamped and with free motors, ``K phi = (2 pi f)^2 M phi`` at the gravity equilibrium: these are the resonances of a
response from motor torque to motor acceleration. A mechanism has one rigid motion for each motor; the others bend.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import FloatArray, NotTrustworthy, Robot

NAMED = 0.05  # of the strain energy: springs with less are not named
MOST_NAMED = 4


@dataclass(frozen=True)
class ElasticMode:
    """One mode in one configuration."""

    frequency_hz: float
    shape: FloatArray
    """Generalised coordinates, shape (n_coordinate,), of unit modal mass."""
    energy: FloatArray
    """Share of each spring in the strain energy, shape (n_spring,), in the order of `Robot.spring_names`."""


def elastic_modes(robot: Robot, angle: FloatArray, highest_hz: float, most: int) -> list[list[ElasticMode]]:
    """Modes of each configuration, lowest first.

    Parameters
    ----------
    robot
        Nominal or fitted.
    angle
        Joint-side motor angles, shape (n_config, n_axis).
    highest_hz, most
        Frequency up to which modes are given, and how many at most.

    Returns
    -------
    One list for each configuration; empty lists where no spring is in the robot or it has no stable rest.
    """
    from scipy.linalg import LinAlgError, eigh

    stiffness = robot.spring_arrays()[0]
    if not len(stiffness):
        return [[] for _ in angle]
    try:
        model = robot.second_order(angle)
    except NotTrustworthy:
        return [[] for _ in angle]
    result: list[list[ElasticMode]] = []
    for mass, spring in zip(model.mass, model.stiffness, strict=True):
        try:
            squares, shapes = eigh(spring, mass)
        except LinAlgError:
            result.append([])
            continue
        modes = []
        for square, shape in zip(squares[robot.n_axis :], shapes.T[robot.n_axis :], strict=True):
            energy = stiffness * (model.spring_directions @ shape) ** 2
            frequency = float(np.sqrt(max(square, 0.0)) / (2 * np.pi))
            if 0 < frequency <= highest_hz and energy.sum() > 0:
                modes.append(ElasticMode(frequency, shape, energy / energy.sum()))
        result.append(modes[:most])
    return result


def energy_in_words(names: tuple[str, ...], energy: FloatArray) -> str:
    """Name the springs that hold most of the energy: `gear of axis_2 62 %, bearing of axis_1_y 20 %`."""
    largest = [int(s) for s in np.argsort(-energy, kind="stable")[:MOST_NAMED] if energy[s] >= NAMED]
    parts = []
    for s in largest:
        noun, _, place = names[s].partition(".")
        parts.append(f"{noun.removesuffix('_stiffness')} of {place} {100 * energy[s]:.0f}\u202f%")
    return ", ".join(parts)
