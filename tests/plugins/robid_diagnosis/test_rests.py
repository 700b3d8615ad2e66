"""Moves with rests and real stick, of a foreign plant: causes are those of the motion, and rests are none."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from oracles.one_motor import recorded, told

from robid_core import Context
from robid_core.artifacts import Diagnosis
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects

RIPPLE = 0.01, 3.0  # N m, a seventh of the Coulomb friction, and waves a turn
SECONDS = 5.0, 6.0, 7.0, 8.0


def diagnosed(folder: Path, seed: int, ripple: tuple[float, float], at_rest: str = "leave_out") -> Diagnosis:
    robot = told(folder)
    records = tuple(
        recorded(robot, seed + k, seconds, sticks=True, rest_s=(0.5, 2.0), ripple=ripple)
        for k, seconds in enumerate(SECONDS)
    )
    context = Context(np.random.default_rng(1), map_in_process, lambda *_: None, logging.getLogger("test"))
    settings = {"separate": False, "response_check": (), "closed_loop": False, "at_rest": at_rest}
    stage = Effects.model_validate({**settings, "prior": {"rotor_inertia.*": 0.3}, "highest_hz": 60.0})
    return stage.run(records, robot, context)


@pytest.mark.parametrize("seed", [201, *(pytest.param(n, marks=pytest.mark.full) for n in (101, 701))])
def test_a_hidden_ripple_is_named_beside_stick(tmp_path: Path, seed: int) -> None:
    found = diagnosed(tmp_path, seed, RIPPLE)
    named = [one for one in found.findings if one.kind != "unknown"]
    assert [(one.effect, one.on) for one in named] == [("drive.cogging", "a")]
    values = dict(zip(named[0].names, named[0].value, strict=True))
    assert values["amplitude"] == pytest.approx(RIPPLE[0], rel=0.05)
    assert values["order"] == pytest.approx(RIPPLE[1], abs=1e-3)
    assert "Samples at which friction holds an axis do not count in its torque: a " in found.verdict


@pytest.mark.parametrize("seed", [pytest.param(n, marks=pytest.mark.full) for n in (301, 401, 501, 601)])
def test_stick_is_no_cause(tmp_path: Path, seed: int) -> None:
    """What samples do not resolve of a rebound before a rest may be left, and said to be unknown."""
    assert not [one.effect for one in diagnosed(tmp_path, seed, (0.0, 1.0)).findings if one.kind != "unknown"]
