"""What a channel map makes of columns: zeros, delays, wrapped counts, drives not enabled, torques of motors."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from robid_acquisition.delays import moved_back
from robid_acquisition.recorded import RecordedAcquisition
from robid_acquisition.unwrapping import unwrapped
from robid_core import Context, DataRejected, FloatArray, Record, Robot
from robid_core.stage import map_in_process

AXIS = {"rotor_inertia": 1e-3, "torque_limit": 10.0, "speed_limit": 100.0, "controller": {"speed_gain": 0.1}}
Read = Callable[..., Record]


def robot_of(folder: Path, n_axis: int) -> Robot:
    names = [f"axis_{i + 1}" for i in range(n_axis)]
    data = {
        "robid_robot": 1, "name": "test", "axes": {name: {**AXIS, "gear_ratio": 10.0} for name in names},
        "bodies": [{"joint": one, "parent": names[i - 1] if i else None, "mass": 1.0} for i, one in enumerate(names)],
    }  # fmt: skip
    (folder / "robot.yaml").write_text(json.dumps(data))
    return Robot.load("robot.yaml", folder)


@pytest.fixture(name="read")
def reading(tmp_path: Path) -> Read:
    """Return a function that saves columns and reads them by a channel map; two axes."""
    robot = robot_of(tmp_path, 2)

    def read(columns: dict[str, FloatArray], channels: dict[str, Any], **settings: Any) -> Record:
        np.savez(tmp_path / "run.npz", **columns)
        words = {"path": "run.npz", "plausibility": "ignore", "channels": channels, **settings}
        if "time_column" not in words:
            words["sample_time_s"] = 0.001
        stage = RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)
        logger = logging.getLogger("test")
        context = Context(np.random.default_rng(0), map_in_process, lambda *_, **__: None, logger, tmp_path)
        return stage.run(robot, context)

    return read


def values(record: Record, name: str) -> FloatArray:
    """Samples of the only experiment, (n_sample, n_axis)."""
    given = record.run.values(name)
    return given.reshape(-1, given.shape[-1])


def multisine(time: FloatArray, period: float, highest: int, seed: int = 0) -> FloatArray:
    """Cosines at every bin below `highest` of a period, two axes."""
    draw = np.random.default_rng(seed)
    bins = np.arange(1, highest)[:, None, None]
    phase = draw.uniform(0, 2 * np.pi, (highest - 1, 1, 2))
    return np.cos(2 * np.pi * bins * time[:, None] / period + phase).mean(axis=0)


def test_a_zero_is_taken_off_before_the_scale(read: Read) -> None:
    counts = np.arange(40.0)[:, None] * [1.0, 2.0] + [100, 300]
    channel = {
        "column": "q",
        "unit": "counts",
        "unit_to": "rad",
        "zero": [100, 300],
        "scale": 0.5,
        "sign": [1, -1],
    }
    record = read({"q": counts}, {"motor_position": channel})
    np.testing.assert_array_equal(
        values(record, "motor_position"), 0.5 * np.arange(40.0)[:, None] * [1.0, -2.0]
    )


def test_a_periodic_channel_is_moved_back_exactly(read: Read) -> None:
    """Delays of 0.37 and -1.2 samples: whole periods are a Fourier series, so that nothing but rounding is left."""
    time = np.arange(800.0)
    late = np.stack([multisine(time - d, 200, 95)[:, a] for a, d in enumerate((0.37, -1.2))], axis=1)
    channel = {"column": "q", "unit": "rad", "delay_s": [0.37e-3, -1.2e-3]}
    record = read({"q": late}, {"motor_position": channel}, period_s=0.2)
    assert record.run.n_period == 4
    assert np.abs(values(record, "motor_position") - multisine(time, 200, 95)).max() < 1e-9


def test_a_motion_that_does_not_repeat_is_moved_back_and_its_ends_are_cut(read: Read) -> None:
    time = np.arange(600.0)
    sine = np.sin(2 * np.pi * 0.38 * time)[:, None] * [1.0, 1.0]  # 0.76 of the Nyquist frequency
    late = np.sin(2 * np.pi * 0.38 * (time - 2.6))[:, None] * [1.0, 1.0]
    channels = {"motor_position": {"column": "q", "unit": "rad", "delay_s": 0.0026}, "motor_speed": {
        "column": "v", "unit": "rad/s"}}  # fmt: skip
    record = read({"q": late, "v": sine}, channels)
    found = values(record, "motor_position")
    # Windows reach 32 samples to either side of a place 2.6 samples later.
    assert len(found) == 600 - 29 - 34
    np.testing.assert_array_equal(values(record, "motor_speed"), sine[29:-34])
    assert np.abs(found - sine[29:-34]).max() < 1e-5


@pytest.mark.parametrize("frequency", [0.01, 0.2, 0.4])
def test_the_stated_error_of_the_windowed_sinc_holds(frequency: float) -> None:
    """1e-5 of a sine up to 0.8 of the Nyquist frequency, over delays of all parts of a sample."""
    time, worst = np.arange(300.0), 0.0
    for delay in np.linspace(0.05, 0.95, 7):
        found, known = moved_back(np.sin(2 * np.pi * frequency * time)[:, None], np.array([delay]))
        true = np.sin(2 * np.pi * frequency * (time + delay))[:, None]
        worst = max(worst, float(np.abs(found - true)[known].max()))
    assert worst < 1e-5


def test_a_whole_delay_is_a_plain_shift() -> None:
    given = np.random.default_rng(0).normal(size=(50, 1))
    found, known = moved_back(given, np.array([3.0]))
    np.testing.assert_array_equal(found[known], given[3:])
    assert known.sum() == 47


@pytest.mark.parametrize("period_s", [0.2, None])
def test_of_a_torque_that_was_held_for_half_a_sample_the_mean_acts(
    read: Read, period_s: float | None
) -> None:
    """Of a sine the mean over half a sample before: a quarter of a sample late, sin(x) / x as large, x = w h / 2.

    Beside a delay of 0.3 samples, undone. Exact where it repeats; else 1e-5 below 0.8 of the Nyquist frequency.
    """
    time, omega = np.arange(800.0), 2 * np.pi * 0.38
    late = np.sin(omega * (time - 0.3))[:, None] * [1.0, 1.0]
    channel = {"column": "u", "unit": "N m", "delay_s": 3e-4, "held_s": 5e-4}
    settings = {} if period_s is None else {"period_s": period_s}
    found = values(read({"u": late}, {"motor_torque": channel}, **settings), "motor_torque")
    first = 0 if period_s else 31  # windows reach 32 samples to either side of a place 0.05 samples later
    acting = np.sinc(omega * 0.25 / np.pi) * np.sin(omega * (time[first : first + len(found)] - 0.25))
    assert np.abs(found - acting[:, None]).max() < (1e-9 if period_s else 1e-5)
    assert len(found) == (800 if period_s else 800 - 31 - 32)


def test_a_hold_is_of_a_torque_and_shorter_than_a_sample(read: Read) -> None:
    torque = {"column": "u", "unit": "N m", "held_s": 2e-3}
    ramp = np.arange(80.0)[:, None] * [1.0, 1.0]
    with pytest.raises(DataRejected, match="held_s: 0.002 s is longer than a sample of 0.001 s"):
        read({"u": ramp}, {"motor_torque": torque})
    with pytest.raises(ValidationError, match="state torque_hold: continuous"):
        read({"u": ramp}, {"motor_torque": torque | {"held_s": 5e-4}}, torque_hold="zero_order_hold")
    with pytest.raises(ValidationError, match="how long a controller holds a motor_torque, and nothing else"):
        read({"u": ramp}, {"motor_position": torque | {"unit": "rad"}})


def test_counts_are_unwrapped_over_many_turns(read: Read) -> None:
    turns = 3.2 * np.sin(0.01 * np.arange(1000.0))[:, None] * [1.0, -1.0]
    counts = np.floor(4096 * turns) % 4096
    channel = {"column": "q", "unit": "counts", "unit_to": "rad", "wrap": 4096, "scale": 2 * np.pi / 4096}
    found = values(read({"q": counts}, {"motor_position": channel}), "motor_position")
    # A step of quantisation, and what the first count leaves open: whole turns.
    assert np.abs(found - found[0] - 2 * np.pi * (turns - turns[0])).max() < 2 * 2 * np.pi / 4096


@pytest.mark.parametrize(
    "values_of, told",
    [
        (np.arange(20.0) * 170 % 360, "at sample 1 may have gone either way"),  # nearly half a turn each
        (np.arange(20.0) * 40, "span 760 and cannot wrap at 360"),
    ],
)
def test_what_cannot_be_unwrapped_is_refused(values_of: FloatArray, told: str) -> None:
    with pytest.raises(DataRejected, match=told):
        unwrapped(values_of, 360.0, np.arange(20.0), "angle")


def test_a_hole_that_is_too_long_for_the_speed_is_not_unwrapped_across() -> None:
    angle = np.arange(40.0) * 30 % 360
    angle[10:14] = np.nan
    with pytest.raises(DataRejected, match="at sample 14"):  # five steps of 30 degrees
        unwrapped(angle, 360.0, np.arange(40.0), "angle")
    angle[12:14] = np.arange(12.0, 14.0) * 30 % 360
    np.testing.assert_allclose(
        unwrapped(angle, 360.0, np.arange(40.0), "angle")[12:], 30 * np.arange(12.0, 40.0)
    )


def test_samples_of_drives_that_are_not_enabled_are_refused_masked_or_cut_out(read: Read) -> None:
    q = np.arange(100.0)[:, None] * [1.0, 1.0]
    state = np.full(100, 5.0)
    state[40:50] = 3.0
    channels = {"motor_position": {"column": "q", "unit": "rad", "enable": {"column": "state", "value": 5}}}
    columns = {"q": q, "state": state}
    with pytest.raises(
        DataRejected, match="A08.*motor_position: 10 of 100 samples are not enabled.*at sample 40;"
    ):
        read(columns, channels)
    assert len(values(read(columns, channels, stop_s=0.04), "motor_position")) == 40
    masked = read(columns, channels, gaps="mask").run
    np.testing.assert_array_equal(masked.valid.ravel(), state == 5)
    assert np.isnan(masked.values("motor_position")[..., 40:50, :]).all()
    pieces = read(columns, channels, gaps="split").run.values("motor_position")
    assert pieces.shape == (1, 1, 2, 1, 40, 2)
    np.testing.assert_array_equal(pieces[0, 0, :, 0, 0, 0], [0, 50])


def test_a_torque_from_a_current_takes_a_torque_constant_for_each_axis(read: Read) -> None:
    current = np.random.default_rng(0).normal(size=(30, 2))
    channel = {"column": "i", "unit": "mA", "torque_constant": [0.05, 1.81]}
    record = read({"i": current}, {"motor_torque": channel})
    assert record.run.channel("motor_torque").unit_symbol == "N m"
    np.testing.assert_allclose(values(record, "motor_torque"), current * 1e-3 * [0.05, 1.81])


def test_a_torque_from_a_voltage_meets_the_equation_of_the_motor(read: Read) -> None:
    """V = R i + kt w with a known current, under a bridge's duty; the speed recorded, or of a parabola's angle."""
    time = 1e-3 * np.arange(200.0)[:, None] * [1.0, 1.0]
    current, speed = np.cos(40 * time), 3.0 - 20.0 * time
    resistance, constant = np.array([2.0, 9.0]), np.array([0.3, 0.8])
    voltage, supply = resistance * current + constant * speed, 12 + time
    law = {
        "column": "v",
        "duty": "pwm",
        "duty_scale": 1 / 885,
        "resistance": [2.0, 9.0],
        "torque_constant": [0.3, 0.8],
    }
    columns = {"v": supply, "pwm": 885 * voltage / supply, "w": speed, "q": 3.0 * time - 10.0 * time**2}
    for other in (
        {"motor_speed": {"column": "w", "unit": "rad/s"}},
        {"motor_position": {"column": "q", "unit": "rad"}},
    ):
        record = read(columns, {"motor_torque": {"voltage": law}, **other})
        np.testing.assert_allclose(values(record, "motor_torque"), constant * current, atol=1e-10)
        assert "computed from the voltage by a model of the motor" in record.source
    with pytest.raises(DataRejected, match="needs the channel motor_speed, or motor_position"):
        read(columns, {"motor_torque": {"voltage": law}})


def test_what_a_controller_computed_is_kept_but_is_no_torque_of_a_fit(read: Read) -> None:
    channel = {"column": "tau", "unit": "N m", "computed": True}
    kept = read({"tau": np.ones((20, 2))}, {"model_torque": channel})
    np.testing.assert_array_equal(values(kept, "model_torque"), 1)
    with pytest.raises(
        ValidationError, match="what the controller computed is not measured; keep it under another"
    ):
        read({"tau": np.ones((20, 2))}, {"motor_torque": channel})


@pytest.mark.parametrize(
    "channel, told",
    [
        ({"column": "i", "unit": "V", "torque_constant": 1.0}, "torque_constant goes with a current in A, not with V"),
        ({"column": "i", "unit": "A"}, "A is no unit of torque; give torque_constant here .*, or scale"),
        ({"column": "i", "unit": "N m", "voltage": {"column": "v", "resistance": 1, "torque_constant": 1}},
         "leave out column, unit"),
        ({}, "column is missing"),
        ({"column": [2, 3], "unit": "A"}, "columns have names, no numbers: write those of the file's first line"),
        ({"column": "i", "unit": "A", "torque_constant": [0.35, -0.22]}, r"has no sign; .* give sign: \[1, -1\]"),
        ({"column": "i", "unit": "A", "torque_constant": -0.2}, "has no sign; leave it positive and give sign: -1"),
        ({"column": "i", "unit": "oz-in"}, "'oz-in' is not known; write scale: 0.00706155181 and unit_to: N m"),
        ({"column": "i", "unit": "ft lbf"}, "write scale: 1.35581795 and unit_to: N m"),
        ({"column": "i", "unit": "kgf·cm"}, "write scale: 0.0980665 and unit_to: N m"),
        ({"column": "i", "unit": "%"}, "'%' is not known; of what.*scale"),
        ({"column": "i", "unit": "kNm"}, "did you mean 'kN m'.*give scale and unit_to"),
        ({"column": "i", "unit": "N m", "wrap": 0}, "greater than 0"),
    ],
)  # fmt: skip
def test_what_contradicts_itself_is_refused(channel: dict[str, Any], told: str) -> None:
    words = {"path": "run.npz", "sample_time_s": 0.1, "channels": {"motor_torque": channel}}
    with pytest.raises(ValidationError, match=told):
        RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)


@pytest.mark.parametrize("key, given", [("zero", [1, 2, 3]), ("delay_s", [0.1, 0.2, 0.3])])
def test_a_list_for_other_axes_is_told_by_its_key(read: Read, key: str, given: list[float]) -> None:
    with pytest.raises(DataRejected, match=f"channels.motor_position.{key}: 3 numbers for 2 axes"):
        read({"q": np.ones((200, 2))}, {"motor_position": {"column": "q", "unit": "rad", key: given}})


def test_a_filter_takes_what_is_fast_from_all_channels_and_nothing_of_what_is_slow(read: Read) -> None:
    """A Butterworth of order 4, both ways: 1 / (1 + (f / f_c)^8) of the amplitude, no phase."""
    time = 1e-3 * np.arange(4000.0)[:, None] * [1.0, 1.0]
    slow, fast = np.sin(2 * np.pi * 2 * time), np.sin(2 * np.pi * 80 * time)
    channels = {"motor_position": {"column": "q", "unit": "rad"}}
    settings = {"filter": {"low_pass_hz": 20}, "drop_first_s": 0.5, "drop_last_s": 1.0}
    found = values(read({"q": slow + fast}, channels, **settings), "motor_position")
    assert len(found) == 2500
    # tan(pi f T) / tan(pi f_c T) is what the bilinear transform makes of f / f_c.
    left = 1 / (1 + (np.tan(np.pi * 0.08) / np.tan(np.pi * 0.02)) ** 8)
    assert np.abs(found - slow[500:3000]).max() < 1.1 * left + 1e-6


def test_numbers_of_a_file_become_constants_of_its_experiments(read: Read) -> None:
    channels = {"motor_position": {"column": "q", "unit": "rad"}}
    columns = {"q": np.ones((20, 2)), "kp": np.array(160.0), "vin": np.array([[7.4]])}
    record = read(columns, channels, scalars=["kp", "vin"])
    assert [record.run.constant(name).item() for name in ("kp", "vin")] == [160.0, 7.4]
    with pytest.raises(DataRejected, match=r"scalars: q has the shape \(20, 2\)"):
        read(columns, channels, scalars=["q"])


def test_a_constant_has_a_factor_and_another_name_where_stages_ask_for_it(read: Read) -> None:
    channels = {"motor_position": {"column": "q", "unit": "rad"}}
    columns = {
        "q": np.ones((20, 2)),
        "payload": np.full(20, 490.0),
        "t": np.arange(20.0),
        "no": np.full(20, np.nan),
    }
    scalars: dict[str, Any] = {
        "payload_kg": {"column": "payload", "scale": 0.001},
        "payload_g": "payload",
    }
    run = read(columns, channels, scalars=scalars).run
    assert run.constant("payload_kg").item() == pytest.approx(0.49)
    assert run.constant("payload_g").item() == 490.0
    with pytest.raises(DataRejected, match="scalars: t goes from 0 to 19, and is no constant"):
        read(columns, channels, scalars=["t"])
    with pytest.raises(DataRejected, match="scalars: no holds nothing"):
        read(columns, channels, scalars=["no"])
    with pytest.raises(DataRejected, match="no column 'payloads' of numbers.*did you mean 'payload'"):
        read(columns, channels, scalars={"payload_kg": "payloads"})
