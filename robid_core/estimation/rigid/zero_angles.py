"""Whether an axis has its zero elsewhere than the robot file: gravity and moving inertia tell by how much.

A recorded joint angle that is off by x turns all bodies behind the axis by x. Where the rigid robot's torques at the
told values, friction free, do not fit the recorded ones, one angle after another is turned until they fit best. The
constant part of a torque counts here, since weight is most of what a zero changes. The angle is a number that is
fitted: a centre of mass that is told wrong may look the same, so it is no slip that a record could be refused for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from robid_core.estimation.rigid.mended import MODEL, explained, mends, shares
from robid_core.estimation.rigid.plausibility import FEW, NOTICED, TIE, Recorded

REVOLUTE = 0  # of `RigidTree.joint_type`
TURNS = 36  # angles that are tried before the best is refined
EXACT = 1e-4  # rad


@dataclass(frozen=True)
class Zero:
    """An axis whose recorded angle has a wrong zero."""

    axis: int
    angle: float
    """Recorded joint angle less the robot file's, rad."""
    before: float
    """Share of the torque that the robot leaves, rms, at the axis that it leaves most of; as recorded."""
    after: float
    """Likewise, once the angle is mended."""
    alone: bool
    """Whether only the torque of this axis tells, so that a constant in it would look the same."""
    explained: float
    """Logarithm of what is left less, over all axes."""


def zeros_in(recorded: Recorded) -> list[Zero]:
    """Return axes whose zero, told otherwise, makes a recording fit the robot: the likeliest, and any as likely.

    None where the recording fits already, or where no zero explains most of what is left.

    Parameters
    ----------
    recorded
        What was recorded, below the robot's first resonance.
    """
    before = shares(recorded)
    wrong = before > NOTICED
    if not wrong.any():
        return []
    few, found = recorded.thinned(FEW), list[Zero]()
    for axis, joint in enumerate(recorded.drives.arm.tolist()):
        if recorded.drives.tree.joint_type[joint] != REVOLUTE:
            continue
        angle = _best(few, recorded, axis)
        after = shares(turned(recorded, axis, -angle))
        if not mends(before, after):
            continue
        worst = int(np.argmax(before))
        alone = bool(wrong.sum() == 1 and worst == axis)
        rms = float(np.sqrt(before[worst])), float(np.sqrt(after[worst]))
        found.append(Zero(axis, angle, *rms, alone, explained(before, after)))
    most = max((zero.explained for zero in found), default=0.0)
    return sorted((zero for zero in found if zero.explained > most - TIE), key=lambda zero: -zero.explained)


def turned(recorded: Recorded, axis: int, angle: float) -> Recorded:
    """Return a recording with a joint angle turned, rad."""
    joints = angle * np.eye(recorded.drives.n_axis)[axis]
    return replace(recorded, position=recorded.position + np.linalg.solve(recorded.drives.gear, joints))


def _best(few: Recorded, recorded: Recorded, axis: int) -> float:
    """Angle, rad, by which an axis is most likely off."""

    def cost(angle: float, among: Recorded) -> float:
        return float(np.log(np.maximum(shares(turned(among, axis, -angle)), MODEL)).sum())

    step = 2 * np.pi / TURNS
    tried = step * (np.arange(TURNS) - TURNS // 2)
    start = float(tried[np.argmin([cost(angle, few) for angle in tried.tolist()])])
    found = scipy.optimize.minimize_scalar(
        lambda angle: cost(float(angle), recorded),
        bounds=(start - step, start + step),
        method="bounded",
        options={"xatol": EXACT},
    )
    return float(found.x)
