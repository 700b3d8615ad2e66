"""Gains of torques among what is free: with springs and inertia they have a common scale that no motion shows.

Whether a parameter scales a motor's torque is told by its effect's law, so of strangers' effects as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core import Robot, SignalEffect

SIGNAL = np.array([[1.0, -2.0, 0.5, 3.0]])
ANGLE = np.array([[0.3, 1.1, -2.0, 0.9]])


def _is_torque_gain(robot: Robot, name: str) -> bool:
    """Return whether a parameter changes a torque in proportion to it, at any angle and speed of the motor."""
    for bound in robot.effects:
        row = name.removeprefix(f"effect.{bound.label}.")
        if row == name or not issubclass(bound.effect, SignalEffect) or bound.place.side == "position":
            continue
        change = bound.effect.regressor(SIGNAL, ANGLE, 0.1 * ANGLE, bound.parameters, bound.place).get(row)
        return change is not None and np.ptp(change / SIGNAL) < 1e-9 and bool(np.any(change))
    return False


def common_scale_problem(robot: Robot, chosen: Sequence[str]) -> dict[tuple[str | int, ...], str]:
    """Say, by its place in the settings, that a gain is free with springs and inertia; empty where none is."""
    kinds = {robot.parameter_kind(name) for name in chosen}
    gain = next((name for name in sorted(chosen) if _is_torque_gain(robot, name)), None)
    if gain is None or not {"stiffness", "inertia"} <= kinds:
        return {}
    message = (
        f"{gain}: torques, inertia and springs have a common scale that no motion shows, and all would slide together; "
        f"hold the gain (fixed: [{gain}]), or the inertia"
    )
    return {("free",): message}
