"""Each reason not to rely on a fit: one that has it says so in whole words, a sound one says nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import DataRejected, Doubt, Fit, MisfitTable, ParameterTable

NAMES = (
    "gear_stiffness.axis_1",
    "gear_stiffness.axis_2",
    "gear_damping.axis_1",
    "gear_damping.axis_2",
    "bearing_damping.axis_1_x",
    "mass.axis_2",
    "friction_factor.axis_1",
    "friction_factor.axis_2",
)
ESTIMATE = np.array([3e5, 6e5, 300.0, 200.0, 50.0, 12.0, 0.71, 1.39])


def sound(**changes: Any) -> Fit:
    """A fit that nobody needs to doubt; changes of its table by their names, of the fit by theirs."""
    n = len(NAMES)
    fields = {
        "names": NAMES,
        "units": ("1",) * n,
        "groups": ("stiffness",) * 2 + ("damping",) * 3 + ("inertia",) + ("nuisance",) * 2,
        "start": 1.2 * ESTIMATE,
        "estimate": ESTIMATE,
        "standard_error": 0.02 * ESTIMATE,
        "reported": np.arange(n) < 2,
        "at_bound": np.zeros(n, dtype=bool),
    }
    table = {name: changes.pop(name) for name in list(changes) if name in fields or name == "prior"}
    fit = Fit(
        "test", "ended", True, 1.08, 20, 10, ParameterTable(**fields | table), 4e-4 * np.eye(n), NAMES,
        model_error=0.02,
    )  # fmt: skip
    return fit.replace(**changes)


def marked(*names: str) -> np.ndarray:
    return np.isin(NAMES, names)


def correlated(first: int, second: int, correlation: float) -> np.ndarray:
    covariance = np.diag(np.geomspace(1e-6, 1e2, len(NAMES)))
    covariance[first, second] = covariance[second, first] = correlation * np.sqrt(
        covariance[first, first] * covariance[second, second]
    )
    return covariance


def without(name: str) -> np.ndarray:
    return np.where(marked(name), np.nan, 0.02 * ESTIMATE)


DOUBTED: dict[str, tuple[dict[str, Any], str]] = {
    "convergence": (
        {"converged": False, "status": "8 passes were not enough"},
        "the fit did not converge: 8 passes were not enough; its numbers must not be used",
    ),
    "misfit": ({"misfit": 1.09}, "misfit 1.09 against the stated uncertainty, more than 1.08"),
    "model error": ({"model_error": 0.031}, "model error 3.1 %, more than 2 %"),
    "bound": (
        {"at_bound": marked("gear_stiffness.axis_2")},
        "at the bound of the search, hence not identified: gear_stiffness.axis_2;",
    ),
    "not seen": (
        {"standard_error": without("gear_stiffness.axis_1")},
        "without a standard error: gear_stiffness.axis_1;",
    ),
    "weak spring": (
        {"standard_error": np.where(marked("gear_stiffness.axis_1"), 0.6, 0.02) * ESTIMATE},
        "hardly seen by the data: gear_stiffness.axis_1 (60 % of what was known before)",
    ),
    "coaxial springs": (
        {"covariance": correlated(0, 1, -0.995)},
        "not separated by the data: gear_stiffness.axis_1 and gear_stiffness.axis_2 (correlation -0.995)",
    ),
    "friction": (
        {"estimate": np.where(marked("friction_factor.axis_2"), 1.45, ESTIMATE)},
        "friction, as a ratio to the robot file's, is outside 0.7 to 1.4: axis_2 1.45;",
    ),
    "starts": ({"n_agree": 9}, "only 9 of 20 starts reached the best fit"),
}


def test_a_sound_fit_is_not_doubted() -> None:
    assert sound().doubts == ()


@pytest.mark.parametrize("kind", DOUBTED)
def test_a_fit_that_has_a_fault_is_doubted_for_it_and_for_nothing_else(kind: str) -> None:
    changes, words = DOUBTED[kind]
    (doubt,) = sound(**changes).doubts
    assert doubt.kind == kind
    assert words in str(doubt)
    assert str(doubt) == f"{doubt.sentence}; {doubt.remedy}"


HARMLESS: dict[str, dict[str, Any]] = {
    "the weights made the misfit one, so that it checks nothing": {"misfit": 1.3, "misfit_against": ""},
    "no model error is in the weights": {"model_error": None},
    "two dampers at their bounds": {"at_bound": marked("gear_damping.axis_1", "bearing_damping.axis_1_x")},
    "two dampers without a standard error": {
        "standard_error": np.where(
            marked("gear_damping.axis_1", "gear_damping.axis_2"), np.nan, 0.02 * ESTIMATE
        )
    },
    "a parameter that was held has no standard error": {
        "standard_error": without("mass.axis_2"),
        "free_names": tuple(name for name in NAMES if name != "mass.axis_2"),
    },
    "a damper that is hardly seen": {
        "standard_error": np.where(marked("gear_damping.axis_1"), 0.9, 0.02) * ESTIMATE
    },
    "a spring and its damper go together": {"covariance": correlated(0, 2, 0.999)},
    "covariances that are not known": {"covariance": np.full((8, 8), np.nan)},
    "a covariance that is of something else": {"covariance": np.eye(1)},
    "one start": {"n_starts": 1, "n_agree": 1},
}


@pytest.mark.parametrize("case", HARMLESS)
def test_what_is_harmless_is_not_doubted(case: str) -> None:
    assert sound(**HARMLESS[case]).doubts == ()


def test_three_dampers_at_their_bounds_are_too_many_and_a_mass_is_one_too_many() -> None:
    dampers = ("gear_damping.axis_1", "gear_damping.axis_2", "bearing_damping.axis_1_x")
    (doubt,) = sound(at_bound=marked(*dampers)).doubts
    assert doubt.sentence.endswith(", ".join(dampers))
    (doubt,) = sound(at_bound=marked("mass.axis_2", *dampers[:2])).doubts
    assert doubt.sentence.endswith("identified: mass.axis_2")


@pytest.mark.parametrize(("start", "degree"), [(0.5, "remark"), (0.01, "doubt")])
def test_a_zero_speed_width_at_its_lower_bound_is_a_remark_at_its_upper_one_a_doubt(
    start: float, degree: str
) -> None:
    names = ("friction.axis_1.speed", *NAMES[1:])
    begun = np.array([start, *(1.2 * ESTIMATE[1:])])
    found = np.array([0.02, *ESTIMATE[1:]])
    fit = sound(names=names, start=begun, estimate=found, at_bound=np.arange(len(NAMES)) == 0)
    (doubt,) = [one for one in fit.doubts if names[0] in one.sentence]
    assert doubt.degree == degree


def test_weakly_seen_is_meant_against_the_prior_where_one_is_stated() -> None:
    prior = np.where(marked("gear_stiffness.axis_1", "mass.axis_2"), 0.03 * ESTIMATE, np.nan)
    (doubt,) = sound(prior=prior).doubts
    assert doubt.kind == "weak spring"
    assert "gear_stiffness.axis_1 (67 % of what was known before)" in doubt.sentence
    assert sound(prior=2 * prior).doubts == ()


def test_of_two_starts_both_must_agree() -> None:
    assert sound(n_starts=2, n_agree=2).doubts == ()
    assert [doubt.kind for doubt in sound(n_starts=2, n_agree=1).doubts] == ["starts"]


def table(**changes: Any) -> MisfitTable:
    lines = np.array([[1.0, 1.2, 5.0], [0.9, np.nan, 1.05]])
    other = np.array([[1.0, 1.1, 1.0], [35.0, 1.0, 1.0]])
    return MisfitTable(("axis_1", "axis_3"), np.array([0.0, 3.0, 25.0, 50.0]), lines, other).replace(
        **changes
    )


def test_a_misfit_is_told_with_its_worst_axes_and_bands() -> None:
    (doubt,) = sound(misfit=2.5, misfit_against="differences between periods", misfit_table=table()).doubts
    assert doubt.sentence == (
        "misfit 2.5 against differences between periods, more than 1.08: 35 on axis_3 below 3 Hz (other bins), "
        "5 on axis_1 at 25-50 Hz (lines), 1.2 on axis_1 at 3-25 Hz (lines)"
    )
    assert sound(misfit=1.0, misfit_table=table()).doubts == ()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"axis_names": ("axis_1",)}, "there are 1 axes and 4 edges"),
        ({"band_edges_hz": np.array([0.0, 3.0, 25.0])}, "n bands have n \\+ 1 edges"),
        ({"band_edges_hz": np.array([0.0, 3.0, 3.0, 50.0])}, "do not rise"),
    ],
)
def test_a_table_whose_sizes_disagree_is_refused(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(DataRejected, match=told):
        table(**changes)


def test_what_an_estimator_states_itself_comes_last_and_survives_the_file(tmp_path: Path) -> None:
    own = Doubt("mass matrix", "the mass matrix is not positive", "measure faster motions")
    fit = sound(n_agree=1, stated_doubts=(own,), misfit_table=table(), prior=np.full(8, np.nan))
    fit.write(tmp_path / "fit.h5")
    read = Fit.read(tmp_path / "fit.h5")
    assert [doubt.kind for doubt in read.doubts] == ["starts", "mass matrix"]
    assert read.doubts == fit.doubts
    assert read.misfit_table is not None
    np.testing.assert_array_equal(read.misfit_table.other, table().other)
    assert read.model_error == fit.model_error


def test_many_names_are_counted_not_listed() -> None:
    n = 9
    names = tuple(f"gear_stiffness.axis_{i}" for i in range(n))
    everything = ParameterTable(
        names, ("1",) * n, ("stiffness",) * n, np.ones(n), np.ones(n), np.full(n, 0.1), np.ones(n, dtype=bool),
        np.ones(n, dtype=bool),
    )  # fmt: skip
    (doubt,) = Fit("test", "ended", True, 1.0, 1, 1, everything, np.eye(n), names).doubts
    assert doubt.sentence.endswith("gear_stiffness.axis_5 and 3 more")
