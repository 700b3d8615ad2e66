"""Effects that a rigid-body fit would ignore or count twice: it refuses robots that have them, by name.

What the torque shows of a law, a signal or an elastic coordinate would go into the estimates, and act once more beside
them in the robot that has them. So would a payload that is part of an estimated mass. Where inertia is not estimated
a payload is known, like any body.
"""

from __future__ import annotations

from robid_core import ConfigurationError, Robot
from robid_fit.rigid_model import random_motion, torque_columns


def refuse_effects(robot: Robot, unknowns: tuple[str, ...]) -> None:
    """Check that the rigid model of a robot is whole without its effects.

    Parameters
    ----------
    robot
        Without elastic coordinates of its own.
    unknowns
        Kinds of parameters that are estimated.

    Raises
    ------
    ConfigurationError
        Where it is not; the message names the effects and says what to do.
    """
    entries = robot.description.effects
    bare, beside = robot.without_effect(*entries), []
    for label in entries:
        others = [other for other in entries if other != label]
        if _acts_beside(robot.without_effect(*others), bare, unknowns):
            beside.append(label)
    if beside:
        told = ", ".join(f"{label} ({entries[label].use})" for label in beside)
        raise ConfigurationError(
            f"fit.rigid knows bodies, rotors and the friction under axes, no effects; {robot.name} has {told}: take "
            "them out of the robot file (friction of a motor goes to axes.<name>.friction, a payload into the bodies), "
            "or fit periodic records with fit.torque_residual"
        )


def _acts_beside(robot: Robot, bare: Robot, unknowns: tuple[str, ...]) -> bool:
    """Tell whether a robot with one effect does what its rigid model cannot, or has another value of an unknown."""
    if robot.structure.effects:
        return True  # a law on a motion or a signal
    here, there = (torque_columns(r, random_motion(r, 1), r.drives.friction_speed) for r in (robot, bare))
    if here.names != there.names:
        return True  # more coordinates
    moved = {k for k, mine, its in zip(here.kinds, here.value, there.value, strict=True) if mine != its}
    return not moved.isdisjoint(unknowns)
