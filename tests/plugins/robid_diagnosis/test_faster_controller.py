"""A controller twice as fast as its recording: what it holds for half a sample is no lag of the current loop."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
import pytest

import robid_diagnosis.refit
from robid_acquisition.delays import moved_back_periodic
from robid_core import Context, Diagnosis, Record, Robot
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects

SENSORS, QUIETER = ("sensors.axis_1.torque_noise", "sensors.axis_1.position_noise"), 0.1


def explained(record: Record, told: Robot) -> Diagnosis:
    context = Context(
        np.random.default_rng(0), map_in_process, lambda *a, **k: None, logging.getLogger("test")
    )
    return Effects(separate=False, response_check=()).run((record,), told, context)


def test_what_is_held_for_half_a_sample_is_no_lag_of_the_current_loop(
    told: Robot,
    plant_of: Callable[[Robot, int], Robot],
    measured: Callable[..., Record],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nothing is hidden. Beside a delay alone the 0.3 % that a hold takes at 80 Hz is named a lag."""
    told = told.with_parameters({name: QUIETER * told.parameter(name) for name in SENSORS})
    record = measured(plant_of(told, 3), 5, faster=2).replace(torque_hold="continuous")
    diagnosis = explained(record, told)
    assert not diagnosis.findings, diagnosis.verdict
    assert "2 times as fast as the recording and holds each for 0.5 ms" in diagnosis.verdict
    assert "held_s: 0.0005" in diagnosis.verdict
    assert diagnosis.timing is not None
    assert diagnosis.timing.lag[0] == pytest.approx(-0.25, abs=0.005)  # half of the hold
    assert "leads its angle" not in diagnosis.verdict
    monkeypatch.setattr(robid_diagnosis.refit, "times_faster", lambda *_: None)
    alone = explained(record, told)
    assert [one.effect for one in alone.findings] == ["drive.current_loop"], alone.verdict


@pytest.mark.parametrize("louder", [1.0, 50.0])
def test_a_torque_that_is_only_late_is_not_called_held(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record], louder: float
) -> None:
    """A tenth of a sample by a hold of a fifth, 0.15 by the clock: together those of one of half a sample.

    Louder noise of the torque would be less behind a mean over half a sample.
    """
    noise = zip(SENSORS, (louder * QUIETER, QUIETER), strict=True)
    told = told.with_parameters({name: factor * told.parameter(name) for name, factor in noise})
    record = measured(plant_of(told, 3), 5, faster=5).replace(torque_hold="continuous")
    run = record.run
    early = [moved_back_periodic(lane, np.array([0.15])) for lane in run.lanes("motor_torque")]
    values = np.stack(early).reshape(run.values("motor_torque").shape)
    channels = {**run.channels, "motor_torque": run.channel("motor_torque").replace(values=values)}
    diagnosis = explained(record.replace(runs=(run.replace(channels=channels),)), told)
    assert not diagnosis.findings, diagnosis.verdict
    assert f"the torque of axis_1 leads its angle by 0.2{5 if louder == 1 else ''}" in diagnosis.verdict
    assert "as fast as the recording" not in diagnosis.verdict
