"""How often the kit blames standard errors of fits: right ones hardly ever, halves and fivefold ones nearly always."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

from robid_core import Fit, ParameterTable
from robid_core.testing import ContractBroken, example_robot
from robid_core.testing.fits import REPETITIONS, KnownPlant, check_standard_errors


@pytest.mark.parametrize(("factor", "least", "most"), [(1.0, 0.98, 1.0), (0.5, 0.0, 0.12), (5.0, 0.0, 0.01)])
def test_standard_errors_of_correlated_parameters_are_judged_as_often_as_said(
    factor: float, least: float, most: float
) -> None:
    """Of 200 seeds; four estimates of which two pairs go together by 0.9, which is two degrees of freedom a fit."""
    robot = example_robot(2)
    names = tuple(robot.parameters())[:4]
    pair = np.array([[1.0, 0.9], [0.9, 1.0]])
    correlation = np.kron(np.eye(2), pair)
    true = np.array([robot.parameter(name) for name in names])
    errors = 1e-3 * np.abs(true)
    ones = np.ones(4, dtype=bool)
    plant = KnownPlant(robot, robot, names)
    draw, passed = np.random.default_rng(3), 0
    for _ in range(200):
        fits = []
        for off in draw.multivariate_normal(np.zeros(4), correlation, REPETITIONS):
            table = ParameterTable(
                names, ("1",) * 4, ("spring",) * 4, true, true + errors * off, factor * errors, ones, ~ones
            )
            fits.append(
                Fit("test", "ended", True, 1.0, 1, 1, table, correlation * np.outer(errors, errors), names)
            )
        with contextlib.suppress(ContractBroken):
            check_standard_errors("test", plant, fits, [names] * REPETITIONS)
            passed += 1
    assert least <= passed / 200 <= most
