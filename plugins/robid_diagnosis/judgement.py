"""How much torque models leave in data that they were not fitted to: experiments of the role test, where there are any.

Else each configuration in turn is left out of the fit (`held_out.py`), and where that cannot be told, it is the data of
the fit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core import ComplexArray, DataRejected, FloatArray, PredictionErrors, Record, Robot
from robid_core.residual import TorqueProblem, linearise_at
from robid_diagnosis.comparison import errors_of_models, still_axes
from robid_diagnosis.held_out import held_out_residuals, unweighted, with_unused
from robid_diagnosis.hypothesis import Case, Fitted
from robid_diagnosis.steps import Outcome


def parted(records: Sequence[Record]) -> tuple[tuple[Record, ...], tuple[Record, ...]]:
    """Return what a diagnosis may look at, and the experiments of the role test.

    Raises DataRejected where all are tests, or what is left has no shape.
    """
    training, tests = list[Record](), list[Record]()
    for record in records:
        test = record.run.test
        if test is None or not test.any():
            training.append(record)
            continue
        tests.append(record if test.all() else record.part(test))
        if not test.all():
            training.append(record.part(~test))
    if not training:
        raise DataRejected("all experiments have the role test, and a diagnosis looks at none of them")
    return tuple(training), tuple(tests)


def errors_of(
    case: Case,
    tests: tuple[Record, ...],
    robot: Robot,
    outcome: Outcome,
    generator: np.random.Generator,
) -> tuple[tuple[PredictionErrors, ...], FloatArray]:
    """Torque that each model leaves where it was not fitted, and what the last gains, an interval (2,).

    Experiments are drawn again for the intervals.
    """
    models = outcome.models
    where, power, left, noise = _judged(case, tests, list(models.values()))
    runs = [run for record in tests or case.records for run in record.runs]
    error = {name: _sums(one) for name, one in zip(models, left, strict=True)}
    rows, gain = errors_of_models(
        f"torque that the model leaves in {where}, all bins but the mean",
        runs[0].channel("motor_torque").unit_symbol,
        error,
        power,
        len(power) / 2,  # a bin stands for its mirror image, too
        case.records[0],
        still_axes(robot, tests or case.records),
        generator,
        noise,
    )
    return tuple(rows), gain


def _judged(
    case: Case, tests: tuple[Record, ...], models: Sequence[Fitted]
) -> tuple[str, FloatArray, list[list[ComplexArray]], FloatArray]:
    """In which data; the power of their torque, (n_experiment, n_axis); what each model leaves in their blocks.

    And the power that noise alone would leave there, of the last model, (n_axis,).
    """
    last = models[-1]
    if tests:
        power = _torque_power(case.problem(models[0].hypothesis, tests))
        judged = [left_in(fitted, tests) for fitted in models]
        return "experiments of the role test", power, [left for left, _ in judged], judged[-1][1]
    power = _torque_power(models[0].problem)
    noise = noise_power(last.problem, last.point)
    held_out = [held_out_residuals(fitted) for fitted in models]
    known = [one for one in held_out if one is not None]
    if len(known) == len(models):
        part = "experiments" if len(last.about.rows) == 1 else "configurations"
        return f"{part} left out of its fit", power, known, noise
    left = [one.problem.counted_residuals(one.point) for one in models]
    return "the data of its fit", power, left, noise


def left_in(fitted: Fitted, records: tuple[Record, ...]) -> tuple[list[ComplexArray], FloatArray]:
    """Measured less predicted torque in records that were not fitted, N m, (n_config, n_exp, n_bin, n_axis) each.

    With the power that noise alone would leave, (n_axis,). What rings on from before the first sample is no error of
    the model, and is taken off.
    """
    problem, point = fitted.case.problem(fitted.hypothesis, records), fitted.point
    about = linearise_at(problem, point, fitted.model_error, improve=True)
    if any(robot.signals for robot in problem.robots(point)):  # along torques that the first round expects
        about = linearise_at(problem, point, fitted.model_error, improve=True)
    weighted = problem.weighted(point, about.weights)
    left = [unweighted(weight, own) for weight, own in zip(about.weights, weighted, strict=True)]
    return with_unused(left, about.weights, problem.residuals(point)), noise_power(problem, point)


def noise_power(problem: TorqueProblem, point: FloatArray) -> FloatArray:
    """Power that noise leaves in all experiments of a problem where the model is right, the mean left out, (n_axis,).

    With it what samples do not resolve of friction, as in the misfit.
    """
    size, total = problem.friction_size(point), np.zeros(problem.free.robot.n_axis)
    for block, robot in zip(problem.blocks, problem.robots(point), strict=True):
        counted = block.share.sum(axis=(0, 1)) * np.einsum("faa->fa", block.noise(robot, size)).real
        total += counted[1:, : len(total)].sum(axis=0)
    return total


def _torque_power(problem: TorqueProblem) -> FloatArray:
    """Power that counts of the measured torques, the mean left out, (n_experiment, n_axis)."""
    n_axis = problem.free.robot.n_axis
    return _sums([block.counted(block.measured)[..., :n_axis] for block in problem.blocks])


def _sums(spectra: Sequence[ComplexArray]) -> FloatArray:
    """Power of each experiment, the mean left out, (n_experiment, n_axis)."""
    return np.concatenate(
        [(np.abs(one[:, :, 1:]) ** 2).sum(axis=2).reshape(-1, one.shape[-1]) for one in spectra]
    )
