"""Which recorded torques fit a robot only times a number: torque constants, percents of a rating, currents."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.estimation.rigid.plausibility import GAIN, LEFT, NOTICED, Recorded

FAR = 4 / 3  # factor on a torque, or its inverse
OTHERS = 1.2  # likewise, of the axes beside it
ONE = 1.3  # largest over smallest factor of torques that share one
MANY = 2.0  # factor, or its inverse, of all torques, each another one: a load raises some by less
LEAST = 1e-6  # factor: less is of the other sign, or no torque
WILD = 10.0  # likewise, of which nothing that is left is asked for: friction is as far off


@dataclass(frozen=True)
class Scale:
    """A recorded torque that differs from the robot's by a factor far from 1."""

    axis: int
    factor: float
    """Recorded torque over that of the rigid robot."""
    before: float
    """Share of the torque that the robot leaves, rms."""
    after: float
    """Likewise, once the torque is divided by the factor."""


def scales_in(recorded: Recorded) -> list[Scale]:
    """Return the torque, or all torques, that fit the robot only times a number that is off by more than `FAR`.

    A scale has a number that is fitted, and a body or rotor that is told wrong by as much looks the same; so it is no
    slip that a record could be refused for. A load that nobody told raises several torques, each by another factor, and
    then nothing is returned: only one axis beside others that fit, one factor for all, or factors of all axes that no
    load explains (currents, percents of a rating).
    """
    fitted = [recorded.scaled(a) for a in range(recorded.drives.n_axis)]
    factor = np.maximum([one for one, _ in fitted], 1e-9)
    before, after = recorded.left, np.array([share for _, share in fitted])
    apart = np.maximum(factor, 1 / factor)
    far = apart > FAR
    telling = far & (before > NOTICED) & (after < np.minimum(before / GAIN, LEFT))
    together = bool(far.all()) and factor.max() < ONE * factor.min()
    others_fit = apart[~telling].max(initial=1.0) < OTHERS
    each = bool(
        (factor.min() > MANY or (factor.max() < 1 / MANY and factor.min() > LEAST))
        and np.median(before) > NOTICED
        and ((after < LEFT).all() or (apart > WILD).all())
    )
    if each:
        telling[:] = True
    if not (together or each or (telling.sum() == 1 and others_fit)):
        return []
    return [
        Scale(int(a), float(factor[a]), float(np.sqrt(before[a])), float(np.sqrt(after[a])))
        for a in np.flatnonzero(telling)
    ]
