"""What a frequency response estimator owes: the plant without noise, and its own uncertainty with noise."""

from __future__ import annotations

import functools
import warnings
from typing import Any

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import Frf, Record
from robid_core.estimation.response.covariance import confidence_radius
from robid_core.robot import Robot
from robid_core.run.arguments import arguments_of
from robid_core.stage import Context, FrfEstimator
from robid_core.testing.broken import ContractBroken
from robid_core.testing.lending import example_context
from robid_core.testing.plants import LINES, MassSpringPlant, plant_record
from robid_core.testing.robots import example_robot

# Signals are exact to rounding: 1e-16 relative in the samples, times sqrt(n_sample) ~ 30 in the DFT, times the
# spread of position amplitudes over the band, (79 / 21)^2 * |G|max / |G|min ~ 1e4, times cond(U) = 1. That is 1e-11;
# an estimator that smooths or iterates may be a thousand times worse and is still exact.
EXACT = 1e-8

REPETITIONS = 6
CONFIGURATIONS = 50
LEVEL = 0.95


def estimate(
    stage: FrfEstimator, plant: MassSpringPlant, damping_deviation: float | None = None, **of_record: Any
) -> tuple[Record, Frf]:
    """Run an estimator on a record of a closed-form plant, made by `plant_record` with the arguments `of_record`.

    An estimator that asks for the robot gets `example_robot` of as many axes: its controller, which is in the
    loop of the record, is known to it; its mechanics is not that of the plant.
    """
    lent = stage.lends()
    robot = _robot(plant.n_axis) if Robot in lent.values() else None
    record = plant_record(plant, robot=robot, **of_record)
    if damping_deviation is not None:
        shape = (len(record.angle), len(record.frequency_hz), plant.n_axis)
        record = record.replace(damping_deviation=np.full(shape, damping_deviation))
    needed = {entry.name: [record] for entry in stage.inputs() if not entry.optional}
    arguments: dict[str, Any] = {**arguments_of(stage, needed, example_context().log)}
    for name, kind in lent.items():
        if kind is Context:
            arguments[name] = example_context()
        elif kind is Robot:
            arguments[name] = robot
    result = stage.run(**arguments)
    if not isinstance(result, Frf):
        raise ContractBroken(f"{type(stage).__name__}.run gives a {type(result).__name__}, not an Frf")
    return record, result


@functools.cache
def _robot(n_axis: int) -> Robot:
    return example_robot(n_axis)


def check_recovers_plant(stage: FrfEstimator, n_axis: int, tolerance: float = EXACT) -> None:
    """Check that a closed-form plant is recovered without noise, at nine in ten lines and to `tolerance`.

    Parameters
    ----------
    stage
        The estimator with its settings.
    n_axis
        Size of the plant.
    tolerance
        Largest error of an entry, relative to the largest entry at that line.
    """
    name = type(stage).__name__
    plant = MassSpringPlant.of(n_axis)
    record, frf = estimate(stage, plant)
    if frf.response.shape != (2, len(LINES), n_axis, n_axis):
        raise ContractBroken(
            f"{name}: response has shape {frf.response.shape}, not (2, {len(LINES)}, {n_axis}, {n_axis})"
        )
    if frf.axis_names != record.axis_names or not np.array_equal(frf.angle, record.angle):
        raise ContractBroken(f"{name}: axis names and configurations of the FRF are not those of the record")
    if not np.allclose(frf.frequency_hz, record.frequency_hz, rtol=1e-12, atol=0):
        raise ContractBroken(f"{name}: the frequencies are not those of the record, in Hz")
    if frf.valid_lines.mean() < 0.9:
        raise ContractBroken(
            f"{name}: {(~frf.valid_lines).mean():.0%} of the lines of a perfect record are masked"
        )
    truth = plant.response(frf.frequency_hz)
    error = np.abs(frf.response - truth).max(axis=(2, 3)) / np.abs(truth).max(axis=(1, 2))
    error[~frf.valid_lines] = 0
    if not error.max() <= tolerance:
        c, f = np.unravel_index(int(np.argmax(np.where(np.isnan(error), np.inf, error))), error.shape)
        raise ContractBroken(
            f"{name}: without noise the response of {n_axis} coupled masses is wrong by {error[c, f]:.2g} at "
            f"{frf.frequency_hz[f]:g} Hz (at most {tolerance:g}); is the output over the input, in rad/s^2 over N m, "
            "and entry [i, j] output i over input j?"
        )


def check_covers_truth(stage: FrfEstimator, n_axis: int = 2) -> bool:
    """Check that the stated uncertainty covers the truth as often as it says, over seeded repetitions.

    The error e of an entry is complex Gaussian with variance s^2, estimated with v degrees of freedom, so
    |e|^2 / s^2 follows F(2, 2 v) (`confidence_radius`). One line and one entry of each
    configuration count, so that the events are independent. The count must not fall below the 1e-4 quantile
    of a binomial at 93 % (2 % for what the approximations of an estimator cost), and the stated deviation must
    not be more than twice the scatter.

    Returns False, with a warning for the log of the test, where the estimator states no uncertainty.
    """
    name = type(stage).__name__
    plant = MassSpringPlant.of(n_axis)
    ratios, bounds = [], []
    for repetition in range(REPETITIONS):
        _, frf = estimate(stage, plant, n_config=CONFIGURATIONS, noise=0.02, seed=100 + repetition)
        if not frf.has_covariance:
            return False
        ratio, dof = _squared_errors(frf, plant)
        ratios.append(ratio)
        bounds.append(confidence_radius(np.ones(len(dof)), dof, LEVEL) ** 2)
    ratio, bound = np.concatenate(ratios), np.concatenate(bounds)
    if len(ratio) < REPETITIONS * CONFIGURATIONS * 0.9:
        raise ContractBroken(f"{name}: more than a tenth of the lines of a good record are masked")
    covered = int((ratio <= bound).sum())
    needed = _binomial_quantile(1e-4, len(ratio), LEVEL - 0.02)
    if covered < needed:
        raise ContractBroken(
            f"{name}: the stated uncertainty covers the truth in {covered} of {len(ratio)} cases, {LEVEL:.0%} is "
            f"claimed and less than {needed} is no chance: the covariance is too small"
        )
    if np.median(ratio / bound) < np.log(2) / 4 / -np.log(1 - LEVEL):
        raise ContractBroken(
            f"{name}: the stated standard deviation is more than twice the scatter: the covariance is too large"
        )
    return True


def check_hands_on_what_no_residual_shows(stage: FrfEstimator, n_axis: int = 2) -> None:
    """Check that an estimator that states an uncertainty hands on that of a compensation before it."""
    _, frf = estimate(stage, MassSpringPlant.of(n_axis), damping_deviation=0.01, noise=0.02, seed=99)
    if frf.has_covariance and (frf.damping_deviation is None or not np.allclose(frf.damping_deviation, 0.01)):
        raise ContractBroken(
            f"{type(stage).__name__}: the record's damping_deviation, which no residual shows, is not handed on: "
            "damping_deviation=record.damping_deviation_at(frequency_hz) in the Frf"
        )


def _squared_errors(frf: Frf, plant: MassSpringPlant) -> tuple[FloatArray, FloatArray]:
    """Return |e|^2 / s^2 and the degrees of freedom, for one line and entry of each configuration."""
    truth = plant.response(frf.frequency_hz)
    variance = frf.variance()
    n_freq, n_axis = len(frf.frequency_hz), plant.n_axis
    ratios, dofs = [], []
    for c in range(len(frf.angle)):
        line, out, into = (c * 7) % n_freq, c % n_axis, (c // n_axis) % n_axis
        if not frf.valid_lines[c, line]:
            continue
        error = abs(frf.response[c, line, out, into] - truth[line, out, into]) ** 2
        ratios.append(error / variance[c, line, out, into])
        dofs.append(np.inf if frf.degrees_of_freedom is None else frf.degrees_of_freedom[c, line])
    return np.array(ratios), np.array(dofs)


@functools.cache
def _binomial_quantile(probability: float, count: int, share: float) -> int:
    from scipy.stats import binom

    return int(binom.ppf(probability, count, share))


def note_missing_uncertainty(stage: FrfEstimator) -> None:
    """Warn that a clause could not be checked."""
    warnings.warn(
        f"{type(stage).__name__} states no covariance (Frf.output_covariance is None): that it covers the truth was "
        "not checked, and stages that weight lines will treat all alike",
        stacklevel=3,
    )
