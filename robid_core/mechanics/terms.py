"""What acts on a mechanism besides rigid bodies, linear springs and dampers: laws at stated places.

A force term is a compiled law that sees one coordinate (a row over the generalised coordinates) and acts along
another, usually the same; a signal term is a law on one channel of one axis. Effects make them, the simulator
runs them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.compiled.laws import Law

CHANNELS = ("torque", "position", "torque_measurement")
"""Commanded to acting torque; true to measured motor angle; the drive's torque to the reported one."""

TORQUE, POSITION, TORQUE_MEASUREMENT = range(3)
"""Their places in `CHANNELS`."""


@dataclass(frozen=True, eq=False)
class ForceTerm:
    """A force ``-direction law(coordinate . z, coordinate . z', load . transmitted torque)``."""

    law: Law
    """(position, velocity, load, state, next_state, parameters, step) -> (force, its slopes in position, velocity)."""
    arguments: FloatArray
    """What the law receives as `parameters`, shape (n,)."""
    direction: FloatArray
    """Row over the generalised coordinates along which the force acts, shape (n_coordinate,)."""
    coordinate: FloatArray
    """Row over the generalised coordinates that the law sees, shape (n_coordinate,)."""
    load: FloatArray
    """Row over the torques that the transmissions pass (joint side), shape (n_axis,)."""
    n_state: int
    """Length of the law's own state."""
    label: str
    """How messages call it."""

    def braked_motor(self, n_axis: int) -> int:
        """Axis of the motor that the law brakes before the gear, which passes none of it; -1 where it brakes none."""
        (there,) = np.nonzero(self.direction)
        alone = len(there) == 1 and there[0] < n_axis and self.direction[there[0]] == 1.0
        return int(there[0]) if alone else -1


@dataclass(frozen=True, eq=False)
class SignalTerm:
    """A law on one channel of one axis."""

    law: Law
    """(signal, angle, speed, state, next_state, parameters, step) -> signal."""
    arguments: FloatArray
    """What the law receives as `parameters`, shape (n,)."""
    axis: int
    """Index of the axis."""
    channel: str
    """One of `CHANNELS`."""
    n_state: int
    """Length of the law's own state."""
    initial: FloatArray | None
    """State at the start, shape (n_state,); zeros where None."""
    label: str
    """How messages call it."""
