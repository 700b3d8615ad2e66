"""Robots of variants by constants of the record: what was measured about a run (a payload, a supply) as a parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from robid_core.artifacts import DenseRun, Record
from robid_core.errors import DataRejected
from robid_core.residual.measured import parts_by_variant
from robid_core.robot import Robot

ALIKE = 1e-9  # of a constant: experiments of a variant that differ by more are not of one robot


def variant_robots(
    records: Sequence[Record], robot: Robot, robots: Mapping[str, str], constants: Mapping[str, str]
) -> tuple[Robot, dict[str, Robot]]:
    """Return the nominal robot and those of other variants, each with the constants of its experiments.

    Parameters
    ----------
    records
        What was measured; every experiment of a variant has one value of each constant.
    robot
        That of the first variant that is not in `robots`, and of those that differ from it by their constants only.
    robots
        Robot files of others, by variant.
    constants
        Name of a constant in the records to name of a parameter of the robot.

    Raises
    ------
    DataRejected
        If a record lacks a constant, or it is not known or not one number throughout a variant.
    ConfigurationError
        If a robot has no such parameter.
    """
    others = {variant: Robot.load(name) for variant, name in robots.items()}
    if not constants:
        return robot, others
    runs, nominal = dict[str, list[DenseRun]](), None
    for record in records:
        for variant, part in parts_by_variant(record):
            runs.setdefault(variant, []).extend(part.runs)
    for variant, measured in runs.items():
        values = {
            parameter: _value(np.concatenate([run.constant(name).ravel() for run in measured]), name, variant)
            for name, parameter in constants.items()
        }
        own = others.get(variant, robot).with_parameters(values)
        if variant in robots or nominal is not None:
            others[variant] = own
        else:
            nominal = own
    return nominal or robot, others


def _value(values: np.ndarray, name: str, variant: str) -> float:
    whose = f"variant {variant}" if variant else "the record"
    if not np.isfinite(values).all():
        raise DataRejected(f"constants: {name} is not known in all experiments of {whose}; fill in the table")
    if np.ptp(values) > ALIKE * np.abs(values).max():
        raise DataRejected(
            f"constants: {name} is {values.min():g} to {values.max():g} in {whose}; give experiments of another value "
            "another variant"
        )
    return float(values[0])
