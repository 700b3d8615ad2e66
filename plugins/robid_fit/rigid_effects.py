"""Effects in a rigid fit: laws that act on motors or joints are run along the measured motion, with the predicted load.

What a law does to the load of another is known from the prediction of the present robot, never from the measured
torque, whose noise would come in twice. Laws along springs and on other signals than the torque are none of a rigid
robot and are refused.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from robid_core import (
    ConfigurationError,
    FloatArray,
    ForceEffect,
    Robot,
    RobotMotion,
    effect_columns,
    forces_along,
)
from robid_core.mechanics import ForceTerm
from robid_fit.rigid_model import RigidMotion, random_motion, torque_columns
from robid_fit.rigid_ripple import LAWS as RIPPLE

ELASTIC = ("gear", "bearing")


def rigid_robot(robot: Robot) -> Robot:
    """Return the robot with stiff bearings, gears and links, its payloads and laws on motors and joints in place.

    Raises
    ------
    ConfigurationError
        Where it has an effect that means nothing without springs, or acts on signals; the message names it.
    """
    wrong = [bound.label for bound in robot.effects if bound.place.side in ELASTIC]
    description = robot.description
    waves = [label for label, entry in description.effects.items() if entry.use in RIPPLE]
    wrong += [
        bound.label
        for bound in robot.effects
        if not issubclass(bound.effect, ForceEffect) and bound.label not in waves
    ]
    axes = {name: axis.model_copy(update={"gear": None}) for name, axis in description.axes.items()}
    bodies = tuple(body.model_copy(update={"flexible": None}) for body in description.bodies)
    kept = {label: entry for label, entry in description.effects.items() if label not in wrong}
    changes = {"bearings": {}, "bodies": bodies, "axes": axes, "effects": kept}
    stiff = dataclasses.replace(robot, description=description.model_copy(update=changes))
    bare = torque_columns(stiff.without_effect(*kept), *_anywhere(robot))
    for label in (label for label in kept if label not in waves):
        others = [other for other in kept if other != label]
        if torque_columns(stiff.without_effect(*others), *_anywhere(robot)).names != bare.names:
            wrong.append(label)  # more coordinates
    if wrong:
        entries = description.effects
        told = ", ".join(f"{label} ({entries[label].use})" for label in dict.fromkeys(wrong))
        raise ConfigurationError(
            "fit.rigid knows bodies, payloads, ripple of torques, and laws on motors and joints; "
            f"{robot.name} has {told}: take that out of the robot file, or fit with fit.torque_residual"
        )
    return stiff


def _anywhere(robot: Robot) -> tuple[RigidMotion, FloatArray]:
    return random_motion(robot, 1), robot.drives.friction_speed


def acting_laws(robot: Robot) -> list[str]:
    """Labels of laws that are run along the motion; ripple is a column of the torque (`rigid_ripple`)."""
    return [bound.label for bound in robot.effects if issubclass(bound.effect, ForceEffect)]


def needs_load(robot: Robot) -> bool:
    """Whether a law asks for the torque that a gear passes."""
    return any(term.load.any() for term in robot.forces if isinstance(term, ForceTerm))


def effect_torque(
    robot: Robot, names: Sequence[str], motion: RigidMotion, sample_time: float, bodies: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Torque of all effects along a motion, and its derivative for some of their parameters.

    Parameters
    ----------
    robot
        Rigid.
    names
        Of parameters, `effect.<label>.<name>`.
    motion, sample_time
        Of the motors, and s.
    bodies
        Torque of bodies and rotors along it, N m at the motors, (n_sample, n_axis).

    Returns
    -------
    torque : (n_sample, n_axis)
    columns : (n_sample, n_axis, n_name)
    """
    labels = acting_laws(robot)
    behind = [bound.label for bound in robot.effects if bound.place.side == "arm"]
    rotors = robot.drives.rotor_inertia * np.gradient(motion.velocity, sample_time, axis=0)
    moved = motion.position[None], motion.velocity[None], sample_time
    along = RobotMotion(*moved, torque=bodies[None], passed=(bodies - rotors)[None])
    if behind and needs_load(robot):
        exerted = _exerted(robot, along, behind)
        along = RobotMotion(*moved, torque=(bodies + exerted)[None], passed=(bodies - rotors + exerted)[None])
    columns = np.zeros((*bodies.shape, len(names)))
    for column in effect_columns(robot, names, along):
        columns[:, :, names.index(column.name)] += column.values[0, :, None] * column.direction
    return _exerted(robot, along, labels), columns


def _exerted(robot: Robot, along: RobotMotion, labels: Sequence[str]) -> FloatArray:
    """Motor torque that laws take, (n_sample, n_axis)."""
    total = np.zeros(along.position.shape[1:])
    for force in forces_along(robot, along, labels).forces:
        if force.term.label in labels:
            total += force.run.force[0, :, None] * force.term.direction
    return total
