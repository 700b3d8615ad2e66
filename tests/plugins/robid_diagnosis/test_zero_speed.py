"""Friction at zero speed beside causes: its width is fitted anew, and what is compared is compared with its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Record, Robot
from robid_diagnosis.hypothesis import Addition, Case, Fitted, Hypothesis
from robid_diagnosis.results import model_of
from robid_diagnosis.search import Failure
from robid_diagnosis.zero_speed import MOVED, with_own_width

HARD = Addition("hard", "transmission.stiffening", "axis_1", "gear", {"cubic": 6e9}, ("cubic",))
SIZES = {
    "coulomb_forwards": 0.12,
    "coulomb_backwards": 0.0,
    "viscous_forwards": 0.0,
    "viscous_backwards": 0.0,
}
CUBIC = 8e9


def asymmetric(speed: float) -> Addition:
    return Addition(
        "uneven", "friction.asymmetric", "axis_1", "motor", SIZES | {"speed": speed}, ("coulomb_forwards",)
    )


@pytest.fixture(scope="module")
def plant(told: Robot, plant_of: Callable[[Robot, int], Robot]) -> Robot:
    """A spring that hardens, and more friction forwards than backwards, which turns within 0.3 rad/s."""
    plant = plant_of(told, 61).with_parameters({"friction.axis_1.speed": 0.3})
    plant = plant.with_effect("hard", HARD.use, "axis_1", "gear", {"cubic": CUBIC})
    return plant.with_effect("uneven", "friction.asymmetric", "axis_1", "motor", SIZES | {"speed": 0.3})


@pytest.fixture(scope="module")
def fitted(told: Robot, plant: Robot, measured: Callable[..., Record]) -> Fitted:
    """Both causes fitted, their friction held at a width that is a tenth too large."""
    case = Case((measured(plant, 62),), told, {}, 100.0, 0, 12, 5e-4, friction_speed=np.array([0.33]))
    return case.fit(Hypothesis((HARD, asymmetric(0.33))), lambda *_: None)


@pytest.fixture(scope="module")
def found(fitted: Fitted) -> Fitted:
    """Fitted again, with the width that friction has beside these causes."""
    failures: list[Failure] = []
    fitted = with_own_width(fitted, failures, lambda *_: None)
    assert failures == []
    return fitted


def test_friction_is_fitted_with_the_width_that_it_has(fitted: Fitted, found: Fitted) -> None:
    assert abs(np.log(found.case.width[0] / 0.3)) < np.log(MOVED)
    assert found.hypothesis.additions[1].values["speed"] == pytest.approx(found.case.width[0])
    assert found.misfit < min(1.05, fitted.misfit)
    size, error = found.estimate("effect.uneven.coulomb_forwards")
    assert abs(size - 0.12) < 4 * error < 0.02 * 0.12


def test_the_robot_that_is_written_tells_the_width_that_was_told(told: Robot, found: Fitted) -> None:
    """It is set and not estimated, and its file says what it was before."""
    model = model_of(told, found)
    place = model.names.index("friction.axis_1.speed")
    assert model.value[place] == pytest.approx(0.3, rel=0.02)
    assert model.start[place] == told.parameter("friction.axis_1.speed") == 0.5
    assert "friction.axis_1.speed" not in model.free_names


def test_a_spring_that_hardens_is_as_stiff_as_its_error_says(found: Fitted) -> None:
    """With derivatives along the springs alone passes stood still, or crept, 15 stated errors away."""
    assert found.solution.converged
    cubic, error = found.estimate("effect.hard.cubic")
    assert abs(cubic - CUBIC) < 4 * error < 0.01 * CUBIC
