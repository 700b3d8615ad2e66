"""Recordings of uneven clocks on an even grid: what errors are told, and what gaps become."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_acquisition.arrangement import Arrangement
from robid_acquisition.pieces import pieces_between_holes
from robid_acquisition.recorded import RecordedAcquisition
from robid_acquisition.recording import Recording
from robid_acquisition.resampling import on_even_grid
from robid_acquisition.time_stamps import TimeStamps
from robid_core import Context, DataRejected, FloatArray, Record, Robot
from robid_core.residual import prescribe_record
from robid_core.stage import map_in_process
from robid_fit.rigid import RigidBodyFit
from robid_frf.spectral import Spectral

STEP = 1e-3
AXIS = {"rotor_inertia": 1e-3, "torque_limit": 10.0, "speed_limit": 100.0, "controller": {"speed_gain": 0.1}}
Read = Callable[..., Record]


@pytest.fixture(name="read")
def reading(tmp_path: Path) -> Read:
    """Return a function that saves instants and angles of an axis and reads them."""
    data = {"robid_robot": 1, "name": "test", "bodies": [{"joint": "axis_1", "mass": 1.0}], "axes": {
        "axis_1": {**AXIS, "gear_ratio": 10.0}}}  # fmt: skip
    (tmp_path / "robot.yaml").write_text(json.dumps(data))
    robot = Robot.load("robot.yaml", tmp_path)

    def read(time: FloatArray, angle: FloatArray, **settings: Any) -> Record:
        np.savez(tmp_path / "run.npz", t=time, q=angle)
        channels = {"motor_position": {"column": "q", "unit": "rad"}}
        words = {"path": "run.npz", "channels": channels, "time_column": "t", **settings}
        stage = RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)
        logger = logging.getLogger("test")
        context = Context(np.random.default_rng(0), map_in_process, lambda *_, **__: None, logger, tmp_path)
        return stage.run(robot, context)

    return read


def signal(time: FloatArray, share: float) -> FloatArray:
    """Fifteen sines up to a share of the Nyquist frequency of 1 ms."""
    draw = np.random.default_rng(1)
    frequency = draw.uniform(0.02, 1.0, 15) * share * 0.5 / STEP
    return np.cos(2 * np.pi * frequency * time[:, None] + draw.uniform(0, 2 * np.pi, 15)).sum(axis=1)


def jittered(share: float, n: int = 2000) -> FloatArray:
    time = STEP * (np.arange(n) + np.random.default_rng(2).uniform(-share, share, n))
    return time - time[0]


@pytest.mark.parametrize("method, share, jitter", [
    ("linear", 0.05, 0.2), ("linear", 0.3, 0.4), ("cubic", 0.05, 0.4), ("cubic", 0.4, 0.2),
])  # fmt: skip
def test_the_told_error_of_resampling_is_the_true_one_within_a_factor_of_three(
    method: Any, share: float, jitter: float
) -> None:
    time = jittered(jitter)
    step = TimeStamps.of(time).sample_time_s
    found, error = on_even_grid(
        {"q": signal(time, share)[:, None]}, np.ones(2000, dtype=bool), time, step, method
    )
    true = float(np.sqrt(np.mean((found["q"][:, 0] - signal(step * np.arange(len(found["q"])), share)) ** 2)))
    assert true / 3 < error["q"][0] < 3 * true


def test_the_told_error_of_resampling_holds_for_steps_too() -> None:
    """A square wave's error does not fall with the method's order: it is a step's height in the cells with a step."""
    time = jittered(0.4)

    def square(instant: FloatArray) -> FloatArray:
        return np.sign(np.sin(2 * np.pi * 13.7 * instant))

    step = TimeStamps.of(time).sample_time_s
    found, error = on_even_grid({"u": square(time)[:, None]}, np.ones(2000, dtype=bool), time, step, "cubic")
    true = float(np.sqrt(np.mean((found["u"][:, 0] - square(step * np.arange(len(found["u"])))) ** 2)))
    assert true / 3 < error["u"][0] < 3 * true


def test_what_is_held_keeps_its_values_until_the_next_one() -> None:
    time = jittered(0.4)
    values = np.random.default_rng(1).integers(0, 2, 2000).astype(np.float64)
    step = 0.5 * TimeStamps.of(time).sample_time_s
    found, error = on_even_grid(
        {"on": values[:, None], "q": signal(time, 0.1)[:, None]},
        np.ones(2000, dtype=bool),
        time,
        step,
        "linear",
        held=["on"],
    )
    for instant, value in zip(step * np.arange(len(found["on"])), found["on"][:, 0], strict=True):
        assert value == values[time <= instant + 1e-12][-1]
    assert error["on"][0] == 0 < error["q"][0]


@pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
def test_band_limited_resampling_brings_back_what_lies_below_the_nyquist_frequency(share: float) -> None:
    """With a jitter below a quarter of a sample (Kadec) even and uneven samples say the same; 1e-5 is the window's."""
    time = jittered(0.2)
    step = TimeStamps.of(time).sample_time_s
    found, error = on_even_grid(
        {"q": signal(time, share)[:, None]}, np.ones(2000, dtype=bool), time, step, "band_limited"
    )
    known = np.isfinite(found["q"][:, 0])
    difference = (found["q"][:, 0] - signal(step * np.arange(len(known)), share))[known]
    assert known.sum() > 1900
    assert np.sqrt(np.mean(difference**2)) < 1e-5
    assert np.sqrt(np.mean(difference**2)) < 3 * error["q"][0] < 1e-4


def test_an_uneven_clock_is_refused_with_its_percents_the_rate_and_the_key(read: Read) -> None:
    time = jittered(0.2)
    steps = np.diff(time)
    percent = 100 * np.abs(steps / steps.mean() - 1).max()
    words = rf"A10.*by up to {percent:.3g} % of a sample .*set resample: linear.*to an even {1 / steps.mean():.6g} Hz"
    with pytest.raises(DataRejected, match=words):
        read(time, signal(time, 0.1))


def test_resampling_warns_of_its_error_in_the_channels_unit(
    read: Read, caplog: pytest.LogCaptureFixture
) -> None:
    time = jittered(0.2)
    record = read(time, signal(time, 0.3), resample="cubic", torque_hold="zero_order_hold")
    (message,) = [one for one in caplog.messages if "resampled" in one]
    assert record.run.sample_time_s == pytest.approx(np.diff(time).mean())
    assert message.endswith("its torque is no longer held from sample to sample")
    told = float(message.split("motor_position ")[1].split(" rad")[0])
    true = record.run.values("motor_position").ravel() - signal(record.run.time_s, 0.3)
    assert np.sqrt(np.mean(true**2)) / 3 < told < 3 * np.sqrt(np.mean(true**2))


def test_another_rate_can_be_asked_for_but_no_slower_one(read: Read) -> None:
    time = jittered(0.2)
    record = read(time, signal(time, 0.1), resample="cubic", sample_time_s=0.0005)
    assert record.run.sample_time_s == 0.0005
    assert np.abs(record.run.values("motor_position").ravel() - signal(record.run.time_s, 0.1)).max() < 1e-3
    with pytest.raises(DataRejected, match="would fold"):
        read(time, signal(time, 0.1), resample="cubic", sample_time_s=0.002)


@pytest.mark.parametrize("step, told", [(0.0, "the clock stands"), (-0.5, "the clock runs back")])
def test_a_clock_that_does_not_run_forward_is_refused_whatever_is_asked(
    read: Read, step: float, told: str
) -> None:
    time = STEP * np.arange(100.0)
    time[60:] += time[59] - time[60] + STEP * step
    with pytest.raises(DataRejected, match=f"A10: {told}.*at sample 60 "):
        read(time, time, resample="linear")


def test_missing_rows_of_an_even_clock_are_holes_of_their_length(read: Read) -> None:
    time = np.delete(STEP * np.arange(200.0), slice(80, 91))
    with pytest.raises(DataRejected, match="A10: the clock jumps.*11 of 200 samples.*at sample 80;"):
        read(time, time)
    masked = read(time, time, gaps="mask").run
    assert np.flatnonzero(~masked.valid.ravel()).tolist() == list(range(80, 91))
    np.testing.assert_allclose(masked.values("motor_position").ravel()[masked.valid.ravel()], time)


@pytest.mark.parametrize("resample", ["linear", "cubic"])
def test_nothing_is_interpolated_across_a_gap_or_a_missing_value(read: Read, resample: str) -> None:
    time = np.delete(jittered(0.2, 400), slice(100, 120))
    angle = signal(time, 0.1)
    angle[250:255] = np.nan
    run = read(time, angle, resample=resample, gaps="mask").run
    valid = run.valid.ravel()
    instants = run.time_s[~valid]
    inside = [(time[99], time[100]), (time[249], time[255])]
    assert all(any(a <= one <= b for a, b in inside) for one in instants)
    assert len(instants) >= 20 + 5
    true = signal(run.time_s, 0.1)
    assert np.abs(run.values("motor_position").ravel() - true)[valid].max() < 0.3 * np.abs(true).max()


def test_pieces_between_gaps_become_experiments_as_long_as_leaves_most_samples(read: Read) -> None:
    """Runs of 300, 250 and 100 samples: two of 250 are more than three of 100 or one of 300."""
    number = np.concatenate([np.arange(300), np.arange(320, 570), np.arange(600, 700)]).astype(float)
    run = read(STEP * number, number, gaps="split").run
    assert run.values("motor_position").shape == (1, 1, 2, 1, 250, 1)
    np.testing.assert_array_equal(run.values("motor_position")[0, 0, :, 0, 0, 0], [0, 320])
    assert run.valid.all()


def test_missing_samples_are_no_jitter() -> None:
    """Stamps on a grid of which three are missing: nothing is uneven but what lacks, and that is told elsewhere."""
    number = np.delete(np.arange(3000.0), [400, 1200, 1201])
    stamps = TimeStamps.of(STEP * number)
    assert stamps.number is not None
    assert stamps.jitter() == ""
    moved = STEP * (number + 0.02 * np.random.default_rng(3).standard_normal(len(number)))
    assert "taken as even" in TimeStamps.of(moved).jitter()


def test_whole_periods_between_gaps_are_kept_in_phase(read: Read) -> None:
    number = np.delete(np.arange(1000.0), slice(340, 350))
    run = read(STEP * number, number, gaps="split", period_s=0.1).run
    position = run.values("motor_position")[0, 0, ..., 0]
    assert position.shape == (1, 6, 100)  # of the three periods before and the six behind
    np.testing.assert_array_equal(position[0, :, 0], np.arange(400.0, 1000.0, 100.0))


def test_masked_samples_are_kept_out_or_refused_by_the_stages_that_follow(read: Read, tmp_path: Path) -> None:
    """A motor of 2e-3 kg m^2: its response is 500 rad/s^2 per N m from the segments between holes alone."""
    draw = np.random.default_rng(5)
    time, period = STEP * np.arange(8000), 1.0
    lines = np.arange(4, 40)[:, None]
    torque = np.cos(2 * np.pi * lines * time / period + draw.uniform(0, 6, lines.shape)).sum(axis=0)
    spectrum = np.fft.rfft(torque)
    omega = 2 * np.pi * np.fft.rfftfreq(8000, STEP)
    angle = np.fft.irfft(np.concatenate([[0], -spectrum[1:] / (2e-3 * omega[1:] ** 2)]), 8000)
    angle[3100:3200] = np.nan
    channels = {
        "motor_position": {"column": "q", "unit": "rad"},
        "motor_torque": {"column": "u", "unit": "N m"},
    }
    np.savez(tmp_path / "two.npz", q=angle, u=torque)
    more = {"path": "two.npz", "channels": channels, "time_column": "", "sample_time_s": STEP}
    record = read(time, angle, gaps="mask", plausibility="ignore", **more)
    logger = logging.getLogger("test")
    context = Context(np.random.default_rng(0), map_in_process, lambda *_, **__: None, logger, tmp_path)
    frf = Spectral(segment_s=1.0, band_hz=(6.0, 36.0)).run(record, context)
    np.testing.assert_allclose(np.abs(frf.response[0, :, 0, 0]), 500.0, rtol=0.01)
    robot = Robot.load("robot.yaml", tmp_path)
    found = RigidBodyFit(unknowns=("rotor_inertia",), friction_speed=1.0).run(
        (record,), robot
    )  # 3.1 and 4.8 s
    inertia = found.parameters.as_mapping()["rotor_inertia.axis_1"]
    assert inertia == pytest.approx(2e-3, rel=0.02)  # twice the robot file's
    with pytest.raises(DataRejected, match="gaps: split"):
        prescribe_record(robot, record)


def test_a_file_of_which_no_piece_is_kept_is_named() -> None:
    """Files of 300 and 60 samples, the first with a hole: two pieces of 150 leave nothing of the short one."""
    long, short = (Recording(f"{name}.csv", experiment=e) for e, name in ((1, "long"), (2, "short")))
    known = {(0, 0, 0): np.arange(301) != 150, (0, 0, 1): np.ones(60, dtype=bool)}
    _, places, words = pieces_between_holes(Arrangement((((long, short),),), ()), known, STEP)
    assert {piece.place for piece in places.values()} == {(0, 0, 0)}
    assert "nothing of short.csv: pieces are equally long" in words
