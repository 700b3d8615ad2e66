"""Friction of an arm's bearing, behind an elastic gear: it turns when the arm does, not when the motor does."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
from oracles.slide import slide

from robid_core import Context, Record, Robot
from robid_core.residual import effect_class
from robid_core.stage import map_in_process
from robid_diagnosis.candidates import spots
from robid_diagnosis.effects import Effects

FRICTION = ("friction.coulomb", "friction.coulomb_tanh", "friction.stribeck", "friction.viscous")


def test_friction_of_the_arm_is_named_where_it_acts(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record]
) -> None:
    """A fifth of that of the motor, whose place explains none of it: level and width within four standard errors."""
    plant = plant_of(told, 3)
    ratio = abs(1 / told.drives.gear[0, 0])
    values = {
        "coulomb": 0.2 * ratio * plant.parameter("friction.axis_1.coulomb"),
        "speed": 0.7 / ratio,
    }
    plant = plant.with_effect("hidden", "friction.coulomb_tanh", "axis_1", "arm", values)
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    stage = Effects.model_validate({"separate": False, "response_check": (), "only": FRICTION})
    (finding,) = stage.run((measured(plant, 4),), told, context).findings
    assert (finding.kind, finding.effect, finding.side) == ("cause", "friction.coulomb_tanh", "arm")
    assert set(finding.names) == set(values)
    for name, value, error in zip(finding.names, finding.value, finding.standard_error, strict=True):
        assert abs(value - values[name]) < 4 * error < 0.2 * values[name]


def test_where_a_gear_is_rigid_friction_is_tried_at_the_motor_alone(told: Robot, tmp_path: Path) -> None:
    coulomb = effect_class("friction.coulomb")
    assert [spot.side for spot in spots(told, coulomb)] == ["motor", "arm"]
    assert [spot.side for spot in spots(slide(tmp_path), coulomb)] == ["motor"]
