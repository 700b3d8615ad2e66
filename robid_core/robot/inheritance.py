"""What a robot with other numbers keeps of the one it was made from.

A fit changes a few numbers thousands of times. Chain, mechanism, places and laws are made from a description by work
that most changes do not touch: a spring leaves the chain as it is, another mass leaves its joints as they are, a
friction level leaves every effect at its place. Here stands who depends on what; whatever is not known to be the
same is made anew. Structure effects may turn any number into any other: with them only the names are kept.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from robid_core.robot.file.description import EffectEntry, RobotDescription
from robid_core.robot.file.effect_class import effect_class
from robid_core.robot.file.named_parameters import number_at
from robid_core.robot.file.parameter_places import ParameterPlace
from robid_core.robot.structure_effect import StructureEffect

if TYPE_CHECKING:
    from robid_core.mechanics import Chain
    from robid_core.robot.effects import BoundEffect
    from robid_core.robot.robot import Robot

SPRINGS = ("stiffness_names", "damping_names", "spring_names", "spring_places")
NAMES = ("layout", *SPRINGS)
AT_SPRING = ("gear", "bearing")


def inherited(robot: Robot, changed: RobotDescription, places: Iterable[ParameterPlace]) -> dict[str, Any]:
    """Return the cached properties of a robot that hold for a changed description, or are quickly made from its own.

    Parameters
    ----------
    robot
        The robot before.
    changed
        Its description with other numbers at `places`.
    """
    places = tuple(places)
    kept = {name: getattr(robot, name) for name in NAMES}
    if structure_effects(robot.description):
        return kept
    touched = {_touches(place) for place in places}
    known = robot.__dict__
    if "chain" in known and "modes" not in touched:
        kept["chain"] = _with_bodies(known["chain"], changed, places) if "body" in touched else known["chain"]
    if "mechanism" in known and "chain" in kept and "gear" not in touched:
        kept["mechanism"] = known["mechanism"].with_bodies(kept["chain"])
        if "rotor" in touched:
            rotors = np.array([axis.rotor_inertia for axis in changed.axes.values()])
            kept["mechanism"] = replace(kept["mechanism"], rotor_inertia=rotors)
        elif kept["chain"] is known["chain"]:
            kept["mechanism"] = known["mechanism"]
    if not touched & {"friction", "drive", "rotor", "gear"} and "drives" in known:
        kept["drives"] = known["drives"]
    if not touched & {"drive", "rotor", "gear", "modes"} and "effects" in known and "mechanism" in kept:
        kept |= _laws(robot, changed, places, touched)
    return kept


def inherited_beside(robot: Robot, changed: RobotDescription) -> dict[str, Any]:
    """Return the cached properties of a robot that hold for its description with other effects.

    Laws and signals act on bodies, drives and springs and leave them as they are; another structure leaves nothing.
    """
    if structure_effects(robot.description) != structure_effects(changed):
        return {}
    return {
        name: robot.__dict__[name]
        for name in ("chain", "mechanism", "drives", *SPRINGS)
        if name in robot.__dict__
    }


def structure_effects(description: RobotDescription) -> list[tuple[str, EffectEntry]]:
    """Return the effects that change the robot itself, in their order."""
    return [
        (label, entry)
        for label, entry in description.effects.items()
        if issubclass(effect_class(entry.use), StructureEffect)
    ]


def _touches(place: ParameterPlace) -> str:
    """Return what a number is a number of: spring, friction, rotor, gear, drive, body, modes, or an effect's label."""
    section, entry, *inner = place.path
    if section == "effects":
        return f"effect {entry}"
    if section == "bearings" or "elastic" in inner or inner[0] == "gear":
        return "spring"
    if section == "bodies":
        return "modes" if "flexible" in inner else "body"
    return {"friction": "friction", "rotor_inertia": "rotor", "gear_ratio": "gear"}.get(
        str(inner[0]), "gear" if section == "coupling" else "drive"
    )


def _with_bodies(chain: Chain, changed: RobotDescription, places: tuple[ParameterPlace, ...]) -> Chain:
    """Return the chain with other masses, centres of mass and inertias; the joints stay."""
    last = {body.joint: body.joint for body in changed.bodies}
    for (
        name,
        bearing,
    ) in changed.bearings.items():  # the last elastic coordinate behind a joint carries its body
        last[bearing.joint] = name
    mass, centre, inertia = chain.mass.copy(), chain.centre_of_mass.copy(), chain.inertia.copy()
    for index in {int(place.path[1]) for place in places if place.path[0] == "bodies"}:
        body = changed.bodies[index]
        j = chain.index(last[body.joint])
        mass[j], centre[j], inertia[j] = body.mass, body.centre_of_mass, body.inertia
    return chain.with_bodies(mass, centre, inertia)


def _at_its_spring(
    effect: BoundEffect, changed: RobotDescription, places: tuple[ParameterPlace, ...]
) -> BoundEffect:
    """Return a bound effect whose place knows the new numbers of its spring, the same one where they did not change."""
    if effect.place.side not in AT_SPRING:
        return effect
    for place in places:
        for field in ("stiffness", "damping"):
            if place.name == f"{effect.place.side}_{field}.{effect.place.name}":
                numbers: dict[str, Any] = {field: number_at(changed, place)}
                effect = replace(effect, place=replace(effect.place, **numbers))
    return effect


def _laws(
    robot: Robot, changed: RobotDescription, places: tuple[ParameterPlace, ...], touched: set[str]
) -> dict[str, Any]:
    """Return the bound effects and their terms; places at a spring that changed get its new numbers."""
    bound: list[BoundEffect] = []
    for effect in robot.effects:
        if f"effect {effect.label}" in touched:
            entry = changed.effects[effect.label]
            table = effect.effect.parameters
            values = np.array([entry.with_.get(row.name, row.default) for row in table], dtype=np.float64)
            effect = replace(effect, parameters=values)
        bound.append(_at_its_spring(effect, changed, places))
    kept: dict[str, Any] = {"effects": tuple(bound), "terms_of_effects": {}}
    for before, after in zip(robot.effects, bound, strict=True):
        if before is after and after.label in robot.terms_of_effects:
            kept["terms_of_effects"][after.label] = robot.terms_of_effects[after.label]
    if all(a is b for a, b in zip(robot.effects, bound, strict=True)) and "friction" not in touched:
        for name in ("forces", "bending_forces", "signals"):
            if name in robot.__dict__:
                kept[name] = robot.__dict__[name]
    return kept
