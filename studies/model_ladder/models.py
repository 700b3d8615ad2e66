"""The ladder of models (thesis sections 2.2 and 2.6), all from one robot file: what a rung leaves out is rigid."""

from __future__ import annotations

from robid_core import Robot

PLANT = "six_axis_flex"
LADDER = ("rigid", "flexible joint", "extended", "Flex-Model")


def ladder(plant: Robot) -> dict[str, Robot]:
    """Models of a Flex-Model with effects, simplest first; masses, motors and friction are the same in all.

    In the rigid one nothing bends; flexible joint: gears; extended: gears and bearings; Flex-Model: links too, but its
    springs are linear (no curve, no lost motion) and its friction is of Coulomb and viscous kind only, as in all.
    """
    description = plant.description.model_copy(update={"effects": {}, "name": "Flex-Model"})
    bodies = tuple(body.model_copy(update={"flexible": None}) for body in description.bodies)
    extended = description.model_copy(update={"bodies": bodies, "name": "extended"})
    joint = extended.model_copy(update={"bearings": {}, "name": "flexible joint"})
    axes = {name: axis.model_copy(update={"gear": None}) for name, axis in joint.axes.items()}
    rigid = joint.model_copy(update={"axes": axes, "name": "rigid"})
    return dict(zip(LADDER, (Robot(d) for d in (rigid, joint, extended, description)), strict=True))


def without_effects(plant: Robot) -> Robot:
    """The plant with linear springs and plain friction."""
    return plant.without_effect(*plant.description.effects)


def off_by(plant: Robot, share: float) -> Robot:
    """The plant with gears and bearings alternately stiffer and softer by a share, curves of the gears included."""
    values = plant.parameters()
    changed = {}
    for number, name in enumerate(plant.stiffness_names):
        factor = 1 + share if number % 2 == 0 else 1 - share
        changed[name] = values[name] * factor
        curve = f"effect.{name.partition('.')[2]}_curve.stiffness_"
        changed |= {key: value * factor for key, value in values.items() if key.startswith(curve)}
    return plant.with_parameters(changed)


def with_position_gain(robot: Robot, gain: float) -> Robot:
    """The robot with position control of its motors, 1/s, around the speed control that its file has."""
    axes = {
        name: axis.model_copy(
            update={"controller": axis.controller.model_copy(update={"position_gain": gain})}
        )
        for name, axis in robot.description.axes.items()
    }
    return Robot(robot.description.model_copy(update={"axes": axes}))
