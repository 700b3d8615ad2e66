"""What models leave of the torque of each motor, over everything that it may be a function of.

Means over parts of a variable that hold equally many samples: noise is averaged away, a law shows its shape. How much
of the squared residual such means hold beyond chance says where to look: friction over speed, ripple over the turn,
springs and weights over angle and load, inertia over acceleration. Over time and frequency it is the size that counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from robid_core import FloatArray, IntArray, ResidualCurve
from robid_diagnosis.columns import Motion
from robid_diagnosis.hypothesis import Fitted

PARTS = 40
FEWEST = 25  # samples in a part
TURN = 2 * np.pi


def residual_curves(base: Fitted, final: Fitted, motion: Motion) -> tuple[ResidualCurve, ...]:
    """Curves of every axis.

    Parameters
    ----------
    base
        The told robot, its values fitted.
    final
        The robot that was found.
    motion
        About it.
    """
    robot = motion.robot
    before, after = _residuals(base), _residuals(final)
    independent = sum(
        2 * one.torque_spectrum[..., 0].size for one in (along.motion for along in motion.along)
    )
    found = []
    for a, axis in enumerate(robot.axis_names):
        unit = robot.parameter_unit(f"friction.{axis}.coulomb")
        left, rest = before[..., a], after[..., a]
        speed = np.concatenate([one.motion.rate(1)[..., a].ravel() for one in motion.along])
        for variable, values, signed, friction in _variables(motion, a, speed):
            parts, way = parts_of(values, signed), np.sign(speed) if friction else 1.0
            x, refitted, extended = (means_over(one, parts) for one in (values, way * left, way * rest))
            shares = _shares(way * left, parts, signed, independent)
            found.append(ResidualCurve(axis, variable, unit, x, refitted, extended, None, *shares))
        found.append(_over_time(motion, a, axis, unit, left, rest))
        found.append(_over_frequency(motion, a, axis, unit, base, final))
    return tuple(found)


def _residuals(fitted: Fitted) -> FloatArray:
    """Over time, all blocks and experiments one after another, N m, (n_value, n_axis)."""
    left = zip(fitted.problem.blocks, fitted.problem.counted_residuals(fitted.point), strict=True)
    parts = [block.motion.over_time(residual) for block, residual in left]
    return np.concatenate([part.reshape(-1, part.shape[-1]) for part in parts])


def _variables(motion: Motion, axis: int, speed: FloatArray) -> Iterator[tuple[str, FloatArray, bool, bool]]:
    """Names with units, values at all samples, (n_value,), whether a sign turns them round, and whether it is friction.

    Friction is what acts with the sign of the speed, (n_value,).
    """
    robot, along = motion.robot, motion.along
    slide = robot.parameter_unit(f"friction.{robot.axis_names[axis]}.viscous") == "N s/m"
    unit, force = ("m", "N") if slide else ("rad", "N m")

    def joined(parts: Sequence[FloatArray]) -> FloatArray:
        return np.concatenate([part.ravel() for part in parts])

    angle = joined([one.motion.angle[..., axis] for one in along])
    where = joined([robot.joint_angle(one.motion.angle)[..., axis] for one in along])
    weigh, loads = robot.drives.gear[:, axis], []
    for one in along:
        finer = one.along.position.shape[1] // one.motion.angle.shape[2]
        loads.append(one.load_of(weigh)[:, ::finer])
    load, place = joined(loads), f"{'position' if slide else 'joint angle'}, {unit}"
    yield f"motor speed, {unit}/s", speed, True, False
    yield (
        f"motor acceleration, {unit}/s²",
        joined([one.motion.rate(2)[..., axis] for one in along]),
        True,
        False,
    )
    if not slide:
        yield "angle of the motor within a turn, rad", np.mod(angle, TURN), False, False
    yield place, where, False, False
    yield f"load of the gear, {force} at the motor", load, True, False
    yield f"friction over {place}", where, False, True
    yield f"friction over size of the load, {force} at the motor", np.abs(load), False, True


def parts_of(values: FloatArray, signed: bool) -> list[IntArray]:
    """Numbers of the samples of each part, in the order of the variable; signed ones are alike on both sides of zero.

    No part holds fewer than FEWEST.
    """
    n = max(1, min(PARTS, len(values) // FEWEST))
    if not signed:
        return list(np.array_split(np.argsort(values, kind="stable"), n))
    sizes = np.abs(values)
    ends = np.quantile(sizes, np.linspace(0, 1, n // 2 + 1))
    numbers = np.clip(np.searchsorted(ends, sizes, side="right") - 1, 0, len(ends) - 2)
    places = np.where(values < 0, -1 - numbers, numbers)
    found = (np.flatnonzero(places == place) for place in range(-len(ends) + 1, len(ends) - 1))
    return [part for part in found if len(part) >= FEWEST]


def means_over(values: FloatArray, parts: Sequence[IntArray]) -> FloatArray:
    """Mean of each part."""
    return np.array([values[part].mean() for part in parts])


def _shares(
    residual: FloatArray, parts: Sequence[IntArray], signed: bool, independent: int
) -> tuple[float, float, float]:
    """Share of the squared residual that means of parts hold, odd and even ones, less what chance gives.

    The residual has so many independent numbers.
    """
    whole = float((residual**2).sum())
    if not whole > 0:
        return float("nan"), float("nan"), float("nan")
    means, sizes = means_over(residual, parts), np.array([len(part) for part in parts])

    def beyond_chance(power: float, n_part: int) -> float:
        return max(power / whole - n_part / independent, 0.0)

    share = beyond_chance(float(sizes @ means**2), len(parts))
    if not signed or len(parts) % 2:
        return share, float("nan"), float("nan")
    odd, even = 0.5 * (means - means[::-1]), 0.5 * (means + means[::-1])
    half = len(parts) // 2
    return share, beyond_chance(float(sizes @ odd**2), half), beyond_chance(float(sizes @ even**2), half)


def _over_time(
    motion: Motion, number: int, axis: str, unit: str, left: FloatArray, rest: FloatArray
) -> ResidualCurve:
    """Sizes over the time of an experiment, of all blocks as long as the shortest."""
    shapes = [one.motion.angle.shape for one in motion.along]
    n = min(shape[2] for shape in shapes)
    ends = np.cumsum([np.prod(shape[:3]) for shape in shapes])[:-1]

    def lanes(values: FloatArray) -> FloatArray:
        parts = zip(np.split(values, ends), shapes, strict=True)
        return np.concatenate([part.reshape(-1, shape[2])[:, :n] for part, shape in parts])

    torque = np.concatenate([one.motion.torque[..., number].ravel() for one in motion.along])
    parts = np.array_split(np.arange(n), max(1, min(PARTS, n // FEWEST)))
    sizes = (
        np.array([np.sqrt((lanes(values)[:, part] ** 2).mean()) for part in parts])
        for values in (left, rest, torque)
    )
    time = motion.along[0].motion.sample_time_s * np.array([part.mean() for part in parts])
    refitted, extended, measured = sizes
    return ResidualCurve(axis, "time in the experiment, s", unit, time, refitted, extended, measured)


def _over_frequency(
    motion: Motion, number: int, axis: str, unit: str, base: Fitted, final: Fitted
) -> ResidualCurve:
    """Amplitudes over frequency, of the first block's bins."""
    block = motion.along[0].block
    bins = block.motion
    frequency = bins.frequency_hz[1:]
    edges = np.geomspace(frequency[0], frequency[-1] * 1.001, PARTS + 1)
    parts = [np.flatnonzero((frequency >= low) & (frequency < high)) for low, high in pairwise(edges)]
    parts = [part for part in parts if len(part)]
    refitted, extended, measured = (
        np.array([np.sqrt(2 * (np.abs(values[:, :, 1:, number][:, :, part]) ** 2).mean()) for part in parts])
        for values in (
            base.problem.counted_residuals(base.point)[0],
            final.problem.counted_residuals(final.point)[0],
            block.counted(bins.torque_spectrum),
        )
    )
    where = np.array([frequency[part].mean() for part in parts])
    return ResidualCurve(axis, "frequency, Hz", unit, where, refitted, extended, measured)
