"""Angles in a wrong unit are said to be that, in one sentence, before anything is fitted."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Context, DataRejected, Record, Robot
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects
from robid_diagnosis.impossible_motion import check_possible

PlantOf = Callable[[Robot, int], Robot]
COUNTS = 2**16 / (2 * np.pi)


def test_counts_taken_for_radians_are_told(
    told: Robot, plant_of: PlantOf, measured: Callable[..., Record]
) -> None:
    record = measured(plant_of(told, 5), 6)
    check_possible((record,), told)
    (run,) = record.runs
    angle = run.channel("motor_position")
    channels = {**run.channels, "motor_position": angle.replace(values=COUNTS * angle.values)}
    counted = record.replace(runs=(run.replace(channels=channels),))
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    with pytest.raises(
        DataRejected,
        match=r"motion is impossible for one_axis: axis_1 would turn at .*encoder counts or degrees",
    ):
        Effects().run((counted,), told, context)
