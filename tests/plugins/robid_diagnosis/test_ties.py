"""Rivals of a cause once all causes are known: what is alike stays a tie, what is not is one no more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from robid_core import Record, Robot
from robid_diagnosis.hypothesis import Addition, Case, Fitted, Hypothesis
from robid_diagnosis.search import Failure
from robid_diagnosis.selection import Selection
from robid_diagnosis.steps import Step
from robid_diagnosis.ties import with_final_ties
from robid_diagnosis.trials import Trial, key_of

WAVE = {"amplitude": 0.15, "order": 6.0, "phase": 0.3}


@pytest.fixture(scope="module")
def waves(told: Robot, measured: Callable[..., Record]) -> tuple[Case, dict[str, Fitted]]:
    """Cogging that was measured, fitted as what it is, as torque ripple (which holds it), and as another order."""
    plant = told.with_effect("hidden", "drive.cogging", "axis_1", values=WAVE)
    case = Case((measured(plant, 4, 2),), told, {}, 100.0, 0, 12, 5e-4)
    case = case.with_fitted_width(case.fit(Hypothesis(), lambda *_: None, roughly=True))
    additions = {
        "cogging": Addition(
            "wave", "drive.cogging", "axis_1", "torque", WAVE, ("amplitude", "order", "phase")
        ),
        "ripple": Addition(
            "wave",
            "drive.torque_ripple",
            "axis_1",
            "torque",
            WAVE,
            ("amplitude", "relative", "order", "phase"),
        ),
        "other": Addition(
            "wave", "drive.cogging", "axis_1", "torque", WAVE | {"order": 9.0}, ("amplitude", "phase")
        ),
    }
    return case, {name: case.fit(Hypothesis((one,)), lambda *_: None) for name, one in additions.items()}


@pytest.fixture(scope="module")
def step(waves: tuple[Case, dict[str, Fitted]]) -> Step:
    """Cogging as the cause, the two others told as what explains the data as well."""
    case, fits = waves
    uses = ("drive.cogging", "drive.torque_ripple")
    selection = Selection(case, uses, {}, np.random.default_rng(0), lambda *_: None, 1)
    plain = case.fit(Hypothesis(), lambda *_: None, roughly=True)
    hits = {hit.candidate.use: hit for hit in selection.searched(plain, None).found.hits}
    rivals = (
        Trial(fits["ripple"], 0.0, hits["drive.torque_ripple"], 0.0, 0.0),
        Trial(fits["other"], 0.0, hits["drive.cogging"], 0.0, 0.0),
    )
    names, nothing = fits["cogging"].hypothesis.additions[0].names, np.empty(0)
    return Step(
        "effect", *key_of(hits["drive.cogging"]), names, 0.0, 0.0, nothing, nothing, nothing,
        float("nan"), 3, rivals,
    )  # fmt: skip


def test_without_anything_found_later_ties_stay_as_they_were_judged(
    waves: tuple[Case, dict[str, Fitted]], step: Step
) -> None:
    case, fits = waves
    failures: list[Failure] = []
    (told,) = with_final_ties(case, fits["cogging"], (step,), failures, lambda *_: None)
    assert [one.fitted for one in told.rivals] == [fits["ripple"], fits["other"]]
    assert not failures


def test_beside_what_was_found_later_only_what_is_alike_stays_a_tie(
    waves: tuple[Case, dict[str, Fitted]], step: Step
) -> None:
    """The rival takes the place of its cause and nothing else; a wave of another order is a tie no more."""
    case, fits = waves
    later = replace(
        fits["cogging"], hypothesis=fits["cogging"].hypothesis.with_widened(("rotor_inertia.axis_1",))
    )
    failures: list[Failure] = []
    (told,) = with_final_ties(case, later, (step,), failures, lambda *_: None)
    assert told.ties == step.ties[:1]
    assert not failures
    (rival,) = told.rivals
    assert rival.fitted.hypothesis.widened == ("rotor_inertia.axis_1",)
    assert [one.use for one in rival.fitted.hypothesis.additions] == ["drive.torque_ripple"]
    amplitude, error = rival.fitted.estimate(rival.fitted.hypothesis.additions[0].names[0])
    assert abs(amplitude - WAVE["amplitude"]) < 4 * error


def test_progress_says_which_cause_is_fitted_and_beside_how_many(
    waves: tuple[Case, dict[str, Fitted]],
) -> None:
    case, fits = waves
    (wave,) = fits["cogging"].hypothesis.additions
    play = Addition("play", "transmission.backlash", "axis_1", "gear", {"gap": 1e-5}, ("gap",))
    notes: dict[str, None] = {}
    for hypothesis in (Hypothesis(), Hypothesis((wave,)), Hypothesis((wave, play))):
        case.fit(hypothesis, lambda *told: notes.setdefault(told[-1]), roughly=True)
    assert list(filter(None, notes)) == [
        "fitting all values",
        "fitting drive.cogging at axis_1 (torque)",
        "fitting transmission.backlash at axis_1 (gear), beside 1 more",
    ]
