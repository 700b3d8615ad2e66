"""How late the torque of each axis is, and how sure that is where the model lacks something.

A delay turns the phase of a torque in proportion to the frequency. Beside noise alone its formal error holds. What a
model lacks (friction that curves, ripple) bends the estimate: then each experiment and each part of the band is left
out in turn, and what that moves is the error. A delay of the channels moves little; what friction puts into the place
of one is another in every part.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy

from robid_core import BoolArray, FloatArray, Timing
from robid_core.estimation.intervals import jackknife_shifts
from robid_core.residual import Linearisation, TorqueProblem
from robid_diagnosis.hypothesis import Fitted
from robid_diagnosis.trials import DOUBTFUL
from robid_diagnosis.wording import SURE

BANDS = 4  # parts of the band, each of a quarter of what is known of the delays
LATE = 0.1  # of a sample: a delay that is told
IMPLAUSIBLE = 3.0  # standard deviations of its prior, of a sample: no delay where the model lacks something


def timing_of(final: Fitted) -> Timing:
    """How late the torque of each axis is, in samples of the first block; half of a hold that is counted is in it."""
    problem = final.problem
    motion = problem.blocks[0].motion
    covariance = final.solution.covariance.diagonal()[-problem.n_delay :]
    variance = covariance + (_moved(problem, final) if final.misfit > DOUBTFUL else 0.0)
    return Timing(
        problem.free.robot.axis_names,
        motion.sample_time_s,
        (problem.delay(final.point) - 0.5 * (final.case.torque_held_s or 0.0)) / motion.sample_time_s,
        np.sqrt(variance) / motion.sample_time_s,
    )


def is_late(lag: float, error: float) -> bool:
    """Whether a lag, samples, is large enough and sure enough to be told."""
    return abs(lag) > LATE and abs(lag) > SURE * error


def late_axes(timing: Timing) -> str:
    """Axes whose torque is late by what is worth telling, with their lags; empty where there are none."""
    rows = zip(timing.axis_names, timing.lag, timing.standard_error, strict=True)
    return ", ".join(f"{axis} {value:.3f} samples" for axis, value, sd in rows if is_late(value, sd))


def timing_lines(timing: Timing, misfit: float, held_s: float | None = None) -> list[str]:
    """Delays between the channels of each axis that are worth telling, and those that data do not tell.

    `misfit` is what the model leaves: much above one, a delay that is larger than any channel's is the model's. What a
    hold of `held_s` makes is no delay of the channels.
    """
    found, doubted, late = list[str](), list[str](), [0.0] * len(timing.lag)
    lag = timing.lag + 0.5 * (held_s or 0.0) / timing.sample_time_s
    rows = zip(timing.axis_names, lag, timing.standard_error, strict=True)
    for number, (axis, value, sd) in enumerate(rows):
        if abs(value) <= LATE:
            continue
        if misfit > DOUBTFUL and (abs(value) > IMPLAUSIBLE or not is_late(value, sd)):
            doubted.append(f"{axis} ({value:.2g} ± {sd:.1g} samples)")
        elif is_late(value, sd):
            way = "lags" if value > 0 else "leads"
            late[number] = float(value * timing.sample_time_s)
            torque = "the torque of " if not found else ""
            found.append(f"{torque}{axis} {way} its angle by {abs(value):.3f} ± {sd:.1g} samples")
    if found:
        found = [
            f"Timing: {', '.join(found)}.",
            "Timing: the extended robot does not contain that, and predicts this recording without it, unless the "
            f"channel map takes it off: motor_torque: {{delay_s: [{', '.join(f'{one:.4g}' for one in late)}]}}.",
        ]
    if doubted:
        found.append(
            f"Timing: a delay of the torque cannot be distinguished from what the model lacks: {', '.join(doubted)}."
        )
    return found


def held_torque_line(held_s: float | None, sample_time_s: float) -> str:
    """Say that torques were found to be held for a part of a sample; empty where they were not."""
    if held_s is None:
        return ""
    times = round(sample_time_s / held_s)
    if times == 1:
        return (
            "Timing: the torques fit as those that a controller holds from sample to sample, and are counted so, where "
            "continuous ones are stated. State torque_hold: zero_order_hold where the recording is read."
        )
    return (
        f"Timing: the torques fit as those of a controller that is {times} times as fast as the recording and holds "
        f"each for {1e3 * held_s:.4g} ms, and are counted so. The channel map counts it: motor_torque: "
        f"{{held_s: {held_s:.4g}}}."
    )


def delayed(torque: FloatArray, lag: FloatArray) -> FloatArray:
    """Torques (n_lane, n_sample, n_axis) by so many samples later, (n_axis,), between the samples by cubic splines."""
    shifted = (
        scipy.ndimage.shift(own, (0.0, late), order=3, mode="nearest")
        for own, late in zip(np.moveaxis(torque, -1, 0), lag, strict=True)
    )
    return np.stack(list(shifted), axis=-1)


def moved_delays(problem: TorqueProblem, about: Linearisation, weighted: list[FloatArray]) -> FloatArray:
    """Variance of each delay, s^2, (n_delay,): by what leaving out experiments, and parts of the band, moves.

    Parameters
    ----------
    problem
        Its unknowns end with the delays.
    about
        Weighted derivatives at the minimum.
    weighted
        Residuals there, (n_config, n_exp, n_row) of each block.
    """
    n_delay = problem.n_delay
    variance = np.zeros(n_delay)
    for parts in (_experiments(about, weighted), _bands(problem, about, weighted)):
        matrices, gradients = (np.stack(one) for one in zip(*parts, strict=True))
        if len(matrices) > 1:
            shifts = jackknife_shifts(about.whole, gradients, matrices)[:, -n_delay:]
            n_part = len(shifts)
            variance += (n_part - 1) * shifts.var(axis=0)
    return variance


def _moved(problem: TorqueProblem, final: Fitted) -> FloatArray:
    return moved_delays(problem, final.about, problem.weighted(final.point, final.about.weights))


Part = tuple[FloatArray, FloatArray]
"""Normal equations of a part of the data, (n_unknown, n_unknown), and its gradient, (n_unknown,)."""


def _experiments(about: Linearisation, weighted: list[FloatArray]) -> Iterator[Part]:
    """Of each experiment."""
    groups = (own for block in weighted for own in block)
    for rows, residual in zip(about.rows, groups, strict=True):
        for own, left in zip(rows.reshape(len(residual), -1, rows.shape[-1]), residual, strict=True):
            yield own.T @ own, own.T @ left


def _bands(problem: TorqueProblem, about: Linearisation, weighted: list[FloatArray]) -> list[Part]:
    """Of each part of the band, all experiments together."""
    n_unknown, n_axis = problem.n_unknown, problem.free.robot.n_axis
    found = [(np.zeros((n_unknown, n_unknown)), np.zeros(n_unknown)) for _ in range(BANDS)]
    groups = (own for block in weighted for own in block)
    for rows, residual in zip(about.rows, groups, strict=True):
        shape = (len(residual), 2, -1, n_axis)
        by_bin = rows.reshape(*shape, n_unknown)
        for (matrix, gradient), bins in zip(found, _quarters(by_bin, problem.n_delay), strict=True):
            own = by_bin[:, :, bins].reshape(-1, n_unknown)
            matrix += own.T @ own
            gradient += own.T @ residual.reshape(shape)[:, :, bins].ravel()
    return found


def _quarters(rows: FloatArray, n_delay: int) -> Iterator[BoolArray]:
    """Bins of each part of the band, as much known of the delays in each.

    `rows` have shape (n_exp, 2, n_bin, n_axis, n_unknown).
    """
    known = (rows[..., -n_delay:] ** 2).sum(axis=(0, 1, 3))
    share = (known / np.maximum(known.sum(axis=0), 1e-300)).sum(axis=1)
    part = np.minimum(BANDS * np.cumsum(share) / max(share.sum(), 1e-300), BANDS - 1e-9).astype(int)
    return (part == number for number in range(BANDS))
