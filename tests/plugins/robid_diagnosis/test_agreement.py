"""Whether configurations agree about a law: asked where it was searched, and again where it was fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy

from robid_core import Channel, Record, Robot
from robid_diagnosis.agreement import CHANCE, differs_at_fit
from robid_diagnosis.columns import Motion
from robid_diagnosis.fitted_projection import projection_of, projection_without
from robid_diagnosis.hypothesis import Addition, Case, Fitted, Hypothesis
from robid_diagnosis.projection import Gain
from robid_diagnosis.search import Search

HARD = Addition("hard", "transmission.stiffening", "axis_1", "gear", {"cubic": 1e9}, ("cubic",))
WAVE = {"amplitude": 2e-3, "order": 7.0, "phase": 0.4}
RIPPLE = Addition("wave", "drive.torque_ripple", "axis_1", "torque", WAVE, ("amplitude", "phase"))
Plants = Callable[[Robot, int], Robot]
Measured = Callable[..., Record]


def fit_of(told: Robot, record: Record, *additions: Addition) -> Fitted:
    case = Case((record,), told, {}, 100.0, 0, 12, 5e-4)
    return case.fit(Hypothesis(additions), lambda *_: None)


def cost(fitted: Fitted, names: tuple[str, ...], parts: list[slice]) -> float:
    """What least squares leave where a law has sizes of its own in each of some parts of the rows."""
    problem, rows = fitted.problem, np.concatenate(fitted.about.rows)
    apart = [problem.free.names.index(name) for name in names]
    kept = np.setdiff1d(np.arange(problem.n_unknown), apart)
    own = np.zeros((len(rows), len(parts), len(names)))
    for i, part in enumerate(parts):
        own[part, i] = rows[part][:, apart]
    own = own.reshape(len(rows), -1)
    prior = np.diag(1 / problem.prior[kept])
    whole = np.block([[rows[:, kept], own], [prior, np.zeros((len(kept), own.shape[1]))]])
    residual = projection_of(fitted)[0].residual
    left = np.concatenate((residual, -fitted.point[kept] / problem.prior[kept]))
    scale = np.sqrt((whole**2).sum(axis=0))
    return float(((left - whole @ (np.linalg.lstsq(whole / scale, left, rcond=1e-12)[0] / scale)) ** 2).sum())


@pytest.mark.parametrize("cubic", [pytest.param(2e9, marks=pytest.mark.full), 8e9])
def test_one_spring_that_hardens_agrees_where_it_was_fitted(
    told: Robot, plant_of: Plants, measured: Measured, cubic: float
) -> None:
    """It bends the motion: the search, which sees the motion of a straight spring, finds another size in each pose."""
    plant = plant_of(told, 61).with_effect("hard", HARD.use, "axis_1", "gear", {"cubic": cubic})
    record = measured(plant, 62)
    without = fit_of(told, record)
    search = Search(
        Motion(without.problem, without.point, without.about.weights),
        projection_of(without)[0],
        np.random.default_rng(0),
    )
    (hit,) = search.run((HARD.use,), {}, lambda *_: None).hits
    _, groups = projection_of(without)
    assert search.projection.disagreement(hit.sums, hit.gain, groups)[0] > 1e4
    fitted = fit_of(told, record, HARD)
    projection, groups, columns = projection_without(fitted, HARD.names)
    whole = Gain(1.0, (0,), np.zeros(1), np.zeros(1), 1.0)
    beyond, freedom = projection.disagreement(projection.sums(columns), whole, groups)
    assert freedom == 3  # of four poses one size each, less a common one
    assert beyond < scipy.stats.chi2.isf(CHANCE, freedom)
    assert not differs_at_fit(fitted, HARD.names, 1.0)
    parts = [slice(projection.folds[group[0]].start, projection.folds[group[-1]].stop) for group in groups]
    by_hand = cost(fitted, HARD.names, [slice(None)]) - cost(fitted, HARD.names, parts)
    assert beyond == pytest.approx(by_hand, rel=1e-3, abs=1e-3)  # of sums a million times as large


@pytest.mark.parametrize("where", [slice(None), slice(1, 2)], ids=["everywhere", "in one pose"])
def test_a_wave_that_one_pose_alone_has_differs(
    told: Robot, plant_of: Plants, measured: Measured, where: slice
) -> None:
    record = measured(plant_of(told, 17), 18)
    (run,) = record.runs
    torque, angle = run.values("motor_torque").copy(), run.values("motor_position")
    torque[where] += WAVE["amplitude"] * np.cos(WAVE["order"] * angle[where] + WAVE["phase"])
    channels = dict(run.channels) | {"motor_torque": Channel("motor", "N m", torque)}
    fitted = fit_of(told, replace(record, runs=(replace(run, channels=channels),)), RIPPLE)
    size, error = fitted.estimate(RIPPLE.names[0])
    assert differs_at_fit(fitted, RIPPLE.names, (size / error) ** 2) == (where != slice(None))
