"""What no result may be is told by field and place, and real results are none of it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from faults.fault import fault
from hypothesis import given, settings, strategies as st

from robid_core import Channel, Configurations, DenseRun, Fit, Frf, ParameterTable, Record, Report
from robid_core.artifacts.soundness import no_covariance, unsound
from robid_core.errors import DataRejected

SEES = (
    "exit 8: the stage and its plugin gave a result that cannot be, which field, and why; nothing is stored"
)
FILE = "robid_core/artifacts/soundness.py"


def response(**changes: Any) -> Frf:
    """Three lines of a response of two axes, with the covariance of independent noise."""
    rng = np.random.default_rng(1)
    fields: dict[str, Any] = {
        "axis_names": ("a", "b"),
        "estimator": "x",
        "pooling": "y",
        "sample_time_s": 0.001,
        "torque_hold": "continuous",
        "angle": np.zeros((1, 2)),
        "frequency_hz": np.array([1.0, 2.0, 4.0]),
        "response": rng.normal(size=(1, 3, 2, 2)) + 0j,
        "input_gram_inverse": np.tile(np.eye(2) + 0j, (1, 3, 1, 1)),
        "output_covariance": np.tile(np.array([[2.0, 1j], [-1j, 1.0]]), (1, 3, 1, 1)),
    }
    return Frf(**(fields | changes))


def parameters(*names: str) -> ParameterTable:
    """A table of as many parameters."""
    n = len(names)
    flags = np.zeros(n, dtype=bool)
    return ParameterTable(names, ("N m",) * n, ("friction",) * n, *np.ones((3, n)), flags, flags)


def solved(**changes: Any) -> Fit:
    """A fit of one parameter."""
    fields: dict[str, Any] = {
        "method": "x",
        "status": "done",
        "converged": True,
        "misfit": 1.0,
        "n_starts": 1,
        "n_agree": 1,
        "parameters": parameters("a"),
        "covariance": np.ones((1, 1)),
    }
    return Fit(**(fields | changes))


def problems(artifact: Any) -> list[str]:
    return list(unsound(artifact))


def test_a_sound_response_has_no_problem() -> None:
    assert problems(response()) == []
    gaps = response().response.copy()
    gaps[0, 1] = np.nan  # a masked line
    assert problems(response(response=gaps)) == []


@fault(
    "R12",
    sees=SEES,
    mutant=(FILE, '    if metadata.get("known") and not np.isfinite(values).any():', "    if False:"),
)
def test_a_response_of_nan_alone_is_told() -> None:
    nothing = np.full((1, 3, 2, 2), np.nan + 0j)
    assert problems(response(response=nothing)) == ["Frf.response: all 12 values are NaN"]


@fault("R12", sees=SEES, mutant=(FILE, "    if np.isinf(values).any():", "    if False:"))
def test_a_value_at_infinity_is_told_with_its_place() -> None:
    values = np.ones((1, 3, 2, 2), dtype=complex)
    values[0, 2, 1, 0] = np.inf
    assert problems(response(response=values)) == [
        "Frf.response: 1 values are infinite, the first at n_config=0, n_freq=2, n_out=1, n_in=0"
    ]


@fault(
    "R12",
    sees=SEES,
    mutant=(FILE, '    if metadata.get("rising") and not (np.diff(values) > 0).all():', "    if False:"),
)
def test_frequencies_that_descend_are_told() -> None:
    assert problems(response(frequency_hz=np.array([4.0, 2.0, 1.0]))) == [
        "Frf.frequency_hz: does not rise: 4 is followed by 2"
    ]


@fault("R12", sees=SEES, mutant=(FILE, "    if least < -ROUNDING * flat.shape[-1]:", "    if False:"))
def test_a_covariance_that_is_not_positive_is_told() -> None:
    wrong = np.tile(np.array([[1.0, 2.0], [2.0, 1.0]]) + 0j, (1, 3, 1, 1))  # eigenvalues 3 and -1
    (words,) = problems(response(output_covariance=wrong))
    assert words.startswith(
        "Frf.output_covariance: is no covariance: not positive, its least eigenvalue is -1 "
    )


def test_a_negative_variance_and_a_matrix_that_is_not_symmetric_are_told() -> None:
    assert no_covariance(np.diag([1.0, -2.0])) == "a variance is negative: -2"
    assert no_covariance(np.array([[1.0, 0.5], [0.1, 1.0]])).startswith(
        "is no covariance: not symmetric, by 0.4"
    )


@fault(
    "R12", sees=SEES, mutant=(FILE, "    if least is not None and (values < least).any():", "    if False:")
)
def test_a_standard_error_below_zero_is_told() -> None:
    table = parameters("a", "b")
    assert problems(table) == []
    wrong = dataclasses.replace(table, standard_error=np.array([np.nan, -0.5]))
    assert problems(wrong) == ["ParameterTable.standard_error: 1 values are below 0, the least -0.5"]


@fault("R12", sees=SEES, mutant=(FILE, "            if twice:", "            if False:"))
def test_a_name_that_stands_twice_is_told() -> None:
    assert problems(parameters("a", "a")) == ["ParameterTable.names: a stands twice"]
    assert problems(response(axis_names=("b", "b"))) == ["Frf.axis_names: b stands twice"]


@fault("R12", sees=SEES, mutant=(FILE, "    if not 0 < step_s < np.inf:", "    if False:"))
def test_a_clock_that_stands_still_or_runs_backwards_is_told() -> None:
    for step_s in (-0.001, np.nan, np.inf):
        assert problems(response(sample_time_s=step_s))[0].startswith("Frf.sample_time_s: ")


@fault(
    "R12",
    sees=SEES,
    mutant=(FILE, "frequency.max() > highest * (1 + ROUNDING):", "frequency.max() > np.inf:"),
)
def test_a_frequency_beyond_half_the_sampling_rate_is_told() -> None:
    assert problems(response(sample_time_s=0.125)) == []  # 4 Hz is half of 8 Hz
    assert problems(response(sample_time_s=0.13)) == [
        "Frf.frequency_hz: 4 Hz, beyond half the sampling rate, 3.84615 Hz"
    ]


def test_parts_within_an_artifact_are_named() -> None:
    channel = Channel("motor", "rad", np.full((1, 1, 1, 1, 2, 1), np.nan))
    assert list(unsound(channel, "Record.runs[0].channels[q]")) == [
        "Record.runs[0].channels[q].values: all 2 values are NaN"
    ]


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 12),
    st.lists(st.floats(-8, 8), min_size=12, max_size=12),
    st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_inverses_of_information_in_any_units_are_covariances(
    seed: int, n: int, scales: list[float], with_gaps: bool
) -> None:
    """J^T J of full rank, inverted and scaled to units of 1e-8 to 1e8: positive but for rounding, n eps cond of it."""
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(4 * n, n)) @ np.diag(10.0 ** rng.uniform(-2, 0, n))
    units = 10.0 ** np.array(scales[:n])
    covariance = np.linalg.inv(jacobian.T @ jacobian) * units[:, None] * units
    if with_gaps:
        covariance[0], covariance[:, 0] = np.nan, np.nan
    assert no_covariance(covariance) == ""
    known = np.flatnonzero(np.isfinite(np.diag(covariance)))
    if len(known) > 1:
        i, j = known[:2]
        covariance[i, j] = covariance[j, i] = 1.5 * np.sqrt(covariance[i, i] * covariance[j, j])
        assert "not positive" in no_covariance(covariance)


def test_zero_variances_are_covariances() -> None:
    assert no_covariance(np.zeros((2, 3, 3))) == ""
    with pytest.raises(AssertionError):
        assert no_covariance(np.array([[0.0, 1.0], [1.0, 0.0]])) == ""


def changed(artifact: Any, **fields: Any) -> Any:
    """Return the artifact with fields that nobody checked."""
    for name, value in fields.items():
        object.__setattr__(artifact, name, value)
    return artifact


def measurement(**changes: Any) -> DenseRun:
    """Four samples of a motor."""
    channel = Channel("motor", "rad", np.zeros((1, 1, 1, 1, 4, 1)))
    fields: dict[str, Any] = {
        "sample_time_s": 0.5,
        "channels": {"motor_position": channel},
        "time_s": np.arange(4) * 0.5,
        "valid": np.ones((1, 1, 1, 1, 4), dtype=bool),
    }
    return DenseRun(**(fields | changes))


@fault(
    "R12",
    sees="exit 8: which field holds what, and what its class declares; a file would keep it and nobody could read it",
    mutant=(FILE, "    if others:\n        return\n", "    others.clear()\n    if True:\n        return\n"),
)
@fault(
    "R12",
    sees="exit 8: complex angles, texts and records in place of real numbers",
    mutant=(
        "robid_core/artifacts/declared.py",
        "    if wanted in KINDS and value.dtype.kind not in KINDS[wanted]:",
        "    if False:",
    ),
)
@pytest.mark.parametrize(
    "artifact, told",
    [
        (
            changed(response(), angle=np.ones((1, 2)) + 1j),
            "Frf.angle: an array of complex128, not of real numbers",
        ),
        (changed(response(), angle=np.ones((1, 2), "S1")), "Frf.angle: an array of |S1, not of real numbers"),
        (
            changed(response(), angle=np.ones((1, 2), "f8,i4")),
            "Frf.angle: an array of [('f0', '<f8'), ('f1', '<i4')]",
        ),
        (changed(response(), angle=None), "Frf.angle: nothing, not an array"),
        (changed(response(), estimator=5), "Frf.estimator: an int, not a str"),
        (changed(response(), sample_time_s="1"), "Frf.sample_time_s: a str, not a float"),
        (changed(response(), axis_names=["a", "b"]), "Frf.axis_names: a list, not a tuple"),
        (changed(response(), axis_names=("a", 5)), "Frf.axis_names: an int, not a str"),
        (changed(response(), estimator="\ud800"), "Frf.estimator: half a character at 0 of a text"),
        (changed(response(), estimator="a\0"), "Frf.estimator: a text with the character NUL at 1"),
        (object.__new__(Report), "Report.html: missing"),
        (changed(Report("x"), html=""), "Report.html is empty: a page has something to show"),
        (
            changed(measurement(), channels={"": None}),
            "DenseRun.channels: an entry called '', which no file can have",
        ),
        (changed(measurement(), channels={"motor": 5}), "DenseRun.channels: an int, not a Channel"),
        (Record(("a",), "x", "continuous", (5,), np.zeros((1, 1))), "Record.runs: an int, not a DenseRun"),
    ],
)
def test_R12_what_a_class_does_not_declare_is_no_result(artifact: Any, told: str) -> None:
    assert [line for line in problems(artifact) if line.startswith(told)]


def test_numbers_of_numpy_stand_for_those_of_python() -> None:
    assert problems(response(sample_time_s=np.float32(0.001))) == []
    assert problems(solved(converged=np.bool_(True), misfit=np.float32(1.0))) == []


def test_whole_numbers_stand_for_real_ones_and_real_ones_for_complex() -> None:
    assert problems(response(angle=np.zeros((1, 2), dtype=int), response=np.ones((1, 3, 2, 2)))) == []


@fault(
    "R12",
    sees="exit 8: NaN, or axes of unequal lengths, in an artifact that was changed after it was built",
    mutant=(FILE, "        artifact.replace()  #", "        pass  #"),
)
def test_R12_what_was_changed_after_it_was_built_is_checked_again() -> None:
    late = changed(response(), angle=np.full((1, 2), np.nan))
    assert problems(late) == ["Frf.angle: 2 values are NaN or infinite, the first at n_config=0, n_axis=0"]


@fault(
    "R12",
    sees="exit 8: how many names there are, and how many values they name",
    mutant=(FILE, "            if len(names) != lengths[axis]:", "            if False:"),
)
def test_R12_names_are_as_many_as_what_they_name() -> None:
    table = parameters("a", "b")
    assert problems(table.replace(names=("a",))) == ["ParameterTable.names: 1 entries, but n_parameter is 2"]
    assert problems(response(axis_names=())) == ["Frf.axis_names: 0 entries, but n_axis is 2"]


@fault(
    "R12",
    sees="exit 8: a channel in degrees, and in which unit it is by its name; no angle of another unit is stored",
    mutant=(
        FILE,
        "        if allowed and channel.unit_symbol not in allowed:",
        "        if False:",
    ),
)
def test_R12_what_no_measurement_says_is_no_result() -> None:
    values = np.zeros((1, 1, 1, 1, 4, 1))
    assert problems(measurement()) == []
    assert problems(measurement(channels={"motor_position": Channel("motor", "deg", values)})) == [
        "DenseRun.channels[motor_position]: in deg; by its name it is in rad or m"
    ]
    assert problems(measurement(sample_time_s=0.001)) == [
        "DenseRun.time_s: 0.5 s between samples, but sample_time_s is 0.001 s"
    ]
    assert problems(measurement(channels={})) == ["DenseRun.channels: empty"]
    short = measurement(channels={"current": Channel("motor", "A", values[..., :2, :])})
    assert problems(short) == [
        "DenseRun.channels[current]: values of shape (1, 1, 1, 1, 2, 1), but valid has (1, 1, 1, 1, 4)"
    ]
    assert problems(Record(("a",), "x", "held", (), np.zeros((1, 1)))) == [
        "Record.torque_hold: 'held', not zero_order_hold or continuous",
        "Record.runs: empty",
    ]


@fault(
    "R12",
    sees="exit 5: how many values are masked, and to fill them; none comes out as if it had been measured",
    mutant=(
        "robid_core/artifacts/artifact.py",
        "            if np.ma.is_masked(value):",
        "            if False:",
    ),
)
def test_R12_masked_values_do_not_lose_their_mask() -> None:
    masked = np.ma.masked_array([[1.0], [2.0]], mask=[[True], [False]])
    with pytest.raises(DataRejected, match=r"Configurations\.angle: 1 values are masked, .*fill"):
        Configurations(("a",), masked)
    assert type(Configurations(("a",), np.ma.masked_array([[1.0]])).angle) is np.ndarray


def test_an_array_that_denies_what_it_holds_is_taken_for_its_numbers() -> None:
    class Liar(np.ndarray[Any, Any]):
        def __array_ufunc__(self, *_: Any, **__: Any) -> Any:
            return np.ones(1, dtype=bool)

    with pytest.raises(DataRejected, match="1 values are NaN"):
        Configurations(("a",), np.full((1, 1), np.nan).view(Liar))


@fault("R12", sees=SEES, mutant=(FILE, "    if artifact.misfit < 0 or (", "    if False and ("))
@pytest.mark.parametrize(
    "changes, words",
    [
        ({"misfit": -1.0}, "Fit.misfit: -1; "),
        ({"misfit": float("nan")}, "Fit.misfit: nan; "),
        ({"misfit": float("inf")}, "Fit.misfit: inf; "),
        ({"misfit": -1.0, "converged": False}, "Fit.misfit: -1; "),
        ({"model_error": -0.1}, "Fit.model_error: -0.1; "),
        ({"model_error": float("nan")}, "Fit.model_error: nan; "),
        ({"n_agree": 2}, "Fit.n_agree: 2 of 1 starts"),
        ({"n_agree": -1}, "Fit.n_agree: -1 of 1 starts"),
    ],
)
def test_evidence_that_no_fit_has_is_told(changes: dict[str, Any], words: str) -> None:
    (problem,) = problems(solved(**changes))
    assert problem.startswith(words)


def test_a_fit_that_did_not_converge_may_have_no_misfit() -> None:
    assert problems(solved(misfit=float("nan"), converged=False)) == []
