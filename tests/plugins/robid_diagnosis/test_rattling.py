"""A wide gap of a gear: an arm that rattles within it for ever is no datum, and hides nothing of the others."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Context, Record, Robot
from robid_core.residual.misfit import power_in_noise
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects
from robid_diagnosis.hypothesis import Addition, Case, Hypothesis
from robid_diagnosis.likelihood import lost
from robid_fit.torque_doubts import rattling
from robid_fit.torque_residual import TorqueResidualFit

GAP = 1e-3  # rad, of 100 motor turns: it opens and closes with every wave of the multisine
PLAY = Hypothesis((Addition("play", "transmission.backlash", "axis_1", "gear", {"gap": GAP}, ("gap",)),))


def context() -> Context:
    return Context(np.random.default_rng(1), map_in_process, lambda *_: None, logging.getLogger("test"))


@pytest.fixture(scope="module")
def plant(told: Robot, plant_of: Callable[[Robot, int], Robot]) -> Robot:
    return plant_of(told, 1)


@pytest.fixture(scope="module")
def record(plant: Robot, measured: Callable[..., Record]) -> Record:
    return measured(
        plant.with_effect("play", "transmission.backlash", "axis_1", values={"gap": GAP}), 11, n_config=6
    )


def test_experiments_in_which_the_model_rattles_do_not_count(plant: Robot, record: Record) -> None:
    """The plant repeats its motion; prescribed to its own model, that of two experiments is another in each period.

    What is left of them is hundreds of times the noise. All others leave noise, and tell the gap.
    """
    case = Case((record,), plant, {}, 100.0, 0, 12, 5e-4)
    fitted = case.fit_what_is_seen(PLAY, lambda *_: None, as_told=True, roughly=True)
    problem, point = fitted.problem, fitted.point
    (block,), (residual,), (robot,) = problem.blocks, problem.residuals(point), problem.robots(point)
    power = power_in_noise(block, robot, problem.friction_size(point), residual)
    assert block.used is not None
    assert problem.left_out == (0, 2, 0, 0, 0, 0)
    assert (power[~block.used] > 100).all()
    assert power[block.used].max() < 1.3
    assert fitted.misfit < 1.1
    gap, error = fitted.estimate("effect.play.gap")
    assert abs(gap - GAP) < 3 * error < 0.2 * GAP
    (remark,) = rattling(problem)
    assert remark.is_remark
    assert "2 of 12 experiments are not used" in remark.sentence


def test_a_robot_without_the_gap_has_to_explain_the_experiments_that_are_left_out_because_of_it(
    plant: Robot, record: Record
) -> None:
    """They count for both: for the robot that rattles as the mean of its others. Else a gap would become needless."""
    case = Case((record,), plant, {}, 100.0, 0, 12, 5e-4)
    fitted = case.fit_what_is_seen(PLAY, lambda *_: None, as_told=True, roughly=True)
    bare = case.fit_what_is_seen(
        PLAY.without(("effect.play.gap",)), lambda *_: None, begin=fitted, roughly=True
    )
    ((block,), (weight,)), (without,) = (fitted.problem.blocks, fitted.about.weights), bare.problem.blocks
    assert block.used is not None
    assert without.used is None
    every = dataclasses.replace(weight, used=None)
    (mine,), (its,) = (one.problem.weighted(one.point, (every,)) for one in (bare, fitted))
    power, own = ((rows**2).sum(axis=-1) for rows in (mine, its))
    assert power[~block.used].min() > 10 * own[block.used].max()
    means = np.where(block.used, own, own[block.used].mean())
    priors = [float(((one.point / one.problem.prior) ** 2).sum()) for one in (bare, fitted)]
    by_hand = power.sum() - means.sum() + priors[0] - priors[1]
    assert lost(bare, fitted, fitted.about) == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.full
def test_a_fit_says_how_many_experiments_it_left_out(plant: Robot, record: Record) -> None:
    nominal = plant.with_effect("play", "transmission.backlash", "axis_1", values={"gap": 0.95 * GAP})
    stage = TorqueResidualFit(free=("gear_*", "friction.*.viscous", "effect.play.gap"))
    fit = stage.run((record,), nominal, context())
    gap = fit.parameters.names.index("effect.play.gap")
    assert fit.parameters.estimate[gap] == pytest.approx(GAP, abs=3 * fit.parameters.standard_error[gap])
    assert fit.misfit < 1.1
    assert "rattling" in [doubt.kind for doubt in fit.doubts]


@pytest.mark.full
def test_play_is_named_alone_and_the_verdict_says_what_was_not_used(told: Robot, record: Record) -> None:
    uses = ("transmission.backlash", "drive.torque_ripple")
    diagnosis = Effects(only=uses, separate=False, response_check=()).run((record,), told, context())
    (finding,) = diagnosis.findings
    assert (finding.effect, finding.on, finding.kind) == ("transmission.backlash", "axis_1", "cause")
    assert finding.value[finding.names.index("gap")] == pytest.approx(GAP, rel=0.1)
    assert "2 of 12 experiments are not used (configuration 2)" in diagnosis.verdict
