"""Whether an axis moves with another motor, which the robot file does not say: a coupled wrist, or a belt along an arm.

A motor in front of a joint drives the next one through it, so that the next joint turns by the angle of the first one,
one way or the other, while its own motor stands still. Bodies then move otherwise than the file says, and torques of
one motor act at the other. Both follow from the coupling without a number that could be fitted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robid_core.estimation.rigid.mended import explained, mends, shares
from robid_core.estimation.rigid.plausibility import NOTICED, Recorded
from robid_core.estimation.rigid.zero_angles import REVOLUTE

WRIST = 3  # last axes, of which any may be coupled with any; of the others neighbours


@dataclass(frozen=True)
class Coupling:
    """A joint that moves with the motor of another axis."""

    axis: int
    """Whose joint moves."""
    motor: int
    """Axis of that motor."""
    sign: int
    """The joint turns as the other one does (1), or against it (-1)."""
    before: float
    """Share of the torque that the robot leaves, rms, at the axis that it leaves most of; as its file says."""
    after: float
    """Likewise, with the coupling."""
    explained: float
    """Logarithm of what is left less, over all axes."""


def coupling_in(recorded: Recorded) -> Coupling | None:
    """Return the coupling with which a recording fits the robot best; None where it fits already, or with none.

    Parameters
    ----------
    recorded
        What was recorded, below the robot's first resonance.
    """
    before, drives = shares(recorded), recorded.drives
    if not (before > NOTICED).any():
        return None
    worst, best = int(np.argmax(before)), None
    for axis, motor in _pairs(recorded):
        for sign in (1, -1):
            gear = drives.gear.copy()
            gear[axis, motor] = sign * gear[motor, motor]
            after = shares(replace(recorded, drives=replace(drives, gear=gear)))
            gain = explained(before, after)
            if mends(before, after) and (best is None or gain > best.explained):
                rms = float(np.sqrt(before[worst])), float(np.sqrt(after[worst]))
                best = Coupling(axis, motor, sign, *rms, gain)
    return best


def _pairs(recorded: Recorded) -> Iterator[tuple[int, int]]:
    """Axes that may be coupled and are not: whose joint, and whose motor."""
    drives = recorded.drives
    turning = [a for a in range(drives.n_axis) if drives.tree.joint_type[drives.arm[a]] == REVOLUTE]
    for axis in turning:
        for motor in turning:
            near = abs(axis - motor) == 1 or min(axis, motor) >= drives.n_axis - WRIST
            if axis != motor and near and drives.gear[axis, motor] == 0:
                yield axis, motor
