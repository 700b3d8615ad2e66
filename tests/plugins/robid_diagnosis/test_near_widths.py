"""Sizes of laws at a motor that turn their sign near to the speed at which its friction does, and not there."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from robid_core import Context, Record, Robot
from robid_core.artifacts import Diagnosis
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects
from robid_diagnosis.hypothesis import Addition, Case, Fitted, Hypothesis
from robid_diagnosis.likelihood import lost
from robid_diagnosis.near_widths import with_near_widths
from robid_diagnosis.search import Failure
from robid_diagnosis.written import ALONE

Plants = Callable[[Robot, int], Robot]
Measured = Callable[..., Record]
UNEVEN, FALLING, LOADED = "friction.asymmetric", "friction.stribeck", "friction.load_dependent"
NONE = {"viscous_forwards": 0.0, "viscous_backwards": 0.0, "coulomb_backwards": 0.0}
SEED = 201


def diagnosed(told: Robot, record: Record, use: str) -> Diagnosis:
    context = Context(np.random.default_rng(1), map_in_process, lambda *_: None, logging.getLogger("test"))
    stage = Effects.model_validate({"separate": False, "response_check": (), "only": (use,)})
    return stage.run((record,), told, context)


def values_of(use: str, level: float) -> dict[str, float]:
    """Numbers of a law beside Coulomb friction of a level, N m."""
    if use == UNEVEN:
        return {**NONE, "coulomb_forwards": 0.15 * level}
    falls = {"coulomb": 0.0, "stribeck_speed": 4.0, "viscous": 0.0}
    if use == FALLING:
        return {**falls, "exponent": 1.5, "breakaway": 0.3 * level}
    return {**falls, "exponent": 1.3, "load_coulomb": 0.06, "load_excess": 0.12}


@pytest.mark.parametrize(
    ("use", "names", "seed", "ratio"),
    [
        (UNEVEN, ("coulomb_forwards",), SEED, 0.8),
        pytest.param(UNEVEN, ("coulomb_forwards",), SEED, 1.25, marks=pytest.mark.full),
        pytest.param(UNEVEN, ("coulomb_forwards",), SEED, 1.0, marks=pytest.mark.full),
        pytest.param(LOADED, ("load_coulomb", "load_excess"), SEED, 0.8, marks=pytest.mark.full),
        pytest.param(LOADED, ("load_coulomb", "load_excess"), SEED, 1.25, marks=pytest.mark.full),
        pytest.param(FALLING, ("breakaway",), 204, 0.8, marks=pytest.mark.full),
        pytest.param(FALLING, ("breakaway",), 204, 1.25, marks=pytest.mark.full),
    ],
)
def test_a_size_and_its_error_know_that_a_law_turns_round_elsewhere(
    told: Robot,
    plant_of: Plants,
    measured: Measured,
    use: str,
    names: tuple[str, ...],
    seed: int,
    ratio: float,
) -> None:
    """With the motor's own width sizes of the first were 8.8 % off, eight stated errors, and of the fourth 44 %."""
    plant = plant_of(told, seed)
    width, level = (plant.parameter(f"friction.axis_1.{name}") for name in ("speed", "coulomb"))
    true = values_of(use, level) | {"speed": ratio * width}
    found = diagnosed(
        told, measured(plant.with_effect("hidden", use, "axis_1", "motor", true), seed + 1), use
    )
    (finding,) = found.findings
    assert (finding.effect, finding.on) == (use, "axis_1")
    assert "speed" not in finding.names  # no error of it could be stated
    value, error = (
        dict(zip(finding.names, one, strict=True)) for one in (finding.value, finding.standard_error)
    )
    for name in names:
        assert abs(value[name] - true[name]) < 3 * error[name]
        assert value[name] == pytest.approx(true[name], rel=0.04)
        assert error[name] < 0.04 * true[name]
    assert found.model is not None
    model = Robot.of_model(found.model)
    assert model.parameter("friction.axis_1.speed") == pytest.approx(width, rel=0.1)
    if use != FALLING:
        (speed,) = (name for name in model.layout if name.startswith("effect.") and name.endswith(".speed"))
        assert model.parameter(speed) == pytest.approx(ratio * width, rel=0.06)


@pytest.fixture(scope="module")
def written(told: Robot, plant_of: Plants, measured: Measured) -> Fitted:
    """Asymmetric friction that turns round as the motor's friction does, fitted with one width for both."""
    plant = plant_of(told, SEED)
    width, level = (plant.parameter(f"friction.axis_1.{name}") for name in ("speed", "coulomb"))
    values = values_of(UNEVEN, level) | {"speed": width}
    record = measured(plant.with_effect("hidden", UNEVEN, "axis_1", "motor", values), SEED + 1)
    case = Case((record,), told, {}, 100.0, 0, 12, 5e-4, friction_speed=np.array([width]), widths=ALONE)
    law = Addition("law", UNEVEN, "axis_1", "motor", values, ("coulomb_forwards",))
    return case.fit(Hypothesis((law,)), lambda *_: None)


def test_where_widths_are_alike_values_hardly_move_and_errors_grow(written: Fitted) -> None:
    failures = list[Failure]()
    found = with_near_widths(written, written.about, failures, lambda *_: None)
    assert not failures
    (before, error), (after, wider) = (
        one.estimate("effect.law.coulomb_forwards") for one in (written, found)
    )
    assert lost(found, written, written.about) <= 0
    assert abs(after - before) < wider
    assert error < wider < 2 * error


def test_laws_that_have_a_width_or_are_elsewhere_are_left_alone(written: Fitted) -> None:
    (law,) = written.hypothesis.additions
    for other in (law.with_own_width(), replace(law, side="arm")):
        fitted = replace(written, hypothesis=Hypothesis((other,)))
        assert with_near_widths(fitted, written.about, [], lambda *_: None) is fitted
