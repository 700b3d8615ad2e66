"""`robid records`: right about real recordings, and what it prints to paste is a pipeline that loads and reads them."""

from __future__ import annotations

import json
import logging
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults.fault import fault
from hypothesis import given, strategies as st
from ruamel.yaml import YAML

from robid_acquisition.time_stamps import TimeStamps
from robid_core import Channel, Context, DenseRun, Record, Robot
from robid_core.commands import records
from robid_core.commands.recordings.acquisition import data_root, scalar, stage_lines
from robid_core.commands.recordings.inspection import Inspected, inspect, recordings_in
from robid_core.commands.recordings.names import said_by
from robid_core.commands.recordings.pattern import pattern_of
from robid_core.commands.recordings.screen import recording_lines
from robid_core.errors import ConfigurationError, DataRejected, ExtraMissing
from robid_core.pipeline import Pipeline
from robid_core.stage import map_in_process

REPOSITORY = Path(__file__).parents[4]
DATA = Path(os.environ.get("ROBID_DATA", REPOSITORY.parent / "shared" / "data")).resolve()
HEAD = "robid: 1\nname: pasted\nseed: 1\nrobot: {}\n"


def real(name: str) -> Path:
    if not (DATA / name).is_file():
        pytest.skip(f"there is no {name} in {DATA}; set ROBID_DATA")
    return DATA / name


def pasted(folder: Path, recordings: list[Inspected], root: Path, robot: str = "six_axis") -> Pipeline:
    """Load what is printed as a pipeline; a wrong one raises."""
    file = folder / "pipeline.yaml"
    file.write_text(HEAD.format(robot) + "\n".join(stage_lines(recordings, root)) + "\n")
    return Pipeline.load(file, data_root=root)


def settings(pipeline: Pipeline, stage: str = "acquire") -> dict[str, Any]:
    found: dict[str, Any] = next(one for one in pipeline.stages if one.name == stage).stage.model_dump()
    return found


def meanings(one: Inspected) -> dict[str, tuple[str, str]]:
    assert one.guesses is not None
    return {guess.meaning: (guess.label, guess.unit) for guess in one.guesses.chosen}


def test_emps(tmp_path: Path) -> None:
    one = inspect(real("emps/DATA_EMPS.mat"))
    assert one.guesses is not None
    assert meanings(one) == {"motor_position": ("qm", "rad"), "position_reference": ("qg", "rad")}
    assert one.guesses.clock is not None
    assert one.guesses.clock.name == "t"
    assert one.guesses.clock.even
    assert 1 / one.guesses.clock.step_s == pytest.approx(1000, rel=1e-4)
    assert one.guesses.constants["gtau"] == pytest.approx(35.15, abs=0.01)
    assert settings(pasted(tmp_path, [one], DATA, "one_axis"))["time_column"] == "t"


def test_kuka(tmp_path: Path) -> None:
    one = inspect(real("kuka_kr300/trajectory_A.mat"))
    found = meanings(one)
    assert found["motor_position"] == ("rec.act_pos_mot_deg", "deg")
    assert found["motor_speed"] == ("rec.act_vel_mot_deg_per_s", "deg/s")
    assert found["joint_position"] == ("rec.act_pos_se_deg", "deg")
    assert found["motor_torque"] == ("rec.act_torque_abs_nm", "N m")
    assert found["position_reference"] == ("rec.ref_pos_deg", "deg")
    assert any("250 Hz, even steps of 4 ms, no gaps" in line for line in recording_lines(one))
    assert settings(pasted(tmp_path, [one], DATA))["channels"]["joint_position"]["side"] == "joint"


def test_staubli_is_two_files_of_one_recording(tmp_path: Path) -> None:
    parts = [inspect(real(f"staubli_tx40/motor_{name}.csv")) for name in ("position", "torque")]
    assert [list(meanings(one)) for one in parts] == [["motor_position"], ["motor_torque"]]
    assert all(one.guesses is not None and one.guesses.clock is None for one in parts)
    pipeline = pasted(tmp_path, parts, DATA)
    assert [one.name for one in pipeline.stages] == ["acquire"]
    channels = settings(pipeline)["channels"]
    assert channels["motor_torque"]["file"] == "staubli_tx40/motor_torque.csv"
    assert len(channels["motor_position"]["column"]) == 6


def test_kinova_counts_samples(tmp_path: Path) -> None:
    files = [real(f"kinova_gen3/joint_{joint}_trapez.csv") for joint in (2, 4)]
    both = [inspect(file) for file in files]
    found = meanings(both[0])
    assert found["motor_position"] == ("Position", "rad")
    assert found["motor_speed"] == ("Velocity", "rad/s")
    assert found["motor_torque"] == ("TorqueCur", "N m")  # `Torque` is what a model makes of the angle
    assert found["motor_current"] == ("Cur", "A")
    assert found["motor_temperature"] == ("Temp", "degC")
    lines = stage_lines(both, DATA)
    assert any(
        line.strip().startswith("sample_time_s:") and "# guess: Time only counts" in line for line in lines
    )
    pipeline = pasted(tmp_path, both, DATA, "seven_axis")
    read = [stage.stage.path for stage in pipeline.stages]  # of different length
    assert read == ["kinova_gen3/joint_2_trapez.csv", "kinova_gen3/joint_4_trapez.csv"]


def test_axes_in_columns_with_units_are_one_channel_and_a_current_waits_for_its_constant(
    tmp_path: Path,
) -> None:
    time = np.arange(300) * 0.002
    angle = np.stack([30 * np.sin(3 * time), 20 * np.cos(3 * time)], axis=1)
    table = np.column_stack([time, angle, 0.1 * angle])
    head = "Time [s];Angle A1 [deg];Angle A2 [deg];Current A1 [A];Current A2 [A]"
    np.savetxt(tmp_path / "run.csv", table, delimiter=";", header=head, comments="")
    text = "\n".join(stage_lines([inspect(tmp_path / "run.csv")], tmp_path))
    assert 'motor_position: {column: ["Angle A1 [deg]", "Angle A2 [deg]"], unit: deg}' in text
    assert (
        'motor_torque: {column: ["Current A1 [A]", "Current A2 [A]"], unit: A, torque_constant: fill_in}'
        in text
    )
    assert "torque_hold: zero_order_hold  # guess" in text


def test_bam_is_uneven_and_has_constants(tmp_path: Path) -> None:
    one = inspect(real("bam_xl330/sin_sin_kp100.json"))
    assert one.guesses is not None
    assert meanings(one) == {
        "motor_position": ("position", "rad"),
        "motor_speed": ("speed", "rad/s"),
        "motor_voltage": ("input_volts", "V"),
        "motor_temperature": ("temp", "degC"),
        "position_reference": ("goal_position", "rad"),
    }
    assert one.guesses.constants == {"mass": 0.49, "length": 0.1, "kp": 100.0, "vin": 7.4}
    assert one.guesses.clock is not None
    assert not one.guesses.clock.even
    assert any("uneven" in line for line in stage_lines([one], DATA))
    found = settings(pasted(tmp_path, [one], DATA, "one_axis"))
    assert found["time_column"] == "timestamp"
    assert found["channels"]["motor_position"]["enable"] == {"column": ("torque_enable",), "value": None}


def saved(folder: Path, name: str = "run_1.csv", units: bool = False) -> tuple[Path, np.ndarray]:
    time = np.arange(300) * 0.002
    angle = np.stack([np.sin(3 * time + axis) for axis in range(6)], axis=1)
    table = np.column_stack([time, np.rad2deg(angle), np.cos(3 * time)[:, None] * np.arange(1, 7)])
    names = ["t", *(f"joint angle {i + 1}" for i in range(6)), *(f"joint torque {i + 1}" for i in range(6))]
    head = [";".join(names)] + [";".join(["s", *["deg"] * 6, *["Nm"] * 6])] * units
    rows = [";".join(repr(float(value)).replace(".", ",") for value in row) for row in table]
    (folder / name).write_text("\n".join([*head, *rows, ""]))
    return folder / name, angle


@pytest.mark.parametrize("units", [False, True])
def test_what_is_printed_reads_the_recording(tmp_path: Path, units: bool) -> None:
    file, angle = saved(tmp_path, units=units)
    one = inspect(file)
    lines = stage_lines([one], tmp_path)
    assert all("# guess: " in line for line in lines if "column" in line)
    pipeline = pasted(tmp_path, [one], tmp_path)
    robot = Robot.load("six_axis")
    context = Context(
        np.random.default_rng(0),
        map_in_process,
        lambda done, total, note="": None,
        logging.getLogger("test"),
        tmp_path,
    )
    stage = pipeline.stages[0].stage.model_copy(update={"plausibility": "ignore"})
    record: Record = stage.run(robot, context)
    motor = record.runs[0].values("motor_position")[0, 0, 0, 0]
    np.testing.assert_allclose(motor @ robot.drives.gear.T, angle, atol=1e-12)
    assert record.runs[0].sample_time_s == pytest.approx(0.002)


def test_files_with_the_same_columns_are_a_pattern(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "lab"
    folder.mkdir()
    for name in ("c1_e1.csv", "c1_e2.csv", "c2_e1.csv", "c2_e2.csv"):
        saved(folder, name)
    (folder / "broken.csv").write_text("a,b\n1,2\n3\n")
    (folder / "readme.md").write_text("words")
    records.command([str(folder)], data=tmp_path)
    shown = capsys.readouterr().out
    assert 'pattern: "lab/c{config}_e{exp}.csv"  # guess' in shown
    assert shown.count("the same columns, 300 samples") == 3
    assert "broken.csv: left out: A01" in shown
    found = [inspect(file) for file in recordings_in(folder) if file.name != "broken.csv"]
    assert settings(pasted(tmp_path, found, tmp_path))["pattern"] == "lab/c{config}_e{exp}.csv"


@pytest.mark.parametrize(("reader", "module"), [("parquet", "pyarrow"), ("rosbag", "rosbags")])
def test_a_missing_package_is_one_sentence_that_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reader: str, module: str
) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] in (module, f"robid_{reader}")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / "run.csv").write_text("")
    with pytest.raises(ExtraMissing) as caught:
        inspect(tmp_path / "run.csv", reader)
    assert "\n" not in str(caught.value)
    assert str(caught.value).endswith('which is not installed; run: pip install "robid[formats]"')


def test_files_outside_the_data_root_name_the_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, _ = saved(tmp_path)
    (tmp_path / "other").mkdir()
    records.command([str(file)], data=tmp_path / "other")
    shown = capsys.readouterr().out
    assert f"paths begin in {tmp_path}: robid run --data {tmp_path}" in shown
    assert "path: run_1.csv" in shown


def test_what_cannot_be_read_raises_and_nothing_recognised_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "cut.csv").write_text("a,b\n1,2\n3\n")
    with pytest.raises(DataRejected, match="looks cut"):
        records.command([str(tmp_path / "cut.csv")])
    (tmp_path / "noise.csv").write_text("a,b\n1.5,2\n3,1.7\n")
    records.command([str(tmp_path / "noise.csv")])
    assert "no channel was recognised" in capsys.readouterr().out
    (tmp_path / "empty").mkdir()
    with pytest.raises(ConfigurationError, match="holds no recording"):
        records.command([str(tmp_path / "empty")])
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(ConfigurationError, match=r"pipe\.csv: is no file"):
        records.command([str(tmp_path / "pipe.csv")], form="csv")


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (["c1_b1_e1.npz", "c1_b2_e1.npz", "c2_b1_e2.npz"], "c{config}_b{block}_e{exp}.npz"),
        (["run1.mat", "run2.mat"], "run{exp}.mat"),
        (["3/run_01.mat", "4/run_02.mat"], "*/run_{exp}.mat"),
        (["3/run_01.mat", "3/run_02.mat", "4/run_01.mat", "4/run_02.mat"], "{block}/run_{exp}.mat"),
        ([f"2026-03-{10 + i}_move{i}.csv" for i in range(1, 7)], "2026-03-*_move{exp}.csv"),
        (["day7_move1.csv", "day7_move2.csv", "day8_move3.csv", "day8_move4.csv"], "day*_move{exp}.csv"),
        (["9_a1.csv", "8_a3.csv", "7_a1.csv", "9_a2.csv", "3_a7.csv"], ""),
        (["up.csv", "down.csv"], ""),
    ],
)
def test_names_that_differ_in_numbers_are_a_pattern(names: list[str], pattern: str) -> None:
    assert pattern_of(names) == pattern


def test_files_of_different_length_have_a_stage_each_that_share_their_channels(tmp_path: Path) -> None:
    """A stage makes one array of its files, and refuses those that are much shorter than others."""
    for name, n_sample in (("2026-03-11_move1.csv", 300), ("2026-03-12_move2.csv", 200)):
        file, _ = saved(tmp_path, name)
        file.write_text("".join(file.read_text().splitlines(keepends=True)[: n_sample + 1]))
    files = recordings_in(tmp_path)
    lines = stage_lines([inspect(file) for file in files], tmp_path)
    stages = YAML(typ="safe").load("\n".join(lines))["stages"]
    assert [stage["with"]["path"] for stage in stages.values()] == [file.name for file in files]
    assert stages["acquire"]["with"]["channels"] == stages["acquire_2"]["with"]["channels"]
    assert "inputs: {record: [acquire, acquire_2]}" in lines[-1]
    pipeline = pasted(tmp_path, [inspect(file) for file in files], tmp_path)
    assert len(pipeline.stages) == 2


def test_one_of_several_files_that_cannot_be_read_is_left_out_and_a_missing_one_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good, _ = saved(tmp_path)
    words = tmp_path / "runs.csv"
    words.write_text("file,role\na.csv,train\n")
    records.command([str(good), str(words)], data=tmp_path)
    shown = capsys.readouterr().out
    assert f"{words}: left out: " in shown
    assert "use: acquisition.recorded" in shown
    with pytest.raises(ConfigurationError, match=r"gone\.csv: there is no such file"):
        records.command([str(good), str(tmp_path / "gone.csv")], data=tmp_path)


def test_a_unit_and_a_word_for_a_measurement_say_a_quantity() -> None:
    said = [said_by(name) for name in ("A1_ist_deg", "A1_soll_deg", "ist_Nm", "ist_x_m", "deg")]
    assert [one.quantity for one in said] == ["position", "position", "torque", "", ""]
    assert [one.reference for one in said] == [False, True, False, False, False]


def test_names_of_columns_are_quoted_where_yaml_needs_it() -> None:
    for text in ("q", "rec.act_pos", "/joint_states.time_s", "joint angle 1"):
        assert scalar(text) == text
    for text in ("1", "q [rad]", "position[elbow]", "a: b", "yes", "°", "a, b", ""):
        assert json.loads(scalar(text)) == text


@given(text=st.text(alphabet=st.characters(exclude_categories=("C", "Z"), include_characters=" ")))
def test_any_name_is_the_same_behind_yaml(text: str) -> None:
    assert YAML(typ="safe").load(f"a: {{column: [{scalar(text)}], unit: rad}}  # guess")["a"]["column"] == [
        text
    ]


def test_a_record_of_robid_needs_no_channels(tmp_path: Path) -> None:
    values = np.sin(np.arange(30.0)).reshape(1, 1, 1, 1, 30, 1)
    run = DenseRun(
        0.01, {"motor_position": Channel("motor", "rad", values)}, np.arange(30) * 0.01, values[..., 0] < 2
    )
    Record(("axis_1",), "a test", "continuous", (run,), np.zeros((1, 1))).write(tmp_path / "run.h5")
    one = inspect(tmp_path / "run.h5")
    assert one.is_record
    assert any("motor_position [rad]" in line for line in recording_lines(one))
    found = settings(pasted(tmp_path, [one], tmp_path))
    assert found["path"] == "run.h5"
    assert found["channels"] == {}


def test_the_data_root_is_the_known_one_or_the_folder_in_common(tmp_path: Path) -> None:
    files = [tmp_path / "a" / "x.csv", tmp_path / "b" / "y.csv"]
    assert data_root(files, tmp_path) == tmp_path
    assert data_root(files, tmp_path / "elsewhere") == tmp_path.resolve()


@fault(
    "A01",
    sees="`robid records FOLDER`: below the file's line, that its last line has no end",
    mutant=(
        "robid_core/commands/recordings/screen.py",
        '    damage = [f"  {line}" for line in one.lines if DAMAGE.match(line)]',
        "    damage: list[str] = []",
    ),
)
def test_a_cut_table_among_many_alike_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = "\n".join(f"{0.001 * k:.3f},{np.sin(k):.6f}" for k in range(50))
    (tmp_path / "a.csv").write_text(f"time,q\n{rows}\n")
    (tmp_path / "b.csv").write_text(f"time,q\n{rows}"[:-2])
    records.inspected([tmp_path], "")
    out = capsys.readouterr().out
    assert "b.csv: the same columns" in out
    assert "  A01: line 51 has no end" in out
    assert out.count("A01") == 1


def test_recordings_of_which_none_can_be_read_are_no_success(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line for each, and the exit code of data; one that can be read is shown, and that is enough."""
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_bytes(b"\x1f\x8b\x08\x00" + bytes(60))
    shown, left_out = records.inspected([tmp_path], "")
    assert (shown, left_out) == ([], 2)
    with pytest.raises(DataRejected, match="none of 2 recordings could be read"):
        records.command([str(tmp_path)], data=None, output=None)
    assert capsys.readouterr().out.count("left out: ") == 4
    (tmp_path / "c.csv").write_text(
        "time,q\n" + "".join(f"{0.001 * k:.3f},{np.sin(k):.6f}\n" for k in range(50))
    )
    shown, left_out = records.inspected([tmp_path], "")
    assert (len(shown), left_out) == (1, 2)


def test_a_period_is_proposed_where_all_files_repeat_after_as_many_samples(tmp_path: Path) -> None:
    """It is found again by the stage that is proposed; files with another period get none."""
    for number, period in enumerate((500, 500, 500, 500, 400), start=1):
        turns = 2 * np.pi * np.arange(2300)[:, None] / period * np.array([1, 3, 7])
        angle = np.cos(turns + number).sum(axis=1)[:, None] * np.linspace(1, 2, 6)
        moved = {f"q{k}": one for k, one in enumerate(angle.T, 1)} | {
            f"tau{k}": one for k, one in enumerate(angle.T**3, 1)
        }
        np.savez(tmp_path / f"exp{number}.npz", t=0.004 * np.arange(2300), **moved)
    found = [inspect(tmp_path / f"exp{number}.npz") for number in range(1, 6)]
    assert any(
        "motion: repeats every 2 s (500 samples); 4 periods" in line for line in recording_lines(found[0])
    )
    text = "\n".join(stage_lines(found[:4], tmp_path))
    assert "period_s: auto  # guess: it repeats every 2 s (500 samples)" in text
    proposed = settings(pasted(tmp_path, found[:4], tmp_path))
    assert (proposed["period_s"], proposed["lines"]) == ("auto", "auto")
    assert "period_s" not in "\n".join(stage_lines(found, tmp_path))
    assert "# period_s: auto  # it repeats every 2 s" in "\n".join(
        stage_lines(found[:1], tmp_path)
    )  # to be cut
    with np.load(tmp_path / "exp1.npz") as whole:
        late = {name: np.delete(values, np.arange(700, 730)) for name, values in whole.items()}
    np.savez(tmp_path / "late.npz", **late)  # a gap: samples a period later are those of another phase
    assert inspect(tmp_path / "late.npz").repeats is None


def test_a_number_counts_configurations_where_the_poses_differ(tmp_path: Path) -> None:
    """Whatever it is called; where all are in one pose it is what it is called."""
    for pose in (0.0, 8.0):
        for number in range(1, 5):
            swing = np.cos(0.02 * np.arange(900)[:, None] * [1, 2, 3] + number)
            moved = {"q": swing + pose * number * np.array([0, 1, 0]), "tau": swing**3}
            np.savez(tmp_path / f"run{pose:g}_exp{number}.npz", t=0.004 * np.arange(900), **moved)
    for pose, field in ((0, "exp"), (8, "config")):
        found = [inspect(tmp_path / f"run{pose}_exp{number}.npz") for number in range(1, 5)]
        assert f'pattern: "run{pose}_exp{{{field}}}.npz"' in "\n".join(stage_lines(found, tmp_path))


def test_numbers_near_the_largest_of_all_move_nothing(tmp_path: Path) -> None:
    values = np.full((300, 2), 1.7e308) * np.where(np.arange(300)[:, None] % 2, 1.0, -1.0)
    np.savez(tmp_path / "wild.npz", t=0.01 * np.arange(300), q=values, tau=values)
    assert inspect(tmp_path / "wild.npz").repeats is None


def test_steps_that_the_reading_warns_of_are_not_called_even(tmp_path: Path) -> None:
    """Stamps off by 8 % of a step are taken as even, and both `records` and `acquisition.recorded` say by how much."""
    draw = np.random.default_rng(1)
    for share, told in ((0.04, ", off by up to "), (0.0, "even steps of 2 ms, no gaps")):
        time = 2e-3 * (np.arange(500) + draw.uniform(-share, share, 500))
        file = tmp_path / f"run_{share}.csv"
        rows = zip(time, np.sin(9 * time), strict=True)
        file.write_text("t,q\n" + "\n".join(f"{a:.9f},{b:.9f}" for a, b in rows))
        one = inspect(file)
        (line,) = [text for text in recording_lines(one) if "no gaps" in text]
        assert told in line
        assert ("taken as even" in line) == bool(TimeStamps.of(time).jitter())


def test_a_bag_is_one_recording_by_the_name_of_its_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rosbags")
    from fuzz.samples import write_bag_folder

    folders = [tmp_path / "lab" / f"run_{number}" for number in (1, 2)]
    for folder in folders:
        write_bag_folder(folder)
    assert recordings_in(tmp_path / "lab") == folders
    records.command([str(folders[0])], data=tmp_path)
    assert "path: lab/run_1\n" in capsys.readouterr().out
    records.command([str(tmp_path / "lab")], data=tmp_path)
    printed = capsys.readouterr().out
    assert 'pattern: "lab/run_{exp}"' in printed
    assert "format: rosbag\n" in printed
