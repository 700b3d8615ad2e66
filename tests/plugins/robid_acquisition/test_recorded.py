"""A recording made elsewhere: columns, units, signs, sides of the gear, time, holes."""

from __future__ import annotations

import hashlib
import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from pydantic import ValidationError

from robid_acquisition.recorded import RecordedAcquisition
from robid_acquisition.signals import to_side
from robid_core import ConfigurationError, Context, DataRejected, Record, Robot
from robid_core.stage import map_in_process
from robid_core.testing import check_stage

AXIS = {"rotor_inertia": 1e-3, "torque_limit": 10.0, "speed_limit": 100.0, "controller": {"speed_gain": 0.1}}


def robot_with(folder: Path, ratios: list[float], coupling: list[list[float]] | None = None) -> Robot:
    names = [f"axis_{i + 1}" for i in range(len(ratios))]
    data: dict[str, Any] = {
        "robid_robot": 1,
        "name": "test",
        "bodies": [
            {"joint": n, "parent": names[i - 1] if i else None, "mass": 1.0} for i, n in enumerate(names)
        ],
        "axes": {n: {**AXIS, "gear_ratio": r} for n, r in zip(names, ratios, strict=True)},
    }
    if coupling is not None:
        data["coupling"] = coupling
    (folder / "robot.yaml").write_text(json.dumps(data))
    return Robot.load("robot.yaml", folder)


def context(root: Path | None) -> Context:
    return Context(
        np.random.default_rng(0),
        map_in_process,
        lambda done, total, note="": None,
        logging.getLogger("test"),
        root,
    )


def stage(**settings: Any) -> RecordedAcquisition:
    return RecordedAcquisition.model_validate_json(json.dumps(settings), strict=True)


def read(folder: Path, robot: Robot, **settings: Any) -> Record:
    return stage(**settings).run(robot, context(folder))


@pytest.fixture
def one(tmp_path: Path) -> Robot:
    return robot_with(tmp_path, [100.0])


def saved(folder: Path, **columns: np.ndarray) -> str:
    np.savez(folder / "run.npz", **columns)
    return "run.npz"


def test_units_sign_and_scale_are_applied(tmp_path: Path, one: Robot) -> None:
    q, volt = np.linspace(0, 90, 20), np.linspace(-1, 1, 20)
    record = read(
        tmp_path,
        one,
        path=saved(tmp_path, q=q, u=volt, rpm=q),
        sample_time_s=0.01,
        channels={
            "motor_position": {"column": "q", "unit": "deg", "sign": -1},
            "motor_torque": {"column": "u", "unit": "V", "scale": 35.15, "unit_to": "N m"},
            "motor_speed": {"column": "rpm", "unit": "rpm", "scale": 2.0},
        },
    )
    run = record.run
    assert run.values("motor_position").shape == (1, 1, 1, 1, 20, 1)
    np.testing.assert_allclose(run.values("motor_position").ravel(), -np.deg2rad(q))
    np.testing.assert_allclose(run.values("motor_torque").ravel(), 35.15 * volt)
    np.testing.assert_allclose(run.values("motor_speed").ravel(), 2 * q * 2 * np.pi / 60)
    assert {name: c.unit_symbol for name, c in run.channels.items()} == {
        "motor_position": "rad",
        "motor_torque": "N m",
        "motor_speed": "rad/s",
    }
    np.testing.assert_allclose(run.time_s, np.arange(20) * 0.01)
    # The configuration is the mean motor angle, seen through a gear of 100.
    np.testing.assert_allclose(record.angle, [[-np.pi / 4 / 100]])
    assert record.line is None
    assert run.valid.all()


def test_joint_side_values_come_to_the_motor_through_the_gear(tmp_path: Path, one: Robot) -> None:
    q = np.linspace(0, 1, 20)
    record = read(
        tmp_path,
        one,
        path=saved(tmp_path, q=q, tau=q),
        sample_time_s=0.01,
        channels={
            "motor_position": {"column": "q", "unit": "rad", "side": "joint"},
            "motor_torque": {"column": "tau", "unit": "N m", "side": "joint"},
            "joint_position": {"column": "q", "unit": "rad", "side": "joint"},
        },
    )
    np.testing.assert_allclose(record.run.values("motor_position").ravel(), 100 * q)
    np.testing.assert_allclose(record.run.values("motor_torque").ravel(), q / 100)
    np.testing.assert_allclose(record.run.values("joint_position").ravel(), q)
    assert record.run.channel("joint_position").side == "joint"
    assert record.run.channel("motor_torque").side == "motor"


def test_what_a_sensor_on_a_link_shows_does_not_go_through_the_gear(tmp_path: Path, one: Robot) -> None:
    wave = np.linspace(-1, 1, 20)
    channels: dict[str, Any] = {
        "motor_position": {"column": "q", "unit": "rad"},
        "link_acceleration_x": {"column": "a", "unit": "g"},
        "link_turn_rate_z": {"column": "w", "unit": "deg/s", "side": "joint"},
    }
    record = read(
        tmp_path, one, path=saved(tmp_path, q=wave, a=wave, w=wave), sample_time_s=0.01, channels=channels
    )
    for name, factor in (("link_acceleration_x", 9.80665), ("link_turn_rate_z", np.pi / 180)):
        assert record.run.channel(name).side == "joint"
        np.testing.assert_allclose(record.run.values(name).ravel(), factor * wave)


def test_a_coupled_gear_conserves_power() -> None:
    # Joint angle = r_g motor angle; torques follow from tau_joint . v_joint = tau_motor . v_motor.
    draw = np.random.default_rng(0)
    gear = np.array([[0.01, 0.0, 0.0], [0.0, -0.02, 0.0], [0.0, 0.005, 0.03]])
    speed, torque = draw.normal(size=(2, 50, 3))
    joint_speed = to_side(speed, "motor_speed", "motor", "joint", gear)
    joint_torque = to_side(torque, "motor_torque", "motor", "joint", gear)
    np.testing.assert_allclose(joint_speed, speed @ gear.T)
    np.testing.assert_allclose((joint_speed * joint_torque).sum(axis=1), (speed * torque).sum(axis=1))
    np.testing.assert_allclose(to_side(joint_torque, "motor_torque", "joint", "motor", gear), torque)


def test_a_channel_of_some_axes_leaves_the_others_without_value(tmp_path: Path) -> None:
    robot = robot_with(tmp_path, [10.0, 20.0, 30.0])
    table = np.random.default_rng(0).normal(size=(3, 40))
    record = read(
        tmp_path,
        robot,
        path=saved(tmp_path, q=table, link=table[[0, 2]]),
        sample_time_s=0.01,
        channels={
            "motor_position": {"column": "q", "unit": "rad"},
            "joint_position": {
                "column": "link",
                "unit": "rad",
                "side": "joint",
                "axes": ["axis_1", "axis_3"],
            },
        },
    )
    np.testing.assert_array_equal(record.run.values("motor_position")[0, 0, 0, 0], table.T)
    link = record.run.values("joint_position")[0, 0, 0, 0]
    np.testing.assert_array_equal(link[:, [0, 2]], table[[0, 2]].T)
    assert np.isnan(link[:, 1]).all()


def test_columns_can_be_listed_picked_from_a_table_and_come_from_another_file(tmp_path: Path) -> None:
    robot = robot_with(tmp_path, [10.0, 20.0])
    (tmp_path / "q.csv").write_text("a,b\n" + "\n".join(f"{k},{-k}" for k in range(30)))
    scipy.io.savemat(tmp_path / "tau.mat", {"scope": {"values": np.arange(90.0).reshape(30, 3)}})
    acquisition = stage(
        path="q.csv",
        sample_time_s=0.01,
        channels={
            "motor_position": {"column": ["b", "a"], "unit": "rad"},
            "motor_torque": {
                "column": ["scope.values[2]", "scope.values[0]"], "unit": "N m", "file": "tau.mat",
            },
        },
    )  # fmt: skip
    assert acquisition.external_files(tmp_path) == [tmp_path / "q.csv", tmp_path / "tau.mat"]
    run = acquisition.run(robot, context(tmp_path)).run
    np.testing.assert_array_equal(run.values("motor_position")[0, 0, 0, 0, 7], [-7, 7])
    np.testing.assert_array_equal(run.values("motor_torque")[0, 0, 0, 0, 7], [23, 21])


def test_whole_periods_are_kept_and_the_rest_is_reported(
    tmp_path: Path, one: Robot, caplog: pytest.LogCaptureFixture
) -> None:
    n = 100
    q = np.tile(np.sin(2 * np.pi * 3 * np.arange(n) / n), 4)[: 3 * n + 37]
    record = read(
        tmp_path,
        one,
        path=saved(tmp_path, q=q, tau=q),
        sample_time_s=0.01,
        period_s=1.0,
        lines=[3],
        torque_hold="continuous",
        plausibility="ignore",  # a torque that follows the angle at 3 Hz is one that brakes its integral
        channels={
            "motor_position": {"column": "q", "unit": "rad"},
            "motor_torque": {"column": "tau", "unit": "N m"},
        },
    )
    assert record.run.n_period == 3
    assert "37 samples" in caplog.text
    np.testing.assert_allclose(record.frequency_hz, [3.0])
    # A sine of amplitude 1 has the DFT coefficient -i/2, in every period alike.
    np.testing.assert_allclose(record.period_spectra("motor_torque").ravel(), [-0.5j] * 3, atol=1e-12)


def test_start_and_stop_cut_the_recording(tmp_path: Path, one: Robot) -> None:
    record = read(
        tmp_path,
        one,
        path=saved(tmp_path, q=np.arange(100.0)),
        sample_time_s=0.01,
        start_s=0.2,
        stop_s=0.5,
        channels={"motor_position": {"column": "q", "unit": "rad"}},
    )
    np.testing.assert_array_equal(record.run.values("motor_position").ravel(), np.arange(20.0, 50.0))


def test_the_time_column_gives_the_sampling_time(tmp_path: Path, one: Robot) -> None:
    t = 1e6 * (5 + np.arange(50) * 0.004)
    record = read(
        tmp_path,
        one,
        path=saved(tmp_path, t=t, q=t),
        time_column="t",
        time_unit="us",
        channels={"motor_position": {"column": "q", "unit": "rad"}},
    )
    assert record.run.sample_time_s == pytest.approx(0.004)


@pytest.mark.parametrize(("index", "value"), [(30, 29.5), (30, 28.0), (30, np.nan), (30, 35.0)])
def test_A10_a_clock_that_stands_jumps_or_runs_back_is_told_by_its_sample(
    tmp_path: Path, one: Robot, index: int, value: float
) -> None:
    time = np.arange(60.0)
    time[index] = value
    with pytest.raises(DataRejected, match="A10.*at sample (30|31)"):
        read(
            tmp_path,
            one,
            path=saved(tmp_path, t=1e-3 * time, q=time),
            time_column="t",
            channels={"motor_position": {"column": "q", "unit": "rad"}},
        )


def test_a_clock_of_a_few_percent_jitter_is_taken_as_even(tmp_path: Path, one: Robot) -> None:
    jitter = np.random.default_rng(0).uniform(-0.02, 0.02, 1000)
    record = read(
        tmp_path,
        one,
        path=saved(tmp_path, t=1e-3 * (np.arange(1000) + jitter), q=jitter),
        time_column="t",
        channels={"motor_position": {"column": "q", "unit": "rad"}},
    )
    assert record.run.sample_time_s == pytest.approx(1e-3, rel=1e-4)
    np.testing.assert_array_equal(record.run.values("motor_position").ravel(), jitter)


@pytest.mark.parametrize("position", [0, 57, 99])
def test_A05_nan_is_told_by_channel_axis_first_sample_and_count(tmp_path: Path, position: int) -> None:
    robot = robot_with(tmp_path, [10.0, 20.0])
    q = np.zeros((100, 2))
    q[position, 1] = np.inf
    q[99, 1] = np.nan
    count = 1 if position == 99 else 2
    with pytest.raises(
        DataRejected, match=rf"A05: channel motor_position .*axis_2: {count} .* at sample {position};"
    ):
        read(
            tmp_path,
            robot,
            path=saved(tmp_path, q=q),
            sample_time_s=0.01,
            channels={"motor_position": {"column": "q", "unit": "rad"}},
        )


def test_a_missing_file_is_one_line_that_tells_where_to_get_it(tmp_path: Path, one: Robot) -> None:
    settings: dict[str, Any] = {
        "origin": "https://example.org/data",
        "path": "emps/run.mat",
        "sample_time_s": 0.1,
        "channels": {"motor_position": {"column": "q", "unit": "rad"}},
    }
    for root in (tmp_path, None):
        with pytest.raises(ConfigurationError) as caught:
            stage(**settings).run(one, context(root))
        message = str(caught.value)
        assert "\n" not in message
        for part in ("emps/run.mat", "https://example.org/data", "ROBID_DATA", "--data"):
            assert part in message


def test_A13_another_file_than_the_one_meant_is_refused(tmp_path: Path, one: Robot) -> None:
    path = saved(tmp_path, q=np.arange(10.0))
    right = hashlib.sha256((tmp_path / path).read_bytes()).hexdigest()
    settings: dict[str, Any] = {
        "path": path,
        "sample_time_s": 0.1,
        "channels": {"motor_position": {"column": "q", "unit": "rad"}},
    }
    read(tmp_path, one, sha256=right.upper(), **settings)
    with pytest.raises(DataRejected, match=f"A13.*{right}"):
        read(tmp_path, one, sha256="0" * 64, **settings)


@pytest.mark.parametrize(
    ("channel", "told"),
    [
        (
            {"motor_torque": {"column": "u", "unit": "V"}},
            "V is no unit of torque; give scale and unit_to: N m",
        ),
        (
            {"motor_position": {"column": "u", "unit": "degree"}},
            "unit 'degree' is not known; for degrees write deg",
        ),
        (
            {"motor_position": {"column": "u", "unit": "Grad"}},
            "for degrees write deg; gons, 400 a turn, take scale: 0.0157079633 and unit_to: rad",
        ),
        (
            {"motor_position": {"column": "u", "unit": "parsec"}},
            "unit 'parsec' is not known; give scale and unit_to",
        ),
        (
            {"motor_torque": {"column": "u", "unit": "V", "scale": 2.0, "unit_to": "Nm"}},
            "unit_to 'Nm' is not one of",
        ),
        ({"motor_torque": {"column": "u", "unit": "N m", "scale": 0.0}}, "scale must not be 0"),
        ({"motor_torque": {"column": "u", "unit": "N m", "sign": 2}}, "sign"),
        ({"motor_torque": {"column": "u"}}, "unit"),
    ],
)
def test_a_unit_is_never_guessed(channel: dict[str, Any], told: str) -> None:
    with pytest.raises(ValidationError) as caught:
        stage(path="run.npz", sample_time_s=0.1, channels=channel)
    assert told in str(caught.value)


@pytest.mark.parametrize("times", [{}, {"sample_time_s": 0.1, "time_column": "t"}])
def test_the_sampling_time_is_given_exactly_once(times: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="either sample_time_s or time_column"):
        stage(path="run.npz", channels={"motor_position": {"column": "q", "unit": "rad"}}, **times)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"channels": {"motor_position": {"column": "Q", "unit": "rad"}}}, "no column 'Q'"),
        ({"channels": {"motor_position": {"column": "table", "unit": "rad"}}}, "A06.*2 columns for 1 axes"),
        (
            {"channels": {"motor_position": {"column": "table[2]", "unit": "rad"}}},
            "2 columns, counted from 0",
        ),
        ({"channels": {"motor_position": {"column": "cube", "unit": "rad"}}}, r"A06.*\(2, 2, 2\)"),
        (
            {
                "channels": {
                    n: {"column": c, "unit": "rad"} for n, c in (("joint_position", "q"), ("x_position", "r"))
                }
            },
            "A06.*different lengths",
        ),
        ({"channels": {"motor_position": {"column": "q", "unit": "rad", "axes": ["a"]}}}, "no axis a"),
        ({"channels": {"motor_position": {"column": "q", "unit": "rad"}}, "period_s": 0.107}, "A09"),
        ({"channels": {"motor_position": {"column": "q", "unit": "rad"}}, "period_s": 20.0}, "A11"),
        ({"channels": {"motor_position": {"column": "q", "unit": "rad"}}, "start_s": 11.0}, "it lasts 10 s"),
        (
            {"channels": {"motor_position": {"column": "q", "unit": "rad"}}, "stop_s": 200.0},
            "stop_s of 200 s is beyond the end: the file lasts 10 s",
        ),
        (
            {"channels": {"motor_position": {"column": "huge", "unit": "rad"}}},
            "motor_position is 1e.300 at sample 7",
        ),
    ],
)
def test_what_the_file_cannot_give_is_rejected(
    tmp_path: Path, one: Robot, settings: dict[str, Any], told: str
) -> None:
    path = saved(
        tmp_path,
        q=np.arange(1000.0),
        r=np.arange(9.0),
        table=np.zeros((1000, 2)),
        cube=np.zeros((2, 2, 2)),
        huge=np.where(np.arange(1000) == 7, 1e300, 0.1),
    )
    with pytest.raises(DataRejected, match=told):
        read(tmp_path, one, path=path, sample_time_s=0.01, **settings)


def test_without_channels_the_message_shows_what_the_file_holds(tmp_path: Path, one: Robot) -> None:
    with pytest.raises(ConfigurationError, match=r"needs channels(.|\n)*q: \(1000,\)"):
        read(tmp_path, one, path=saved(tmp_path, q=np.zeros(1000)))


def test_a_file_of_unknown_kind_asks_for_its_format(tmp_path: Path, one: Robot) -> None:
    (tmp_path / "run.xyz").write_text("q\n" + "\n".join(map(str, range(12))) + "\n")
    settings: dict[str, Any] = {
        "path": "run.xyz",
        "sample_time_s": 0.1,
        "channels": {"motor_position": {"column": "q", "unit": "rad"}},
    }
    with pytest.raises(ConfigurationError, match=r"no reader for '\.xyz'"):
        read(tmp_path, one, **settings)
    record = read(tmp_path, one, format="csv", **settings)
    assert record.run.values("motor_position").ravel().tolist() == list(range(12))


@pytest.mark.parametrize("n_axis", [1, 2, 6])
def test_the_stage_keeps_the_contract(tmp_path: Path, n_axis: int) -> None:
    path = saved(tmp_path, q=np.random.default_rng(0).normal(size=(500, n_axis)))
    channels = {"motor_position": {"column": ("q",), "unit": "deg"}}
    check_stage(
        RecordedAcquisition,
        for_axes=(n_axis,),
        data_root=tmp_path,
        path=path,
        sample_time_s=0.01,
        channels=channels,
    )
