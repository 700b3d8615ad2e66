"""A law of friction that turns round at another speed than the motor's Coulomb friction: named, with its own width."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Context, Record, Robot
from robid_core.artifacts import Diagnosis
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects

Plants = Callable[[Robot, int], Robot]
Measured = Callable[..., Record]
UNEVEN, FALLING = "friction.asymmetric", "friction.stribeck"
RIVALS = ("friction.eyring", "friction.power_law")
SIZES = {
    UNEVEN: {"coulomb_backwards": 0.0, "viscous_forwards": 0.0, "viscous_backwards": 0.0},
    FALLING: {"coulomb": 0.0, "stribeck_speed": 4.0, "exponent": 1.5, "viscous": 0.0},
}


def diagnosed(told: Robot, record: Record, only: tuple[str, ...]) -> Diagnosis:
    context = Context(np.random.default_rng(1), map_in_process, lambda *_: None, logging.getLogger("test"))
    stage = Effects.model_validate({"separate": False, "response_check": (), "only": only})
    return stage.run((record,), told, context)


@pytest.mark.parametrize(
    ("use", "size", "share", "seed", "factor", "misfit"),
    [
        pytest.param(UNEVEN, "coulomb_forwards", 0.2, 61, 0.3, 1.25, marks=pytest.mark.full),
        pytest.param(UNEVEN, "coulomb_forwards", 0.2, 61, 3.0, 1.1, marks=pytest.mark.full),
        pytest.param(FALLING, "breakaway", 0.4, 71, 0.3, 1.2, marks=pytest.mark.full),
    ],
)
def test_a_law_has_a_zero_speed_width_of_its_own(
    told: Robot, plant_of: Plants, measured: Measured, use: str, size: str, share: float, seed: int,
    factor: float, misfit: float,
) -> None:  # fmt: skip
    """With the motor's width misfits were 3.8, 3.2 and 5.7, and the first two had another, partial name.

    What is left of them is friction of the motor about a width that its law's own one blurs.
    """
    plant = plant_of(told, seed)
    width, level = (plant.parameter(f"friction.axis_1.{name}") for name in ("speed", "coulomb"))
    values = SIZES[use] | {size: share * level, "speed": factor * width}
    record = measured(plant.with_effect("hidden", use, "axis_1", "motor", values), seed + 1)
    found = diagnosed(told, record, (use, *(RIVALS if use == UNEVEN else ())))
    (finding,) = found.findings
    assert (finding.kind, finding.effect, finding.on) == ("cause", use, "axis_1")
    left = re.search(r"([\d.]+) with what was found", found.verdict)
    assert left is not None
    assert float(left[1]) < misfit
    estimated = dict(zip(finding.names, finding.value, strict=True))
    assert estimated["speed"] == pytest.approx(factor * width, rel=0.05)
    assert estimated[size] == pytest.approx(share * level, rel=0.05)
    assert found.model is not None
    assert Robot.of_model(found.model).parameter("friction.axis_1.speed") == pytest.approx(width, rel=0.15)
