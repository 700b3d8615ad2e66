"""Periods and lines that nobody told are found, and claims of them are held against the data."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from robid_acquisition.claimed_period import doubts_of_period, samples_of_period
from robid_acquisition.excited_lines import doubts_of_lines, find_lines
from robid_acquisition.recorded import RecordedAcquisition
from robid_core import Context, DataRejected, FloatArray, Record, Robot
from robid_core.stage import map_in_process

STEP = 1e-3
N_PERIOD, N_SAMPLE = 4, 1000
LINES = [3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47]
Read = Callable[..., Record]


def multisine(lines: list[int], n_sample: float = N_SAMPLE, n_all: int = N_PERIOD * N_SAMPLE) -> FloatArray:
    """Cosines of amplitude 1 at some lines, (n_all, 1)."""
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, (len(lines), 1))
    turns = 2 * np.pi * np.array(lines)[:, None] * np.arange(n_all) / n_sample
    return np.cos(turns + phase).sum(axis=0)[:, None]


def noise(share: float, n_all: int = N_PERIOD * N_SAMPLE) -> FloatArray:
    return share * np.random.default_rng(1).normal(size=(n_all, 1))


@pytest.fixture(scope="module")
def moved() -> dict[str, FloatArray]:
    """References, torques and angles of the six-axis robot with friction, from rest, a slow sine beneath the lines."""
    robot = Robot.load("six_axis")
    draw = np.random.default_rng(0)
    time = np.arange(N_PERIOD * N_SAMPLE) / N_SAMPLE
    phase = draw.uniform(0, 2 * np.pi, (6, len(LINES), 1))
    waves = np.cos(2 * np.pi * np.array(LINES)[:, None] * time + phase).sum(axis=1)
    slow = np.sin(2 * np.pi * time + draw.uniform(0, 2 * np.pi, (6, 1)))
    reference = (4 * waves / waves.std() + 10 * slow).T
    done = robot.simulate(reference[None], draw.uniform(-0.6, 0.6, (1, 6)), seed=3)
    return {"w": reference, "q": done.position[0], "tau": done.torque[0]}


@pytest.fixture(name="read")
def reading(tmp_path: Path, moved: dict[str, FloatArray]) -> Read:
    robot = Robot.load("six_axis")
    np.savez(tmp_path / "run.npz", **moved)

    def read(reference: bool, **settings: Any) -> Record:
        channels = {
            "motor_position": {"column": "q", "unit": "rad"},
            "motor_torque": {"column": "tau", "unit": "N m"},
        }
        if reference:
            channels["speed_reference"] = {"column": "w", "unit": "rad/s"}
        words = {
            "path": "run.npz",
            "sample_time_s": STEP,
            "channels": channels,
            "plausibility": "ignore",
            **settings,
        }
        stage = RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)
        logger = logging.getLogger("test")
        context = Context(np.random.default_rng(0), map_in_process, lambda *_, **__: None, logger, tmp_path)
        return stage.run(robot, context)

    return read


@pytest.mark.parametrize("reference", [True, False])
def test_period_and_lines_are_found_through_friction_and_a_slow_sine(
    read: Read, reference: bool, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO):
        record = read(reference, period_s="auto", lines="auto", torque_hold="zero_order_hold")
    assert (record.run.n_period, len(record.run.time_s)) == (N_PERIOD, N_SAMPLE)
    assert record.line is not None
    assert record.line.tolist() == LINES
    assert (
        f"lines: auto: in {'speed_reference' if reference else 'motor_torque'}, 14 lines stand out"
        in caplog.text
    )
    assert "line 1 is left out as the slow sine" in caplog.text
    assert "run.npz: the first period differs from the last by" in caplog.text


def test_a_record_that_repeats_and_has_no_period_is_told_so(
    read: Read, caplog: pytest.LogCaptureFixture
) -> None:
    read(reference=False)
    assert (
        "run.npz: it repeats every 1 s (4 times), and no period_s is given; with period_s: auto"
        in caplog.text
    )
    caplog.clear()
    read(reference=False, period_s=1.0)
    read(reference=False, drop_first_s=1.5, drop_last_s=1.0)  # a period and a half
    assert "no period_s is given" not in caplog.text


@pytest.mark.parametrize("share", [0.0, 0.3])
@pytest.mark.parametrize("n_sample", [250, 333, 1000, 2000])
def test_a_whole_period_is_found_to_the_sample_in_noise(n_sample: int, share: float) -> None:
    signal = multisine([1, 2, 5, 9, 14, 27, 40], n_sample)
    assert samples_of_period(signal + noise(share * signal.std()), STEP) == n_sample


@pytest.mark.parametrize("signal, told", [
    (noise(1.0), "nothing repeats within 2 s, half of the recording"),
    (multisine([1, 2, 3, 5, 8], 2500), "nothing repeats"),  # less than two periods
    (multisine([1, 2, 3, 5, 8], 432.37), r"A09.*repeats every (0.43237|0.86474|1.2971|1.72948)"),
    (np.zeros((4000, 1)), "nothing moves"),
])  # fmt: skip
def test_what_does_not_repeat_in_whole_samples_is_refused(signal: FloatArray, told: str) -> None:
    with pytest.raises(DataRejected, match=told):
        samples_of_period(signal, STEP)


def test_a_wrong_period_is_refused_with_the_right_one_and_a_right_one_is_not_doubted() -> None:
    signal = multisine(LINES) + noise(0.1)
    assert doubts_of_period(signal, N_SAMPLE, STEP) == []
    assert doubts_of_period(signal, 2 * N_SAMPLE, STEP) == []
    with pytest.raises(
        DataRejected, match="A09: the recording repeats every 1 s; after the period_s of 0.9 s"
    ):
        doubts_of_period(signal, 900, STEP)


def test_a_period_that_is_a_sample_wrong_is_told() -> None:
    """Of sines below line 8 a sample moves 2 pi 8 / 1000 = 5 % at most."""
    (words,) = doubts_of_period(multisine([2, 3, 5, 8]) + noise(1e-3), N_SAMPLE + 1, STEP)
    assert "repeats every 1 s; after the period_s of 1.001 s it differs from itself by" in words


def test_a_first_period_that_has_not_settled_is_told() -> None:
    signal = multisine(LINES) + noise(0.02)
    rung = 0.5 * np.exp(-np.arange(len(signal)) / 200)[:, None]
    (words,) = doubts_of_period(signal + rung, N_SAMPLE, STEP)
    # rms over a period of 0.5 exp(-k/200) is 0.5 sqrt(200 / 2 / 1000) = 0.158, of a signal of rms sqrt(14 / 2).
    share = 100 * np.hypot(0.158, 0.02 * np.sqrt(2)) / np.sqrt(7)
    assert float(words.split("by ")[1].split(" %")[0]) == pytest.approx(share, rel=0.05)
    assert "has not settled" in words


@pytest.mark.parametrize("n_period", [1, 4])
def test_lines_on_a_sparse_grid_and_where_all_bins_are_excited(n_period: int) -> None:
    """Of a single period only sparse lines can be told from their neighbours."""
    sparse = (multisine(LINES) + noise(0.05)).reshape(1, N_PERIOD, N_SAMPLE, 1)[:, :n_period]
    assert find_lines(sparse)[0].tolist() == LINES
    every = list(range(4, 120))
    full = (multisine(every) + noise(0.3)).reshape(1, N_PERIOD, N_SAMPLE, 1)[:, :n_period]
    if n_period > 1:
        assert find_lines(full)[0].tolist() == every


def test_lines_that_do_not_stand_out_are_told_and_impossible_ones_refused() -> None:
    signal = (multisine(LINES) + noise(0.1)).reshape(1, N_PERIOD, N_SAMPLE, 1)
    assert doubts_of_lines(signal, np.array(LINES)) == []
    (words,) = doubts_of_lines(signal, np.array([*LINES, 4, 60]))
    assert words == "lines: 2 of 16 do not stand out from the noise at any axis: 4, 60"
    with pytest.raises(
        DataRejected, match="lines: 501 lies above the Nyquist frequency, a period has 1000 samples"
    ):
        doubts_of_lines(signal, np.array([3, 501]))


def test_claims_are_checked_where_a_record_is_made(read: Read, caplog: pytest.LogCaptureFixture) -> None:
    read(False, period_s=1.0, lines=[3, 4, 5], torque_hold="zero_order_hold")
    assert "lines: 1 of 3 do not stand out from the noise at any axis: 4 (motor_torque)" in caplog.text
    assert "the first period differs from the last by" in caplog.text
    with pytest.raises(DataRejected, match="repeats every 1 s"):
        read(False, period_s=0.8, lines=[3], torque_hold="zero_order_hold")


def test_lines_in_hz_are_refused() -> None:
    words = {"path": "run.npz", "sample_time_s": 1e-3, "period_s": 4.0, "lines": [4.125, 5.5], "channels": {}}
    with pytest.raises(
        ValidationError, match="4.125 is no whole number: lines count the periods of a sine in"
    ):
        RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)


def test_the_hold_of_the_torque_must_be_said_with_lines() -> None:
    words = {"path": "a.npz", "sample_time_s": STEP, "period_s": 1.0, "lines": [3], "channels": {
        "motor_position": {"column": "q", "unit": "rad"}}}  # fmt: skip
    with pytest.raises(ValidationError, match="torque_hold is missing, which lines go with"):
        RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)
