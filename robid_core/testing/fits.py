"""What a fit owes: the parameters of a known plant within what it states, nearer than it began, as often as it says.

The plant is the example robot with some of the parameters that the stage estimates changed by a fifth; the stage is
told the unchanged robot and measures the plant.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from robid_core.artifacts import Artifact, Fit, Frf, Record
from robid_core.errors import RobidError
from robid_core.robot import Robot
from robid_core.stage import Estimator
from robid_core.testing.broken import ContractBroken
from robid_core.testing.inputs import example_frf, example_record
from robid_core.testing.known_plant import made_of

Data = Callable[[Robot, int], Mapping[type[Artifact], Artifact]]
"""What a plant gives, with noise of a seed."""

CHANGE = 1.2  # of springs, dampers, friction and effects, up and down in turn
SMALL_CHANGE = 1.05  # of what a fit may believe to be known: bodies, rotors, gears
CHANGED_KINDS = ("stiffness", "damping", "friction", "effect")
SAME = 1e-6  # relative: a number of the table, and that of the robot made of it
ERRORS = 6.0  # standard errors that an estimate may be off, beside the tolerance
TOLD = 0.25  # standard error over change, from which a parameter counts as told by the data
REPETITIONS = 16
# Of fits with noise of their own the mean squared error over the stated variance follows chi-square, by as many degrees
# of freedom as there are independent numbers; between its quantiles for standard errors a fifth too small and twice
# too large. `passes_with` says how often that is wrong.
CHANCE = 0.01
LARGEST_RATIO, SMALLEST_RATIO = 1.2, 1 / 2


@dataclass(frozen=True)
class KnownPlant:
    """The robot that a stage is told, the one that is measured, and the parameters in which they differ."""

    told: Robot
    measured: Robot
    names: tuple[str, ...]


def check_recovers_parameters(
    stage: Estimator, robot: Robot, data: Data | None, tolerance: float, repetitions: int = REPETITIONS
) -> None:
    """Check that a fit finds a known plant, and that its standard errors are about those of its estimates.

    Halves and fivefold ones are noticed; how surely, `passes_with` says.

    Parameters
    ----------
    stage
        The fit with its settings.
    robot
        What it is told.
    data
        What is measured of a plant; None: the examples.
    tolerance
        By how much an estimate may be off beside six standard errors, relative.
    repetitions
        Fits with noise of their own, for the standard errors; less than two: they are not checked.

    Raises
    ------
    ContractBroken
        With the parameter, what it is, what the fit says and where it began.
    """
    name = type(stage).__name__
    measure = data or functools.partial(_needed_data, stage)
    plant = known_plant(name, robot, fitted(stage, robot, measure(robot, 0)))
    fits = [fitted(stage, robot, measure(plant.measured, seed)) for seed in range(1, max(repetitions, 1) + 1)]
    told = [_check_estimates(name, plant, fit, tolerance) for fit in fits]
    if repetitions > 1:
        check_standard_errors(name, plant, fits, [one for one in told if one])


def known_plant(name: str, robot: Robot, fit: Fit) -> KnownPlant:
    """Return a plant that differs in what the fit estimates; ContractBroken where it names nothing of the robot."""
    known = robot.parameters()
    estimated = [one for one in _estimated(fit) if known.get(one, 0.0) != 0.0]
    wanted = [one for one in estimated if robot.parameter_kind(one) in CHANGED_KINDS]
    factor = CHANGE if wanted else SMALL_CHANGE
    values: dict[str, float] = {}
    for one in wanted or estimated:
        changed = {**values, one: known[one] * factor ** (1 if len(values) % 2 == 0 else -1)}
        try:
            robot.with_parameters(changed)
        except RobidError:  # a body that cannot be
            continue
        values = changed
    if not values:
        raise ContractBroken(
            f"{name}: it estimates no parameter that {robot.name} has a value of (it names "
            f"{', '.join(fit.parameters.names[:4]) or 'none'}); name parameters as Robot.parameters() does and what is "
            "free in Fit.free_names, give `artifacts` of which it can estimate some, or leave known plants out by "
            "`recovery=False`"
        )
    return KnownPlant(robot, robot.with_parameters(values), tuple(values))


def fitted(stage: Estimator, robot: Robot, data: Mapping[type[Artifact], Artifact]) -> Fit:
    """Run the stage on data with the robot that it is told."""
    needed = {
        entry.name: [data[entry.artifact]]
        for entry in stage.inputs()
        if entry.artifact in data and not (entry.optional and entry.artifact is not Record)
    }
    return made_of(stage, robot, needed, Fit)


def _needed_data(stage: Estimator, plant: Robot, seed: int) -> Mapping[type[Artifact], Artifact]:
    """Return of the examples those that the stage takes: a record is simulated."""
    makers: dict[type[Artifact], Callable[..., Artifact]] = {Record: example_record, Frf: example_frf}
    taken = {entry.artifact for entry in stage.inputs()}
    lacking = [entry for entry in stage.inputs() if not entry.optional and entry.artifact not in makers]
    if lacking:
        raise ContractBroken(
            f"{type(stage).__name__}: takes {lacking[0].noun}, of which the kit can measure none; give `artifacts`"
        )
    return {kind: make(plant, seed=seed) for kind, make in makers.items() if kind in taken}


def _estimated(fit: Fit) -> list[str]:
    table = fit.parameters
    known = np.isfinite(table.standard_error) & (table.standard_error > 0)
    named = (
        set(fit.free_names) if fit.free_names else {n for n, k in zip(table.names, known, strict=True) if k}
    )
    return [one for one in table.names if one in named]


def _check_estimates(name: str, plant: KnownPlant, fit: Fit, tolerance: float) -> tuple[str, ...]:
    """Check one fit; return the parameters that its data told."""
    table = fit.parameters
    if not fit.converged:
        raise ContractBroken(f"{name}: it does not converge with data of a known plant: {fit.status}")
    lost = [one for one in plant.names if one not in table.names]
    if lost:
        raise ContractBroken(f"{name}: with data of another plant it no longer determines {lost[0]}")
    told = []
    for one in plant.names:
        row = table.names.index(one)
        true, began = plant.measured.parameter(one), plant.told.parameter(one)
        estimate, error = float(table.estimate[row]), float(table.standard_error[row])
        says = f"{one} is {true:.5g} in the plant that was measured, and the fit says {estimate:.5g} ± {error:.2g}"
        if not np.isfinite(error) or error < 0:
            raise ContractBroken(f"{name}: {says}: state a standard error for what is free")
        if abs(estimate - true) > ERRORS * error + tolerance * abs(true):
            raise ContractBroken(
                f"{name}: {says}, more than {ERRORS:g} standard errors and {tolerance:.1%} off (it "
                f"started from {began:.5g})"
            )
        if error < TOLD * abs(true - began):
            told.append(one)
            if abs(estimate - true) > abs(began - true) / 2:
                raise ContractBroken(
                    f"{name}: {says}; that is hardly nearer than the {began:.5g} from which it started"
                )
    _check_model(name, plant, fit)
    return tuple(told)


def _check_model(name: str, plant: KnownPlant, fit: Fit) -> None:
    """Check that the robot that is stored, and predicted with, has the numbers of the table."""
    if fit.model is None:
        return
    robot = Robot.of_model(fit.model)
    for one in plant.names:
        kept, estimate = robot.parameter(one), fit.parameters.value(one)
        if not np.isclose(kept, estimate, rtol=SAME):
            raise ContractBroken(
                f"{name}: its table says that {one} is {estimate:.5g}, and the robot of its `model` has {kept:.5g}; "
                "make the model of the estimates (robot.model(values, names, covariance))"
            )


def check_standard_errors(name: str, plant: KnownPlant, fits: list[Fit], told: list[tuple[str, ...]]) -> None:
    """Check the scatter of independent fits against what they state, of all parameters that their data tell."""
    if len(told) < len(fits):
        raise ContractBroken(
            f"{name}: its data determine none of {', '.join(plant.names)}: every standard error is more than a quarter "
            "of the change that it should find; give `artifacts` that show what it estimates"
        )
    total, count = 0.0, 0.0
    for fit, names in zip(fits, told, strict=True):
        rows = [fit.parameters.names.index(one) for one in names]
        true = np.array([plant.measured.parameter(one) for one in names])
        off = (fit.parameters.estimate[rows] - true) / fit.parameters.standard_error[rows]
        freedom = _degrees_of_freedom(fit, names)
        total += freedom * float(np.mean(off**2))
        count += freedom
    rms = np.sqrt(total / count)
    lowest, highest = _limits(count)
    if total > highest:
        raise ContractBroken(
            f"{name}: over {len(fits)} fits with noise of their own estimates are {rms:.3g} stated standard errors off "
            "(root mean square; 1 is right): the standard errors are too small, or the estimates biased"
        )
    if total < lowest:
        raise ContractBroken(
            f"{name}: over {len(fits)} fits with noise of their own estimates are only {rms:.2g} stated standard "
            "errors off (root mean square; 1 is right): the standard errors are too large"
        )


def passes_with(factor: float, freedom: float) -> float:
    """Return how probably standard errors that are so many times the right ones pass, without a bias.

    16 fits give 16 degrees of freedom for one parameter, about 32 for four that go together in pairs. Right ones are
    blamed once in ten thousand; half of them pass at 22 and 4 % of the seeds, a tenth or ten times of them at none.

    >>> [f"{1 - passes_with(1.0, freedom):.1g}" for freedom in (16, 32)]
    ['0.0001', '1e-05']
    >>> [f"{passes_with(0.5, freedom):.2g}" for freedom in (16, 32)]
    ['0.22', '0.037']
    >>> [f"{passes_with(factor, 16):.1g}" for factor in (0.1, 3, 5, 10)]
    ['2e-10', '0.7', '0.003', '7e-23']
    """
    from scipy.stats import chi2

    lowest, highest = _limits(freedom)
    return float(chi2.sf(lowest * factor**2, freedom) - chi2.sf(highest * factor**2, freedom))


def _limits(freedom: float) -> tuple[float, float]:
    """Return between what the sum of squares is taken for right."""
    from scipy.stats import chi2

    lowest, highest = chi2.ppf([CHANCE, 1 - CHANCE], freedom)
    return float(lowest) * SMALLEST_RATIO**2, float(highest) * LARGEST_RATIO**2


def _degrees_of_freedom(fit: Fit, names: tuple[str, ...]) -> float:
    """Return how many independent numbers have the scatter of this mean square: n^2 / sum(rho^2), 1 at the least.

    The variance of a sum of squares of correlated normal numbers is 2 sum(rho^2) (Satterthwaite).
    """
    if len(fit.covariance) != len(fit.free_names) or not set(names) <= set(fit.free_names):
        return 1.0
    correlation = fit.correlation(names)
    size = float((correlation**2).sum())
    return max(len(names) ** 2 / size, 1.0) if np.isfinite(size) and size > 0 else 1.0
