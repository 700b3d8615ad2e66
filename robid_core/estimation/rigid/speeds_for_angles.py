"""Whether what stands for the angle of an axis is its speed.

The integral of the column is tried in its place. Where it begins is not known: each experiment may begin at the angle
that makes its torques fit best, found axis by axis among a turn of the joint. That is a number that is fitted, but one
for thousands of samples: it moves a weight, and makes no inertia of what is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.estimation.rigid.mended import Mended
from robid_core.estimation.rigid.plausibility import FITS, GAIN, LEFT, SPOILS, Recorded
from robid_core.estimation.rigid.rigid_torque import RigidDrives, motor_torque

Experiment = tuple[FloatArray, FloatArray]
FEW = 4  # experiments that are looked at, evenly: what holds for all shows in some
SAMPLES = 100  # of each, by which the angle is found that it begins at
TRIED = 12  # angles of an axis in a sweep over the axes
SPREADS = (1.0, 1.0, 1 / TRIED, 1 / TRIED**2)  # of the sweeps, in turns
MUCH = 1.0  # of a torque's variance: differentiated once too often, motion asks for more; a weight that lacks does not


def speeds_in(
    drives: RigidDrives, experiments: Sequence[Experiment], sample_time: float, cutoff_hz: float
) -> Mended | None:
    """Return the axes whose angle, integrated, makes a recording fit the robot; None where it fits, or none does.

    Parameters
    ----------
    drives
        The robot as its file says it is.
    experiments
        Motor angle and torque, (n_sample, n_axis) each, as recorded.
    sample_time
        Between two samples, s.
    cutoff_hz
        Below the robot's first resonance.

    Raises
    ------
    DataRejected
        If the cutoff is not below the Nyquist frequency, or an experiment is too short for it.
    """
    experiments = experiments[:: max(1, -(-len(experiments) // FEW))]
    recorded = Recorded.of_experiments(drives, experiments, sample_time, cutoff_hz)
    before, every = recorded.left, tuple(range(drives.n_axis))
    if before.max() < MUCH:
        return None
    wrong = before >= FITS
    alone = tuple(int(a) for a in np.flatnonzero(wrong))
    best = None
    for axes in dict.fromkeys((*((a,) for a in alone), alone, every if alone else ())):
        if not axes:
            continue
        moved = _begun(drives, _integrated(experiments, axes, sample_time), axes, sample_time, cutoff_hz)
        after = Recorded.of_experiments(drives, moved, sample_time, cutoff_hz).left
        gain = float(np.median(np.log(before[wrong] / np.maximum(after[wrong], 1e-9))))
        spoiled = (after[~wrong] > np.maximum(SPOILS * before[~wrong], FITS)).any()
        if gain < np.log(GAIN) or np.median(after[wrong]) > LEFT or spoiled:
            continue
        mended = Mended.of_shares(axes, before, after)
        if best is None or mended.explained > best.explained:
            best = mended
    return best


def _integrated(
    experiments: Sequence[Experiment], axes: Sequence[int], sample_time: float
) -> list[Experiment]:
    """Integrate the angles of some axes by trapezia, from zero on."""
    found = list[Experiment]()
    for position, torque in experiments:
        moved = np.array(position)
        means = 0.5 * (position[1:, list(axes)] + position[:-1, list(axes)])
        moved[0, list(axes)] = 0.0
        moved[1:, list(axes)] = sample_time * np.cumsum(means, axis=0)
        found.append((moved, torque))
    return found


def _begun(
    drives: RigidDrives,
    experiments: Sequence[Experiment],
    axes: Sequence[int],
    sample_time: float,
    cutoff_hz: float,
) -> list[Experiment]:
    """Move each experiment to the angles of these axes, rad at the joints, at which its torques fit best."""
    found = list[Experiment]()
    none = np.zeros(drives.n_axis)
    frictionless = replace(drives, viscous=none, coulomb=none, offset=none)
    tried = 2 * np.pi / TRIED * (np.arange(TRIED) - TRIED // 2)
    for position, torque in experiments:
        seen = Recorded.of_experiments(drives, [(position, torque)], sample_time, cutoff_hz).thinned(SAMPLES)
        power = np.maximum((seen.torque**2).mean(axis=0), 1e-300)

        def cost(joints: FloatArray, seen: Recorded = seen, power: FloatArray = power) -> float:
            moved = seen.position + np.linalg.solve(drives.gear, joints)
            rest = seen.torque - motor_torque(frictionless, moved, seen.velocity, seen.acceleration)
            return float(((rest**2).mean(axis=0) / power).sum())

        joints = np.zeros(drives.n_axis)
        for spread in SPREADS:
            for axis in axes:
                own = np.eye(drives.n_axis)[axis]
                around = 0.0 if spread == 1.0 else joints[axis]
                angles = around + spread * tried
                joints[axis] = 0.0
                joints[axis] = angles[np.argmin([cost(joints + angle * own) for angle in angles])]
        found.append((position + np.linalg.solve(drives.gear, joints), torque))
    return found
