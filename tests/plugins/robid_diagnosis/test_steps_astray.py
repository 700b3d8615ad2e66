"""Passes that lead astray: what an unsettled fit returns was seen in a prescribed motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import FloatArray, Record, Robot
from robid_core.residual import TorqueProblem, linearise_at
from robid_core.residual.linear_fit import best_start
from robid_diagnosis.hypothesis import Addition, Case, Hypothesis

LAWS = {  # what is hidden, and with what a fit of it begins
    "friction.power_law": ({"drag_forwards": 0.3, "drag_backwards": 0.1, "exponent": 0.5}, {"exponent": 0.1}),
    "friction.eyring": (
        {"shear_forwards": 0.3, "shear_backwards": 0.1, "eyring_speed": 0.5},
        {"eyring_speed": 10.0},
    ),
}
MODEL_ERROR = 5e-4


def true_cost(problem: TorqueProblem, point: FloatArray, weights: TorqueProblem, at: FloatArray) -> float:
    """Of a point, the motion prescribed to its own robot, with the weights of another point."""
    about = linearise_at(weights, at, MODEL_ERROR)
    linearise_at(problem, point, MODEL_ERROR)
    return problem.cost(point, problem.weighted(point, about.weights))


@pytest.mark.parametrize("passes", [1, *(pytest.param(passes, marks=pytest.mark.full) for passes in (2, 3))])
@pytest.mark.parametrize("use", LAWS)
def test_after_however_few_passes_a_fit_is_better_than_its_start(
    told: Robot, measured: Callable[..., Record], use: str, passes: int
) -> None:
    """Steps as long as the linear model has them multiply the cost by up to 960, and end there (by hand)."""
    true, far = LAWS[use]
    plant = told.with_effect("hidden", use, "axis_1", values=true)
    case = Case((measured(plant, 8, 2),), told, {}, 100.0, 0, passes, MODEL_ERROR)
    wrong = Hypothesis((Addition("law", use, "axis_1", None, true | far, tuple(true)),))
    first, again = (case.problem(wrong, case.records) for _ in range(2))
    begin, _ = best_start(first, (np.zeros(first.n_free),), passes, lambda *_: None)
    fitted = case.fit(wrong, lambda *_: None)
    before = true_cost(again, begin, first, begin)
    assert true_cost(fitted.problem, fitted.point, first, begin) < 0.1 * before
