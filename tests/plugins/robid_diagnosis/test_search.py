"""The search: many candidates at once are what each is alone; what one search evaluated serves the next."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy

from robid_core import FloatArray, Record, Robot
from robid_diagnosis.additions import addition_of
from robid_diagnosis.columns import ALIKE, Motion
from robid_diagnosis.fitted_projection import projection_of
from robid_diagnosis.hypothesis import Case, Fitted, Hypothesis
from robid_diagnosis.projection import Projection
from robid_diagnosis.search import DRAWS, Search

USES = ("friction.load_dependent", "friction.dahl", "transmission.kinematic_error", "drive.cogging")


def random() -> np.random.Generator:
    """Draws that are always the same."""
    return np.random.default_rng(0)


def told_nothing(*_: object) -> None:
    """Progress that nobody looks at."""


@pytest.fixture(scope="module")
def fitted(told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record]) -> Fitted:
    case = Case((measured(plant_of(told, 5), 6),), told, {}, 100.0, 0, 12, 5e-4)
    return case.fit(Hypothesis(), told_nothing)


def search_at(fitted: Fitted, point: FloatArray, before: Motion | None = None) -> Search:
    motion = Motion(fitted.problem, point, fitted.about.weights, before)
    return Search(motion, projection_of(fitted)[0], random())


@pytest.mark.parametrize("use", USES)
def test_many_at_once_gain_what_each_gains_alone(fitted: Fitted, use: str) -> None:
    """To rounding, and single precision of the torques that are kept."""
    search = search_at(fitted, fitted.point)
    found = search.run((use,), {}, told_nothing)
    assert found.hits
    for hit in found.hits:
        alone = search.hit(hit.candidate, dict(hit.values))
        assert hit.gain.total == pytest.approx(alone.gain.total, rel=1e-4, abs=1e-5)
        assert hit.gain.size == pytest.approx(alone.gain.size, rel=1e-4, abs=1e-9)


def test_a_law_that_is_asked_for_is_as_sure_as_the_noise_that_the_robot_leaves(fitted: Fitted) -> None:
    """Four times the variance that was told: a gain counts a quarter (quasi-likelihood); of less it counts whole."""
    (hit, *_) = search_at(fitted, fitted.point).run(("friction.load_dependent",), {}, told_nothing).hits
    strong = replace(hit, gain=replace(hit.gain, total=20.0))
    assert strong.log_p(4.0) == pytest.approx(scipy.stats.chi2.logsf(5.0, strong.freedom))
    assert strong.log_p(0.5) == strong.log_p()


def test_noise_gives_chi_square_of_the_columns(fitted: Fitted) -> None:
    """p-values of one column by chance are even: a mean of -log p of 1, within four of its standard errors."""
    search = search_at(fitted, fitted.point)
    (candidate, *_) = search.motion.candidates("friction.load_dependent")
    ((hit, slopes),) = search._together([candidate], [])
    matrix, _ = search.projection.normal(hit.sums)
    chosen = np.array(hit.gain.chosen)
    spread = (slopes[chosen] ** 2).mean(axis=1) / np.diag(matrix)[chosen]
    assert np.abs(spread - 1).max() < 4 * np.sqrt(2 / DRAWS)


def test_what_a_stiff_pedestal_does_is_in_proportion_to_its_compliance(fitted: Fitted) -> None:
    """Half of it with twice the stiffness, to the highest frequency against the resonance, squared: one in thirty."""
    motion = search_at(fitted, fitted.point).motion
    *_, start = motion.candidates("structure.foundation_sway")
    stiffness = start.values["stiffness_x"]
    one, half = (motion.columns(start, {"stiffness_x": k * stiffness}).rows[0] for k in (30.0, 60.0))
    assert np.linalg.norm(one - 2 * half) < np.linalg.norm(one) / 30


@pytest.mark.parametrize("times", [30.0, 0.5])
def test_a_pedestal_that_was_taken_for_too_soft_or_too_stiff_is_found(fitted: Fitted, times: float) -> None:
    """A residual that it leaves, without noise, where it resonates at the end of the band: the spring that acts
    within two percent; the other one, which the motor of an arm in a vertical plane does not feel, is not asked for and
    believed like it."""
    motion = search_at(fitted, fitted.point).motion
    *_, start = motion.candidates("structure.foundation_sway")
    true = start.values["stiffness_x"]
    residual = motion.torques(start, {"stiffness_y": 1e12})
    about, folds = fitted.about, projection_of(fitted)[0].folds
    rows, rest = np.concatenate(about.rows), np.zeros(len(about.whole))
    search = Search(motion, Projection(rows, motion.weighted(residual), about.whole, rest, folds), random())
    found = search.refined(search.hit(start, {"stiffness_x": times * true}))
    assert found.values["stiffness_x"] == pytest.approx(true, rel=0.02)
    assert found.names == ["stiffness_x"]
    assert found.values["stiffness_y"] == pytest.approx(found.values["stiffness_x"])


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("changed", [0.0, 0.3])
def test_torques_serve_the_next_search_where_the_motion_is_the_same(
    fitted: Fitted, use: str, changed: float
) -> None:
    """With a gear a third stiffer what the gear does is evaluated anew; all columns are what they are without memory,
    up to what may stay."""
    first = Motion(fitted.problem, fitted.point, fitted.about.weights)
    for candidate in first.candidates(use):
        first.columns(candidate)
    point = fitted.point.copy()
    point[fitted.problem.free.names.index("gear_stiffness.axis_1")] += changed
    second = Motion(fitted.problem, point, fitted.about.weights, first)
    fresh = Motion(fitted.problem, point, fitted.about.weights)
    for candidate, anew in zip(second.candidates(use), fresh.candidates(use), strict=True):
        assert candidate.key == anew.key
        known, expected = (one.columns(anew).rows for one in (second, fresh))
        assert np.linalg.norm(known - expected) <= 2 * ALIKE * np.linalg.norm(expected)
        if not changed or candidate.spot.side == "gear":
            assert (candidate in second._known) == (not changed)


def test_torques_are_kept_up_to_a_bound(fitted: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where only one candidate's torques are granted memory the others are evaluated anew, to the same columns."""

    def columns_of_next(first: Motion) -> tuple[Motion, list[FloatArray]]:
        for candidate in first.candidates(USES[0]):
            first.columns(candidate)
        again = Motion(fitted.problem, fitted.point, fitted.about.weights, first)
        return again, [again.columns(candidate).rows for candidate in again.candidates(USES[0])]

    every, expected = columns_of_next(Motion(fitted.problem, fitted.point, fitted.about.weights))
    one = next(iter(every._known.values()))
    size = sum(spectra.nbytes for of_column in one.spectra for spectra in of_column)
    monkeypatch.setattr("robid_diagnosis.columns.REMEMBERED", size)
    few, found = columns_of_next(Motion(fitted.problem, fitted.point, fitted.about.weights))
    assert len(few._known) == 1 < len(every._known)
    for own, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(own, other)


def test_a_level_of_friction_that_falls_above_the_rms_speed_is_found(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record]
) -> None:
    """At 10 rad/s, where the motor turns with 6 rms: viscous friction does 99.8 % of it; lower starts miss it."""
    sizes = {"coulomb": 0.0, "breakaway": 0.15, "stribeck_speed": 10.0, "speed": 0.5}
    plant = plant_of(told, 71).with_effect("hidden", "friction.stribeck", "axis_1", "motor", sizes)
    case = Case((measured(plant, 72),), told, {}, 100.0, 0, 12, 5e-4)
    fitted = case.fit(Hypothesis(), told_nothing)
    search = search_at(fitted, fitted.point)
    (hit,) = [
        hit
        for hit in search.run(("friction.stribeck",), {}, told_nothing).hits
        if hit.candidate.spot.side == "motor"
    ]
    found = search.refined(hit)
    assert found.log_p(fitted.misfit) < np.log(1e-6)
    assert found.values["stribeck_speed"] == pytest.approx(10.0, rel=0.1)
    trial = case.fit(
        Hypothesis((addition_of(found, search, "hidden"),)), told_nothing, fitted, found.meaning.delay
    )
    assert trial.misfit < 1.1 < 10 < fitted.misfit
