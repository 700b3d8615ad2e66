"""What a run would refuse of recordings is told by validation at its setting, in the run's words."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_acquisition import first_file
from robid_acquisition.recorded import RecordedAcquisition
from robid_core import DataRejected, Robot
from robid_core.pipeline import Pipeline
from robid_core.testing import example_context
from robid_core.yaml_file.problems import FileProblems, Problem

POSITION = {"column": [f"q{number}" for number in range(1, 7)], "unit": "rad"}
TORQUE = {"column": [f"i{number}" for number in range(1, 7)], "unit": "N m"}
TABLES = {
    "path": "six.npz",
    "channels": {
        "motor_position": {"column": "q", "unit": "rad"},
        "motor_torque": {"column": "i", "unit": "N m"},
    },
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Six axes for three seconds: as text with a column each, and as two tables."""
    values = np.random.default_rng(1).normal(size=(300, 12))
    header = ",".join(POSITION["column"] + TORQUE["column"])
    np.savetxt(tmp_path / "six.csv", values, delimiter=",", header=header, comments="", fmt="%.5f")
    np.savez(tmp_path / "six.npz", q=values[:, :6], i=values[:, 6:], t=np.arange(300) * 0.01)
    return tmp_path


def settings(changes: dict[str, Any]) -> dict[str, Any]:
    """Sound settings with changes; a channel's are those of that channel, None leaves a setting out."""
    channels = {"motor_position": POSITION, "motor_torque": TORQUE}
    sound = {
        "path": "six.csv",
        "sample_time_s": 0.01,
        "period_s": 1.0,
        "torque_hold": "zero_order_hold",
        "lines": [3, 20],
        "channels": channels,
    }
    merged = {**sound, **{key: value for key, value in changes.items() if key not in channels}}
    told = merged["channels"]
    merged["channels"] = {name: {**one, **changes.get(name, {})} for name, one in told.items()}
    return {key: value for key, value in merged.items() if value is not None}


def problems(folder: Path, with_settings: dict[str, Any], frf: str = "frf.h1") -> list[Problem]:
    read = {"use": "acquisition.recorded", "with": with_settings}
    stages = {"read": read, "frf": {"use": frf}}
    if frf == "frf.spectral":
        stages["frf"]["with"] = {"segment_s": 0.5, "band_hz": [4, 40]}
    content = {"robid": 1, "name": "example", "seed": 1, "robot": "six_axis", "stages": stages}
    file = folder / "pipeline.yaml"
    file.write_text(json.dumps(content, indent=1), encoding="utf-8")
    try:
        Pipeline.load(file, data_root=folder)
    except FileProblems as error:
        return list(error.problems)
    return []


# Changes of sound settings, the setting that is wrong, words.
SLIPS: dict[str, tuple[dict[str, Any], str, str]] = {
    "one column for six axes": (
        {"motor_position": {"column": "q1"}},
        "channels.motor_position.column",
        "channel motor_position has 1 column for 6 axes; list one column for each axis",
    ),
    "two columns for six axes": (
        {"motor_torque": {"column": ["i1", "i2"]}},
        "channels.motor_torque.column",
        "channel motor_torque has 2 columns for 6 axes",
    ),
    "two signs for six axes": (
        {"motor_torque": {"sign": [1, -1]}},
        "channels.motor_torque.sign",
        "channels.motor_torque.sign: 2 numbers for 6 axes",
    ),
    "an axis that the robot has not": (
        {"motor_torque": {"column": "i1", "axes": ["elbow"]}},
        "channels.motor_torque.axes",
        "the robot has no axis elbow",
    ),
    "a line above the Nyquist frequency": (
        {"lines": [3, 5000]},
        "lines",
        "lines: 5000 lies above the Nyquist frequency, a period has 100 samples",
    ),
    "a period between samples": ({"period_s": 1.005}, "period_s", "is 100.5 samples of 0.01 s, not a whole number"),
    "a period that drifts over the file": ({"period_s": 1.0005}, "period_s", "A09: a period of 1.0005 s"),
    "a period beyond the file": (
        {"period_s": 1.0e9},
        "period_s",
        "A11: 3 s were recorded, less than a period of 1e+09 s; correct period_s",
    ),
    "a stop beyond the file": ({"stop_s": 30.0}, "stop_s", "stop_s of 30 s is beyond the end: the file lasts 3 s"),
    "a column that the file lacks": (
        {"motor_torque": {"column": ["i1", "i2", "i3", "i4", "i5", "i66"]}},
        "channels.motor_torque.column[5]",
        "the file has no column 'i66' of numbers (words, dates, and arrays whose length changes are left out); "
        "did you mean 'i6'?",
    ),
    "a table that the archive lacks": (
        {**TABLES, "motor_torque": {"column": "tau"}},
        "channels.motor_torque.column[0]",
        "the file has no column 'tau'",
    ),
    "a column of switches that the file lacks": (
        {"motor_torque": {"enable": {"column": "on"}}},
        "channels.motor_torque.enable.column[0]",
        "the file has no column 'on'",
    ),
    "a clock that the file lacks": (
        {**TABLES, "sample_time_s": None, "time_column": "time"},
        "time_column",
        "the file has no column 'time'",
    ),
    "lines by the clock of the file": (
        {**TABLES, "sample_time_s": None, "time_column": "t", "lines": [3, 60]},
        "lines",
        "lines: 60 lies above the Nyquist frequency",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SLIPS)
def test_a_slip_is_told_at_its_setting_in_the_words_of_the_run(name: str, folder: Path) -> None:
    changes, place, words = SLIPS[name]
    wrong = settings(changes)
    (found,) = problems(folder, wrong)
    path, message = found.path, found.message
    assert path == f"stages.read.with.{place}"
    assert words in message
    line = (folder / "pipeline.yaml").read_text(encoding="utf-8").splitlines()[found.line - 1]
    key = place.partition("[")[0].rpartition(".")[2]
    assert f'"{key}"' in line or "[" in place
    with pytest.raises(DataRejected) as refused:
        RecordedAcquisition.model_validate_json(json.dumps(wrong)).run(
            Robot.load("six_axis"), example_context(data_root=folder)
        )
    assert str(refused.value).startswith(message)


@pytest.mark.parametrize("changes", [{}, TABLES, {**TABLES, "sample_time_s": None, "time_column": "t"}])
def test_sound_settings_are_valid(folder: Path, changes: dict[str, Any]) -> None:
    assert not problems(folder, settings(changes))


@pytest.mark.parametrize("estimator", ["frf.h1", "frf.log", "frf.ari", "frf.lpm"])
def test_an_estimator_that_needs_lines_is_told_of_recordings_without(folder: Path, estimator: str) -> None:
    without = settings({"lines": None})
    ((path, message),) = [(one.path, one.message) for one in problems(folder, without, estimator)]
    assert path == "stages.frf.use"
    assert "'acquisition.recorded'" in message
    assert "of stage 'read' has none; give it period_s and lines" in message
    assert not problems(folder, settings({"lines": "auto"}), estimator)
    assert not problems(folder, without, "frf.spectral")


@pytest.mark.parametrize("changes", [TABLES, {}])
def test_a_large_file_is_not_read(
    folder: Path, changes: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its reader tells names and shapes; where it cannot, the run does."""
    monkeypatch.setattr(first_file, "SMALL", 100)
    assert not problems(folder, settings(changes))
    told = [one.message for one in problems(folder, settings({**changes, "period_s": 10.0}))]
    assert len(told) == 1
    assert "3 s were recorded" in told[0]
    clock = {**TABLES, "sample_time_s": None, "time_column": "t"}
    assert not problems(
        folder, settings({**clock, "period_s": 10.0})
    )  # of the clock only the length is known
    named = [
        {"t": float(row), **dict.fromkeys(POSITION["column"] + TORQUE["column"], 0.1)} for row in range(9)
    ]
    (folder / "six.json").write_text(json.dumps(named), encoding="utf-8")
    assert not problems(folder, settings({"path": "six.json", "motor_torque": {"column": "lacking"}}))


def test_a_damaged_file_is_left_to_the_run(folder: Path) -> None:
    (folder / "six.csv").write_text("q1,i1\n1,2\n3\n4,5\n", encoding="utf-8")
    assert not problems(folder, settings({}))


def test_other_data_than_those_meant_are_left_to_the_run(folder: Path) -> None:
    other = {"sha256": "0" * 64, "motor_torque": {"column": ["a", "b", "c", "d", "e", "f"]}}
    assert not problems(folder, settings(other))


def test_of_many_files_the_first_is_named(folder: Path) -> None:
    for number in (1, 2):
        (folder / f"c{number}.npz").write_bytes((folder / "six.npz").read_bytes())
    many = {**TABLES, "path": None, "pattern": "c{config}.npz"}
    assert not problems(folder, settings(many))
    (told,) = problems(folder, settings({**many, "motor_torque": {"column": "tau"}}))
    assert told.message.startswith("c1.npz: the file has no column 'tau'")


def test_experiments_that_begin_behind_the_end_are_told(folder: Path) -> None:
    begun = {"starts_s": [0.0, 1.0], "duration_s": 1.0}
    assert not problems(folder, settings(begun))
    (told,) = problems(folder, settings({**begun, "starts_s": [0.0, 4.0]}))
    assert told.path == "stages.read.with.starts_s"
    assert "nothing lies between 4 s and 5 s; it lasts 3 s" in told.message
