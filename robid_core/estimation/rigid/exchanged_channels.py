"""Whether the angle of an axis stands where its torque should, and its torque where the angle should.

The columns are exchanged back, in the units that a channel map may have taken them for: radians or degrees, at the
motor or at the joint. No number is fitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid_core.estimation.rigid.mended import Mended, mends
from robid_core.estimation.rigid.plausibility import FITS, Recorded
from robid_core.estimation.rigid.rigid_torque import RigidDrives
from robid_core.estimation.rigid.speeds_for_angles import FEW, Experiment


def exchanged_in(
    drives: RigidDrives, experiments: Sequence[Experiment], sample_time: float, cutoff_hz: float
) -> Mended | None:
    """Return the axes whose angle and torque, exchanged, make a recording fit the robot; None where none do.

    Arguments and errors are those of `speeds_in`.
    """
    experiments = experiments[:: max(1, -(-len(experiments) // FEW))]
    before = Recorded.of_experiments(drives, experiments, sample_time, cutoff_hz).left
    wrong = [int(a) for a in np.flatnonzero(before >= FITS)]
    best = None
    for axes in dict.fromkeys(
        (*((a,) for a in wrong), tuple(wrong), tuple(range(drives.n_axis))) if wrong else ()
    ):
        for moved in _exchanged(drives, experiments, axes):
            after = Recorded.of_experiments(drives, moved, sample_time, cutoff_hz).left
            mended = Mended.of_shares(axes, before, after)
            if mends(before, after) and (best is None or mended.explained > best.explained):
                best = mended
    return best


def _exchanged(
    drives: RigidDrives, experiments: Sequence[Experiment], axes: Sequence[int]
) -> Iterator[list[Experiment]]:
    """Exchange angles and torques of some axes, whose numbers a map took for one of these units."""
    some = list(axes)
    turned = np.diag(drives.gear)[some]  # none where an axis is moved by the motors of others alone
    sides = (np.ones(len(some)), turned**-2.0) if turned.all() else (np.ones(len(some)),)
    for unit in (1.0, np.pi / 180):
        for side in sides:
            found = list[Experiment]()
            for position, torque in experiments:
                angle, driven = np.array(position), np.array(torque)
                angle[:, some] = unit * side * torque[:, some]
                driven[:, some] = position[:, some] / (unit * side)
                found.append((angle, driven))
            yield found
