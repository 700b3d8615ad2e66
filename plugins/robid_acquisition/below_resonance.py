"""Motion and torque of a record below the robot's first resonance, where the arm moves as a rigid one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid_core import DenseRun, FloatArray, Record, RobidError, Robot
from robid_core.estimation.rigid.plausibility import Recorded
from robid_core.estimation.rigid.spring_model import spring_resonances
from robid_core.residual import rigid_drives

CHANNELS = ("motor_position", "motor_torque")
BELOW = 0.5  # of the lowest resonance: there the arm moves as a rigid one
HIGHEST_HZ = 10.0  # band that is looked at, where springs do not limit it
OF_RATE = 0.1  # of the sampling rate, likewise
PERIODS = 4  # of the band's edge: a shorter experiment is not looked at
SLOWEST_HZ = 2.0  # resonances below are pendulums, not springs


def recorded_below(record: Record, robot: Robot) -> Recorded | None:
    """Motion and torque below the robot's first resonance; None where no experiment is long enough."""
    cutoff = cutoff_of(record, robot)
    experiments = long_experiments(record, cutoff)
    if not experiments:
        return None
    return Recorded.of_experiments(rigid_drives(robot), experiments, record.runs[0].sample_time_s, cutoff)


def long_experiments(record: Record, cutoff: float) -> list[tuple[FloatArray, FloatArray]]:
    """Return the experiments that are long enough to be looked at."""
    step = record.runs[0].sample_time_s
    return [one for one in _experiments(record) if len(one[0]) * step * cutoff > PERIODS]


def cutoff_of(record: Record, robot: Robot, sample_time: float | None = None) -> float:
    """Edge of the band in which the robot is as good as rigid, Hz; with another time between samples than recorded."""
    highest = min(HIGHEST_HZ, OF_RATE / (sample_time or record.runs[0].sample_time_s))
    try:
        resonances = spring_resonances(robot.mechanism, robot.spring_arrays()[0], record.angle[0])
    except (RobidError, ArithmeticError, np.linalg.LinAlgError):
        return highest
    springs = resonances[resonances > SLOWEST_HZ]
    return float(min(highest, BELOW * springs.min())) if len(springs) else highest


def left_of_experiments(record: Record, robot: Robot) -> dict[tuple[int, int, int], FloatArray]:
    """Return the share of each torque's variance that the robot leaves in each experiment that can tell, (n_axis,)."""
    cutoff, found = cutoff_of(record, robot), dict[tuple[int, int, int], FloatArray]()
    if len(record.runs) != 1:
        return found
    step, drives = record.run.sample_time_s, rigid_drives(robot)
    for place, one in _experiments_by_place(record.run):
        if len(one[0]) * step * cutoff > PERIODS:
            try:
                found[place] = Recorded.of_experiments(drives, [one], step, cutoff).left
            except (RobidError, ArithmeticError):
                continue
    return found


def _experiments(record: Record) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Motor angle and torque of every whole experiment, periods joined, (n_sample, n_axis) each."""
    for run in record.runs:
        if run.sample_time_s != record.runs[0].sample_time_s:
            continue
        for _, pair in _experiments_by_place(run):
            yield pair


def _experiments_by_place(
    run: DenseRun,
) -> Iterator[tuple[tuple[int, int, int], tuple[FloatArray, FloatArray]]]:
    """Likewise, of one run, with configuration, block and experiment."""
    if any(name not in run.channels for name in CHANNELS):
        return
    position, torque = (run.values(name) for name in CHANNELS)
    n_axis = position.shape[-1]
    for c, b, e in np.ndindex(*position.shape[:3]):
        pair = position[c, b, e].reshape(-1, n_axis), torque[c, b, e].reshape(-1, n_axis)
        if all(np.isfinite(one).all() for one in pair):
            yield (c, b, e), pair
