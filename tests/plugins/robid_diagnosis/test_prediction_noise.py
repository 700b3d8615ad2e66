"""The noise floor of a prediction: what the plant's own model leaves, in any band."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from robid_core import Context, Diagnosis, Record, Robot
from robid_core.stage import map_in_process
from robid_diagnosis.prediction import Prediction


def predicted(record: Record, robot: Robot, highest_hz: float) -> Diagnosis:
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    return Prediction(highest_hz=highest_hz).run((record,), robot, context)


@pytest.mark.parametrize("highest_hz", [20.0, 100.0])
def test_the_right_model_leaves_the_noise_and_a_wrong_one_more(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record], highest_hz: float
) -> None:
    """Noise of twelve experiments, from the difference of two periods each: known to some percent."""
    plant = plant_of(told, 4)
    record = measured(plant, 5, n_config=6)
    right, wrong = (predicted(record, one, highest_hz) for one in (plant, told))
    (error,) = right.errors
    assert error.noise is not None
    assert error.relative[0] == pytest.approx(error.noise[0], rel=0.08)
    assert f"noise alone leaves {100 * error.noise[0]:.3g} %" in right.verdict
    assert wrong.errors[0].relative[0] > 2 * error.relative[0]
    floor = wrong.errors[0].noise
    assert floor is not None
    assert floor[0] == pytest.approx(error.noise[0], rel=0.3)


def once(record: Record) -> Record:
    """Two periods as one motion that does not repeat."""
    run = record.run
    shape = (run.channel("motor_torque").values.shape[0], 1, 2, 1, 2 * len(run.time_s), 1)
    channels = {n: one.replace(values=one.values.reshape(shape)) for n, one in run.channels.items()}
    time = run.sample_time_s * np.arange(shape[4])
    whole = run.replace(channels=channels, time_s=time, valid=np.ones(shape[:5], dtype=bool))
    return record.replace(runs=(whole,), line=None)


@pytest.mark.parametrize("highest_hz", [20.0, 100.0])
def test_of_a_motion_that_does_not_repeat_sensors_say_what_noise_leaves(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record], highest_hz: float
) -> None:
    """Their noise is that of the robot file, which is the plant's."""
    plant = plant_of(told, 4)
    record = once(measured(plant, 5, n_config=6))
    (error,) = predicted(record, plant, highest_hz).errors
    assert error.noise is not None
    assert error.relative[0] == pytest.approx(error.noise[0], rel=0.08)
    (wrong,) = predicted(record, told, highest_hz).errors
    assert wrong.relative[0] > 2 * error.relative[0]


def test_without_noise_in_the_robot_file_nothing_is_said(
    tmp_path: Path, told: Robot, measured: Callable[..., Record]
) -> None:
    text = told.to_yaml()
    assert "torque_noise" in text
    (tmp_path / "silent.yaml").write_text(re.sub("torque_noise: [^,}\n]*", "torque_noise: 0", text))
    diagnosis = predicted(once(measured(told, 5)), Robot.load("silent.yaml", tmp_path), 100.0)
    assert diagnosis.errors[0].noise is None
    assert "noise alone" not in diagnosis.verdict
