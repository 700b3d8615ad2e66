"""Candidates that change the robot itself: coordinates it lacks, and couplings of its gears.

A new spring begins where its coordinate, all others held, would resonate within the band of the record.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from robid_core import ConfigurationError, FloatArray, Robot, StructureEffect
from robid_diagnosis.candidates import LABEL, Candidate, Spot

RESONANCES = (0.1, 0.3, 1.0)  # of the highest frequency
DAMPING = 0.05  # of the critical one
BASE = 0.2  # of the robot's mass: a body that comes with the change
SPRINGS, DAMPERS = ("N m/rad", "N/m"), ("N m s/rad", "N s/m")
CONTINUOUS = (*SPRINGS, *DAMPERS, "kg")
ANYWHERE = "base"
RIGID = 1e4  # times a stiffness that would be seen: it does not give way


def structure_candidates(
    robot: Robot, use: str, effect: type[StructureEffect], angle: FloatArray, highest_hz: float
) -> Iterator[Candidate]:
    """Every place and every start of a change of the robot.

    What changes only numbers that a fit has free in any case (masses, rotors) is none.

    Parameters
    ----------
    robot, use, effect
        The robot as it was fitted, and the effect with its name.
    angle
        Joint-side poses, rad, (n_config, n_axis).
    highest_hz
        Of the record's bins.
    """
    for on in structure_places(robot, effect):
        for start in effect.starts(None):
            values = {row.name: row.default for row in effect.parameters} | dict(start)
            candidate = Candidate(use, Spot(on, ""), effect, values, None, _springs(effect))
            try:
                changed = changed_robot(robot, candidate, values)
            except ConfigurationError:
                continue  # about this direction, or from this motor, there is none
            if changed.mechanism.n_coordinate > robot.mechanism.n_coordinate:
                for share in RESONANCES:
                    omega = 2 * np.pi * share * highest_hz
                    scaled = _scaled(robot, candidate, changed, angle, omega)
                    yield Candidate(use, Spot(on, ""), effect, scaled, None, _springs(effect))
            elif not np.array_equal(changed.drives.gear, robot.drives.gear):
                yield Candidate(use, Spot(on, ""), effect, values, None, (), signed=True)


def structure_places(robot: Robot, effect: type[StructureEffect]) -> Sequence[str]:
    """Return where a change of the robot can be made: at its base, its bodies (by their joints) or its axes."""
    place = effect.places[0]
    if place == "base":
        return (ANYWHERE,)
    return [body.joint for body in robot.description.bodies] if place == "body" else robot.axis_names


def changed_robot(robot: Robot, candidate: Candidate, values: Mapping[str, float]) -> Robot:
    """Return a robot with the change."""
    return robot.with_effect(LABEL, candidate.use, candidate.spot.on, None, {**candidate.values, **values})


def alone(candidate: Candidate, spring: str, values: Mapping[str, float]) -> dict[str, float]:
    """Values with which one spring of a change gives way and the others do not."""
    held = {
        row.name: min(RIGID * values.get(row.name, candidate.values[row.name]), row.upper)
        for row in candidate.effect.parameters
        if row.name in candidate.springs and row.name != spring
    }
    return {**values, **held}


def softened(
    candidate: Candidate, values: Mapping[str, float], softness: Mapping[str, float]
) -> dict[str, float]:
    """Stiffnesses of springs that give way so many times as much as with these values, within their bounds.

    What a stiff spring does is in proportion to its compliance: sizes of columns are shares of it.
    """
    rows = {row.name: row for row in candidate.effect.parameters}
    return {
        name: float(np.clip(values[name] / size, rows[name].lower, rows[name].upper))
        for name, size in softness.items()
    }


def unseen(candidate: Candidate, values: Mapping[str, float], seen: Sequence[str]) -> dict[str, float]:
    """Stiffnesses of springs that data do not ask for: like those that they ask for, in the ratio of their starts."""
    if not seen:
        return {}
    share = float(np.mean([values[name] / candidate.values[name] for name in seen]))
    return softened(candidate, candidate.values, {n: 1 / share for n in candidate.springs if n not in seen})


def _springs(effect: type[StructureEffect]) -> tuple[str, ...]:
    return tuple(row.name for row in effect.parameters if row.unit in SPRINGS)


def _scaled(
    robot: Robot, candidate: Candidate, changed: Robot, angle: FloatArray, omega: float
) -> dict[str, float]:
    """Values with which the new coordinates resonate at omega, rad/s."""
    mass = changed.second_order(angle).mass.mean(axis=0)
    directions = changed.mechanism.spring_directions
    inertia = ((directions @ mass) * directions).sum(axis=1)
    values, here = dict(candidate.values), changed.spring_arrays()
    for row in candidate.effect.parameters:
        if row.unit == "kg":
            values[row.name] = BASE * sum(float(body.mass or 0.0) for body in robot.description.bodies)
        elif row.unit in (*SPRINGS, *DAMPERS):
            number = 0 if row.unit in SPRINGS else 1
            there = changed_robot(robot, candidate, {row.name: 2 * row.default}).spring_arrays()
            moved = np.abs(there[number] - here[number]).argmax()
            stiffness = inertia[moved] * omega**2
            values[row.name] = float((stiffness, 2 * DAMPING * stiffness / omega)[number])
        values[row.name] = float(np.clip(values[row.name], row.lower, row.upper))
    return values
