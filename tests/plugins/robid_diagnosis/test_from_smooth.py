"""Gaps fitted from round corners on: their width is found from starts from which other fits go astray."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Record, Robot
from robid_core.residual import effect_class
from robid_diagnosis.from_smooth import fits_from_smooth
from robid_diagnosis.hypothesis import Addition, Case, Hypothesis
from robid_diagnosis.likelihood import is_nearer

GAP, TIMES = 1.5e-4, 4.0  # rad; where fits begin, over the true one
PLAY = Hypothesis(
    (Addition("play", "transmission.backlash", "axis_1", "gear", {"gap": TIMES * GAP}, ("gap",)),)
)


def told_nothing(*_: object) -> None:
    """Progress."""


def case_of(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record], seed: int
) -> Case:
    plant = plant_of(told, seed).with_effect("play", "transmission.backlash", "axis_1", values={"gap": GAP})
    return Case((measured(plant, 11, n_config=3),), told, {}, 100.0, 0, 12, 5e-4)


def test_of_two_fits_the_one_without_rattling_is_nearer(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record]
) -> None:
    """Begun four times too wide a gap stays so: the model rattles in two of six experiments, and fits the others.

    Begun with round corners the width is found, no experiment is left out. Misfits are the same.
    """
    case = case_of(told, plant_of, measured, 4)
    astray = case.fit_what_is_seen(PLAY, told_nothing, as_told=True)
    assert astray.problem.left_out == (0, 2, 0)
    assert astray.misfit < 1.1
    assert astray.estimate("effect.play.gap")[0] > 2 * GAP
    rounded, plain = fits_from_smooth(case, PLAY, None, told_nothing)
    bare = case.fit_what_is_seen(Hypothesis(), told_nothing)
    for fitted in (rounded, plain):
        assert not any(fitted.problem.left_out)
        assert fitted.misfit < 1.1
        gap, error = fitted.estimate("effect.play.gap")
        assert abs(gap - GAP) < 4 * error < 0.01 * GAP
        assert is_nearer(fitted, astray, bare)
        assert not is_nearer(astray, fitted, bare)
        assert is_nearer(astray, bare, bare)
    assert rounded.hypothesis.additions[0].free == ("gap", "rounding")
    assert plain.hypothesis == PLAY


@pytest.mark.full
@pytest.mark.xfail(
    strict=True,
    reason="since laws and friction between the samples see quieter speeds twelve passes end short of the minimum: the "
    "gap is right, its stated error 0.7 % in place of 0.1, and the second fit ends at a misfit of 1.19",
)
def test_a_fit_that_goes_astray_is_none_from_round_corners(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record]
) -> None:
    case = case_of(told, plant_of, measured, 5)
    assert case.fit_what_is_seen(PLAY, told_nothing, as_told=True).misfit > 100
    for fitted in fits_from_smooth(case, PLAY, None, told_nothing):
        assert fitted.misfit < 1.1
        gap, error = fitted.estimate("effect.play.gap")
        assert abs(gap - GAP) < 4 * error < 0.02 * GAP


def test_what_is_smoothest_is_a_parameter_within_its_bounds() -> None:
    effect = effect_class("transmission.backlash")
    rows = {row.name: row for row in effect.parameters}
    assert effect.smoothest
    for name, value in effect.smoothest.items():
        assert rows[name].lower < value < rows[name].upper
        assert not np.isclose(value, rows[name].default)
