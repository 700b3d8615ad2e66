"""Sliders with a memory, against a closed form and the catalogue; what they tell of a law that lacks."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Context, Record, Robot
from robid_core.mechanics.law_along import law_along
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects
from robid_diagnosis.memory import STRIDE, sliders
from robid_effects.maxwell_slip import sliders as of_maxwell

Plants = Callable[[Robot, int], Robot]
Measured = Callable[..., Record]


def test_one_slider_has_the_loop_of_a_sine() -> None:
    """From a reversal on it moves with the motion until it slips: ``1 - (A - x) / r`` after the greatest position."""
    n, amplitude, slip = 4000, 0.7, 0.3
    position = amplitude * np.cos(2 * np.pi * np.arange(n) / n)[None]
    slid = sliders(position, np.array([slip]), repeats=True)[0, 0]
    downwards, way = slid[: n // 2], amplitude - position[0, : n // 2]
    in_a_step = STRIDE * 2 * np.pi * amplitude / n / slip
    np.testing.assert_allclose(downwards, np.maximum(1 - way / slip, -1), atol=in_a_step)
    np.testing.assert_allclose(slid[n // 2 :], -downwards, atol=in_a_step)


@pytest.mark.parametrize("repeats", [True, False])
def test_sliders_side_by_side_are_the_hysteresis_of_the_catalogue(repeats: bool) -> None:
    """Small reversals within large ones; its kernel takes steps of constant speed, and tells the middle of each."""
    n, step, values = 8000, 1e-3, {"stiffness": 40.0, "torque": 2.0, "spread": 30.0}
    time = 2 * np.pi * np.arange(n) / n
    position = np.array([0.2 * np.sin(time) + share * np.sin(9 * time) for share in (0.01, 0.1)])
    robot = Robot.load("one_axis").with_effect("h", "transmission.maxwell_slip", "axis_1", values=values)
    (term,) = (term for term in robot.forces if term.label == "h")
    moved = np.roll(position, -1, axis=1) - position
    law = law_along(term, position + moved / 2, moved / step, 0.0, step, settle=n if repeats else 0).force
    stiffness, level = of_maxwell(**values)
    slid = np.tensordot(level, sliders(position, level / stiffness, repeats=repeats), axes=1)
    middle = (slid + np.roll(slid, -1, axis=1)) / 2
    in_a_step = stiffness.sum() * STRIDE * np.abs(moved).max()
    np.testing.assert_allclose(middle[:, :-1], law[:, :-1], atol=in_a_step)
    assert np.ptp(law, axis=1).min() > 20 * in_a_step


def test_what_sticks_and_slides_otherwise_than_the_catalogue_says_is_told(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """With Dahl's friction and the like taken out a contact that lets go stands in for it, in most of what it does."""
    values = {"coulomb": 0.3, "stiffness": 60.0}
    plant = plant_of(told, 5).with_effect("hidden", "friction.dahl", "axis_1", values=values)
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    stage = Effects.model_validate(
        {"separate": False, "response_check": (), "only": ("friction.breakaway", "friction.stribeck")}
    )
    findings = stage.run((measured(plant, 6),), told, context).findings
    print([(f.kind, f.effect, f.gain) for f in findings])
    assert findings[-1].effect == "a function of motor displacement since a reversal"
    assert {finding.kind for finding in findings} <= {"partial", "unknown"}
