"""What a prediction leaves of each axis over speed, position, predicted torque, time and order, by role of the run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robid_core import FloatArray, IntArray, PredictionCurve, Robot
from robid_diagnosis.residual_curves import FEWEST, PARTS, means_over, parts_of

TURN = 2 * np.pi
FEWEST_TURNS = 4.0  # of a motor: orders a quarter apart are told apart
ORDERS = np.arange(0.25, 20.01, 0.25)


@dataclass(frozen=True, eq=False)
class PredictedRun:
    """One experiment, compared, each (n_sample, n_axis)."""

    name: str
    tested: bool
    sample_time_s: float
    position: FloatArray
    """Of the motors."""
    measured: FloatArray
    predicted: FloatArray

    @property
    def left(self) -> FloatArray:
        """Measured less predicted."""
        return self.measured - self.predicted

    @property
    def speed(self) -> FloatArray:
        """Of the motors, by differences."""
        found: FloatArray = np.gradient(self.position, self.sample_time_s, axis=0)
        return found


def prediction_curves(
    runs: Sequence[PredictedRun], robot: Robot, quantity: str, unit: str
) -> tuple[PredictionCurve, ...]:
    """Curves of every axis; `quantity` is what was predicted, in a word, and `unit` its own."""
    found = list[PredictionCurve]()
    for a, axis in enumerate(robot.axis_names):
        for variable, values, signed in _variables(runs, robot, a, quantity, unit):
            left = np.concatenate([run.left[:, a] for run in runs])
            parts = parts_of(values, signed)
            x = means_over(values, parts)
            pair = [_means_of_role(runs, left, parts, tested) for tested in (False, True)]
            found.append(PredictionCurve(axis, variable, unit, x, *pair))
        found.append(_over_time(runs, a, axis, unit))
        found += _over_order(runs, a, axis, unit, robot)
    return tuple(found)


def _variables(
    runs: Sequence[PredictedRun], robot: Robot, axis: int, quantity: str, unit: str
) -> Iterator[tuple[str, FloatArray, bool]]:
    """Names with units, values at all samples, and whether a sign turns them round."""
    slide = _slides(robot, axis)
    length = "m" if slide else "rad"
    yield f"motor speed, {length}/s", np.concatenate([run.speed[:, axis] for run in runs]), True
    where = np.concatenate([robot.joint_angle(run.position)[:, axis] for run in runs])
    yield f"{'position' if slide else 'joint angle'}, {length}", where, False
    load = np.concatenate([run.predicted[:, axis] for run in runs])
    noun = "force" if unit == "N" else quantity
    yield f"predicted {noun}, {unit}", load, quantity == "torque"


def _slides(robot: Robot, axis: int) -> bool:
    return bool(robot.parameter_unit(f"friction.{robot.axis_names[axis]}.viscous") == "N s/m")


def _means_of_role(
    runs: Sequence[PredictedRun], left: FloatArray, parts: Sequence[IntArray], tested: bool
) -> FloatArray:
    mine = np.concatenate([np.full(len(run.left), run.tested == tested) for run in runs])
    kept = [part[mine[part]] for part in parts]
    return np.array([left[part].mean() if len(part) >= FEWEST else np.nan for part in kept])


def _over_time(runs: Sequence[PredictedRun], number: int, axis: str, unit: str) -> PredictionCurve:
    """Sizes over the time of a run, of all as long as the longest."""
    longest = max(len(run.left) * run.sample_time_s for run in runs)
    edges = np.linspace(0.0, longest, PARTS + 1)
    pair = []
    for tested in (False, True):
        power, count = np.zeros(PARTS), np.zeros(PARTS)
        for run in (one for one in runs if one.tested == tested):
            time = run.sample_time_s * np.arange(len(run.left))
            power += np.histogram(time, edges, weights=run.left[:, number] ** 2)[0]
            count += np.histogram(time, edges)[0]
        pair.append(np.sqrt(np.divide(power, count, out=np.full(PARTS, np.nan), where=count >= 1)))
    return PredictionCurve(axis, "time in the run, s", unit, 0.5 * (edges[1:] + edges[:-1]), *pair)


def _over_order(
    runs: Sequence[PredictedRun], number: int, axis: str, unit: str, robot: Robot
) -> Iterator[PredictionCurve]:
    """Amplitudes over waves in a turn of the motor; nothing of a motor that makes a few turns only.

    ``2 |sum_t r |v| exp(-i k q)| / sum_t |v|``: the mean over angles, not over times.
    """
    turning = [run for run in runs if np.ptp(run.position[:, number]) > FEWEST_TURNS * TURN]
    if not turning or _slides(robot, number):
        return
    pair = []
    for tested in (False, True):
        power, weight = np.zeros(len(ORDERS)), 0.0
        for run in (one for one in turning if one.tested == tested):
            size = np.abs(run.speed[:, number])
            wave = np.exp(-1j * np.outer(ORDERS, run.position[:, number]))
            power += np.abs(2 * wave @ (size * run.left[:, number])) ** 2 / size.sum()
            weight += float(size.sum())
        pair.append(np.sqrt(power / weight) if weight else np.full(len(ORDERS), np.nan))
    yield PredictionCurve(axis, "order, waves in a turn of the motor", unit, ORDERS, *pair)
