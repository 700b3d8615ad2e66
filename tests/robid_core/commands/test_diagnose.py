"""`robid diagnose`: the pipeline that it writes, and its messages."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from robid_core import Context, Record, Robot
from robid_core.commands import records
from robid_core.commands.diagnose import (
    FILE,
    HEADING,
    Asked,
    below_one_folder,
    command,
    pipeline_text,
    read_sources,
    robot_below_here,
    robots_of,
)
from robid_core.errors import ConfigurationError
from robid_core.pipeline import Pipeline
from robid_core.stage import map_in_process
from robid_core.yaml_file.problems import FileProblems


def test_the_pipeline_reads_every_record_and_explains_them_together(tmp_path: Path) -> None:
    """It is valid, and asks for what was asked for."""
    for name in ("a.mcap", "b.mcap"):
        (tmp_path / name).write_bytes(b"")
    text = pipeline_text(
        "one_axis", [{"path": "a.mcap"}, {"path": "b.mcap"}], Asked(only=["friction.stribeck@axis_1"])
    )
    (tmp_path / FILE).write_text(text, encoding="utf-8")
    pipeline = Pipeline.load(tmp_path / FILE, data_root=tmp_path)
    stages = {node.name: node for node in pipeline.stages}
    assert tuple(stages["explain"].inputs["record"]) == ("record_1", "record_2")
    assert stages["explain"].stage.only == ("friction.stribeck@axis_1",)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("number", "wrong"),
    [("gear_ratio.axis_1", 0.0125), ("centre_of_mass.axis_1.z", 202.0)],
)
def test_a_robot_that_cannot_be_is_refused_before_a_record_is_read(
    tmp_path: Path, number: str, wrong: float
) -> None:
    """A ratio upside down, millimetres: `robid doctor` tells them, and so does whoever has not asked it."""
    (tmp_path / "a.mcap").write_bytes(b"")
    (tmp_path / "robot.yaml").write_text(
        f"robid_robot: 1\nbase: one_axis\nparameters: {{{number}: {wrong}}}\n", encoding="utf-8"
    )
    (tmp_path / FILE).write_text(pipeline_text("robot.yaml", [{"path": "a.mcap"}], Asked()), encoding="utf-8")
    with pytest.raises(FileProblems, match=r"robot: robot.yaml:.*(turns faster than its motor|millimetres)"):
        Pipeline.load(tmp_path / FILE, data_root=tmp_path)


def test_one_long_motion_is_cut_and_what_is_measured_later_is_not(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"")
    (tmp_path / FILE).write_text(
        pipeline_text("one_axis", [{"path": "a.mcap"}], Asked(blocks=8)), encoding="utf-8"
    )
    pipeline = Pipeline.load(tmp_path / FILE, data_root=tmp_path)
    (explain,) = (node.stage for node in pipeline.stages if node.name == "explain")
    assert explain.blocks == 8  # type: ignore[attr-defined]
    with pytest.raises(ConfigurationError, match="what --continue measures has periods and stays whole"):
        command("one_axis", [tmp_path / "a.mcap"], blocks=8, continued=tmp_path / FILE)


def test_a_record_of_another_payload_has_its_robot(tmp_path: Path) -> None:
    """It is read as a variant of that name, which the diagnosis knows; a robot for no record is refused."""
    records = [tmp_path / "bare.mcap", tmp_path / "loaded.mcap"]
    for path in records:
        path.write_bytes(b"")
    (tmp_path / "arm.yaml").write_text("robid_robot: 1\nname: arm\nbase: one_axis\n", encoding="utf-8")
    names = [path.name for path in records]
    robots = robots_of([f"{records[1]}=arm.yaml"], records, names)
    assert robots == {"loaded.mcap": "arm.yaml"}
    (tmp_path / FILE).write_text(
        pipeline_text("one_axis", [{"path": name} for name in names], Asked(robots=robots)), encoding="utf-8"
    )
    pipeline = Pipeline.load(tmp_path / FILE, data_root=tmp_path)
    assert [pipeline.stage(f"record_{k}").stage.variant for k in (1, 2)] == ["", "loaded.mcap"]  # type: ignore[attr-defined]
    assert list(pipeline.stage("explain").stage.robots) == ["loaded.mcap"]  # type: ignore[attr-defined]
    for wrong in ("other.mcap=arm.yaml", f"{records[1]}"):
        with pytest.raises(ConfigurationError, match="give one of the records and its robot file"):
            robots_of([wrong], records, names)


def test_a_record_that_is_kept_apart_has_the_role_test(tmp_path: Path) -> None:
    """It is read last, and explained with the others, which then keep it for the last judgement."""
    for name in ("a.mcap", "b.mcap"):
        (tmp_path / name).write_bytes(b"")
    text = pipeline_text("one_axis", [{"path": "a.mcap"}, {"path": "b.mcap", "role": "test"}], Asked())
    (tmp_path / FILE).write_text(text, encoding="utf-8")
    pipeline = Pipeline.load(tmp_path / FILE, data_root=tmp_path)
    assert [pipeline.stage(f"record_{k}").stage.role for k in (1, 2)] == ["", "test"]  # type: ignore[attr-defined]
    assert tuple(pipeline.stage("explain").inputs["record"]) == ("record_1", "record_2")


def test_records_are_named_below_the_folder_that_holds_them_all(tmp_path: Path) -> None:
    for name in ("monday/a.mcap", "tuesday/b.mcap"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_bytes(b"")
    records = [tmp_path / "monday" / "a.mcap", tmp_path / "tuesday" / "b.mcap"]
    assert below_one_folder(records, None) == (tmp_path.resolve(), ["monday/a.mcap", "tuesday/b.mcap"])
    with pytest.raises(ConfigurationError, match="not below"):
        below_one_folder(records, tmp_path / "monday")
    with pytest.raises(ConfigurationError, match=r"monday: is a folder; name its recordings, .*monday/\*"):
        below_one_folder([tmp_path / "monday"], None)
    with pytest.raises(ConfigurationError, match="there is no such file"):
        below_one_folder([tmp_path / "c.mcap"], None)


def test_a_file_of_somebody_else_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor is anything run."""
    monkeypatch.chdir(tmp_path)
    record, mine = tmp_path / "a.h5", tmp_path / FILE
    Record.from_arrays(sample_time_s=ROBOT.sample_time_s, robot=ROBOT, **COLUMNS).write(record)
    mine.write_text("robid: 1\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match="was not written by robid diagnose"):
        command("one_axis", [record])
    assert mine.read_text(encoding="utf-8") == "robid: 1\n"
    assert HEADING.startswith("#")


def test_a_test_of_one_law_stands_alone(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="--test asks for one law"):
        command("one_axis", [tmp_path / "a.mcap"], only=["friction.dahl"], test="friction.stribeck@axis_1")


ROBOT = Robot.load("one_axis")
TIME = ROBOT.sample_time_s * np.arange(400)
COLUMNS = {"motor_position": 40 + np.sin(9 * TIME), "motor_torque": 0.5 * np.cos(9 * TIME)}


def recording(path: Path) -> None:
    """Write the columns in the format that a suffix names."""
    columns = {"time_s": TIME, **COLUMNS}
    if path.suffix == ".csv":
        head = ",".join(columns)
        np.savetxt(path, np.stack(list(columns.values()), axis=1), delimiter=",", header=head, comments="")
    elif path.suffix == ".mat":
        scipy.io.savemat(path, columns)
    elif path.suffix == ".npz":
        np.savez(path, **columns)  # type: ignore[arg-type]
    elif path.suffix == ".parquet":
        pyarrow = pytest.importorskip("pyarrow")
        parquet = pytest.importorskip("pyarrow.parquet")
        parquet.write_table(pyarrow.table(columns), path)
    else:
        with h5py.File(path, "w") as file:
            for name, values in columns.items():
                file[name] = values


def read_record(folder: Path, root: Path, sources: list[dict[str, Any]]) -> Record:
    """Read the first record of the pipeline that a diagnosis writes."""
    (folder / FILE).write_text(pipeline_text("one_axis", sources, Asked()), encoding="utf-8")
    stage = Pipeline.load(folder / FILE, data_root=root).stage("record_1").stage
    context = Context(
        np.random.default_rng(0), map_in_process, lambda *_, **__: None, logging.getLogger("lab"), root
    )
    return stage.run(ROBOT, context)  # type: ignore[attr-defined, no-any-return]


@pytest.mark.parametrize("suffix", ["csv", "mat", "npz", "parquet", "h5"])
def test_what_people_have_is_read_by_the_map_that_records_writes(tmp_path: Path, suffix: str) -> None:
    """To the last sample; the map may be left to name the files, and a record of robid needs none."""
    file, channels = tmp_path / f"monday.{suffix}", tmp_path / "channels.yaml"
    recording(file)
    records.command([str(file)], output=channels, data=tmp_path)
    text = channels.read_text(encoding="utf-8")
    channels.write_text(f"{text.rstrip()}\n      plausibility: ignore\n", encoding="utf-8")
    for files in ([file], []):
        record = read_record(tmp_path, *read_sources(files, channels, tmp_path))
        assert record.torque_hold == "zero_order_hold"
        for name, values in COLUMNS.items():
            np.testing.assert_allclose(record.run.values(name).ravel(), values, rtol=1e-12, atol=1e-12)
    own = tmp_path / "own.h5"
    record.write(own)
    assert read_sources([own], None, tmp_path)[1] == [{"path": "own.h5"}]


def test_a_missing_map_is_one_sentence_with_the_command_that_writes_it(tmp_path: Path) -> None:
    file, channels = tmp_path / "monday.csv", tmp_path / "channels.yaml"
    recording(file)
    with pytest.raises(
        ConfigurationError, match=rf"`robid records {file} --output channels.yaml` writes one"
    ):
        read_sources([file], None, None)
    with pytest.raises(ConfigurationError, match="there is no such file"):
        read_sources([file], channels, None)
    channels.write_text("name: nothing\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match="holds no channel map"):
        read_sources([file], channels, None)
    with pytest.raises(ConfigurationError, match="no recordings are given"):
        read_sources([], None, None)


def test_of_several_maps_the_one_that_fits_the_file_is_taken(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("a.csv", "b.npz")]
    channels = tmp_path / "channels.yaml"
    for file in files:
        recording(file)
    each = "{use: acquisition.recorded, with: {path: %s, sample_time_s: %g, channels: {}}}"
    stages = "\n".join(f"  read_{k}: {each % (name, k)}" for k, name in enumerate(("old.csv", "b.npz"), 1))
    channels.write_text(f"stages:\n{stages}\n", encoding="utf-8")
    _, sources = read_sources(files, channels, None)
    assert [(one["path"], one["sample_time_s"]) for one in sources] == [("a.csv", 1), ("b.npz", 2)]
    channels.write_text(channels.read_text().replace("b.npz", "c.csv"), encoding="utf-8")
    with pytest.raises(ConfigurationError, match="name the file as the path of one"):
        read_sources(files, channels, None)


def test_of_maps_for_files_of_one_name_or_for_patterns_the_nearest_is_taken(tmp_path: Path) -> None:
    """Five stages that `robid records` wrote for five folders, and a pattern beside another one."""
    names = ["monday/log.csv", "tuesday/log.csv", "tuesday/run12.csv", "tuesday/sweep_3.csv"]
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        recording(tmp_path / name)
    told = (
        "path: monday/log.csv",
        "path: lab/tuesday/log.csv",
        'pattern: "run{exp}.csv"',
        'pattern: "sweep_{exp}.csv"',
    )
    stages = (
        f"  read_{k}: {{use: acquisition.recorded, with: {{{source}, sample_time_s: {k}, channels: {{}}}}}}"
        for k, source in enumerate(told, 1)
    )
    channels = tmp_path / "channels.yaml"
    channels.write_text("\n".join(("stages:", *stages)) + "\n", encoding="utf-8")
    _, sources = read_sources([tmp_path / name for name in names], channels, None)
    assert [(one["path"], one["sample_time_s"]) for one in sources] == list(
        zip(names, (1, 2, 3, 4), strict=True)
    )


def test_a_robot_file_may_be_named_from_anywhere_but_lies_below(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Shells complete whole paths; a file beside the folder is refused with what to do."""
    folder = tmp_path / "cell"
    folder.mkdir()
    monkeypatch.chdir(folder)
    assert robot_below_here("one_axis") == "one_axis"
    assert robot_below_here("runs/robot.yaml") == "runs/robot.yaml"
    assert robot_below_here(str(folder / "runs" / "robot.yaml")) == "runs/robot.yaml"
    assert robot_below_here("../cell/robot.yaml") == "robot.yaml"
    with pytest.raises(ConfigurationError, match="run the command in a folder above the robot file"):
        robot_below_here("../robot.yaml")


def test_a_channel_map_that_names_files_begins_where_one_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without --data, ROBID_DATA and a data folder beside the project there is no other place to begin."""
    monkeypatch.delenv("ROBID_DATA", raising=False)
    (tmp_path / "inner").mkdir()
    monkeypatch.chdir(tmp_path / "inner")
    Path("channels.yaml").write_text(
        "use: acquisition.recorded\nwith:\n  path: lab.csv\n  time_column: t\n"
        "  channels: {motor_position: {column: q, unit: rad}}\n",
        encoding="utf-8",
    )
    root, (source,) = read_sources([], Path("channels.yaml"), None)
    assert root == tmp_path / "inner"
    assert source["path"] == "lab.csv"
    other = tmp_path / "data"
    other.mkdir()
    monkeypatch.setenv("ROBID_DATA", str(other))
    assert read_sources([], Path("channels.yaml"), None)[0] == other


def test_all_files_of_a_pattern_are_one_record_where_they_repeat(tmp_path: Path) -> None:
    """Numbers in names count configurations and experiments; a part of them, or motions of any length, do not."""
    names = [f"lab/c{c}_e{e}.npz" for c in (1, 2) for e in (1, 2)]
    files = [tmp_path / name for name in (*names, "lab/notes.npz")]
    (tmp_path / "lab").mkdir()
    for file in files:
        recording(file)
    channels = tmp_path / "map.yaml"
    told = "pattern: c{config}_e{exp}.npz\nchannels: {motor_position: {key: q}}\n"
    channels.write_text(f"{told}period_s: auto\n")

    def read(chosen: list[Path], **how: bool) -> list[str]:
        sources = read_sources(chosen, channels, tmp_path, **how)[1]
        return [one.get("path", one.get("pattern")) for one in sources]

    assert read(files[:4]) == ["lab/c{config}_e{exp}.npz"]
    assert read(files[:4], together=False) == names
    (tmp_path / "kept").mkdir()
    kept = [tmp_path / "kept" / file.name for file in files[:2]]
    for file in kept:
        recording(file)
    sources = read_sources(files[:4], channels, tmp_path, kept)[1]
    assert [(one["pattern"], one.get("role")) for one in sources] == [
        ("lab/c{config}_e{exp}.npz", None), ("kept/c{config}_e{exp}.npz", "test"),
    ]  # fmt: skip
    assert read(files) == [*names, "lab/notes.npz"]
    assert read(files[:3]) == names[:3]
    files[3].unlink()
    assert read(files[:3]) == names[:3]  # the second experiment of the second configuration is missing
    channels.write_text(told)
    assert read(files[:2]) == names[:2]


def test_what_is_kept_apart_goes_with_recordings(tmp_path: Path) -> None:
    """A channel map alone names what it reads; a further file would be lost without a word."""
    with pytest.raises(ConfigurationError, match=r"--keep-apart goes with RECORDs; .* `role: test`"):
        command("one_axis", channels=tmp_path / "map.yaml", keep_apart=[tmp_path / "a.npz"])
