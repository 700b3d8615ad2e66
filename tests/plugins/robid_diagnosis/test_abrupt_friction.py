"""Diagnoses beside friction that turns abruptly, of a plant by hand: it is no cause, and hides none."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from oracles.sticking_rotor import record_of, robot, run

from robid_core import Context, Record
from robid_core.artifacts import Diagnosis
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects

RIPPLE = 0.02  # N m, of order 7


def diagnosed(seed: int, n_period: int, ripple: float, *, step: float = 0.0, width: float = 0.0) -> Diagnosis:
    runs = [run(10 * seed + k, n_period=n_period, ripple=ripple, step=step, width=width) for k in range(4)]
    return diagnosis_of(record_of(runs, n_period=n_period), prior={"rotor_inertia.*": 0.3})


def diagnosis_of(record: Record, **settings: object) -> Diagnosis:
    context = Context(np.random.default_rng(1), map_in_process, lambda *_: None, logging.getLogger("test"))
    settings |= {"separate": False, "response_check": (), "closed_loop": False}
    return Effects.model_validate(settings).run((record,), robot(), context)


@pytest.mark.parametrize("n_period", [1, 3], ids=["one cut", "periods"])
def test_abrupt_friction_is_no_cause(n_period: int) -> None:
    found = diagnosed(1, n_period, 0.0)
    assert not found.findings
    assert "where an axis turns back more abruptly than its angle resolves" in found.verdict


@pytest.mark.parametrize(
    ("n_period", "width"),
    [(1, 0.0), (3, 0.0), (3, 0.02)],
    ids=["one cut", "periods", "periods, within 0.02 rad/s"],
)
def test_a_ripple_is_named_beside_abrupt_friction(n_period: int, width: float) -> None:
    """Held at turns, or turning back faster than its angle shows."""
    found = diagnosed(2, n_period, RIPPLE, width=width)
    assert [(one.kind, one.effect, one.on) for one in found.findings] == [
        ("cause", "drive.cogging", "axis_1")
    ]
    (named,) = found.findings
    values = dict(zip(named.names, zip(named.value, named.standard_error, strict=True), strict=True))
    for name, true in (("amplitude", RIPPLE), ("order", 7.0)):
        value, error = values[name]
        assert abs(value - true) < 4 * error, name
        assert error < 0.01 * true, name


@pytest.mark.parametrize(
    ("n_period", "line"), [(3, "turns back more abruptly than"), (1, "turns back, torque is no")]
)
def test_turns_behind_a_coarse_encoder_do_not_count(n_period: int, line: str) -> None:
    """Of 0.3 mrad a step: its noise says so where motions repeat, what is left in one cut."""
    found = diagnosed(3, n_period, 0.0, step=3e-4)
    assert not found.findings
    assert line in found.verdict
    assert ("torque is no function" in found.verdict) == (n_period == 1)


def test_turns_count_where_hardly_a_sample_of_what_judges_would_be_left() -> None:
    """Noise says that they should not; in the experiment that judges the axis turns back all the time."""
    runs = [run(20 + k, n_period=3, width=0.05, slow=10.0 if k < 4 else 0.0) for k in range(5)]
    record = record_of(runs, n_period=3)
    judges = np.zeros(record.run.valid.shape[:3], dtype=bool)
    judges[..., -1] = True
    found = diagnosis_of(record.replace(runs=(record.run.replace(test=judges),)), only=("drive.cogging",))
    assert "more abruptly than its angle" not in found.verdict
