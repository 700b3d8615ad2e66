"""Where an effect may act in a robot: at a bearing that is there, at an axis, at a gear that has a spring."""

from __future__ import annotations

from robid_core.effect import ForceEffect, SignalEffect
from robid_core.robot.file.description import EffectEntry, RobotDescription


def sides_of(effect: type) -> tuple[str, ...]:
    """Return the sides or channels of a force or signal effect; none of one that changes the robot's structure."""
    if issubclass(effect, ForceEffect):
        return effect.sides
    return effect.channels if issubclass(effect, SignalEffect) else ()


def lacking_side(use: str, side: str, sides: tuple[str, ...]) -> str:
    """Return what is wrong with a side; empty where the effect has it."""
    return "" if side in sides else f"'{use}' has no side '{side}'; it has {', '.join(sides)}"


def lacking_place(robot: RobotDescription, on: str | None, side: str) -> str:
    """Return what a robot lacks for an effect on this side of `on` (null: of its only axis); empty where nothing."""
    if on is None and len(robot.axes) == 1:
        on = next(iter(robot.axes))
    elastic = [body.joint for body in robot.bodies if body.elastic is not None]
    what, there = ("bearing", [*robot.bearings, *elastic]) if side == "bearing" else ("axis", [*robot.axes])
    if on not in there:
        known = f"there are {', '.join(there) or 'none'}"
        return (
            f"it acts on one {what}: name it by `on:`; {known}"
            if on is None
            else f"no {what} '{on}'; {known}"
        )
    if side == "gear" and robot.axes[on].gear is None:
        return f"the gear of {on} is rigid; give it a spring (axes.{on}.gear) or put the effect on the arm or motor"
    return ""


def wrong_place(effect: type, entry: EffectEntry, robot: RobotDescription) -> tuple[str, str] | None:
    """Return the key of an entry that puts an effect where it cannot be, and why; None where it can be there.

    What an effect that changes the structure asks of its place only it knows.
    """
    sides = sides_of(effect)
    if not sides:
        return None
    side = entry.side or sides[0]
    if wrong := lacking_side(entry.use, side, sides):
        return "side", wrong
    wrong = lacking_place(robot, entry.on, side)
    return ("use" if entry.on is None else "on", wrong) if wrong else None
