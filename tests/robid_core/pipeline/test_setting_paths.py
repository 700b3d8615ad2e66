"""Files that settings name: inside the project or below the data root, there, and nowhere else."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from robid_core import ConfigurationError, StageRef
from robid_core.pipeline import Pipeline
from robid_core.pipeline.places import find_places, project_root
from robid_core.settings_types import Places, locate_in_project, relative_path

Load = Callable[..., Pipeline]
Read = Callable[..., list[str]]


def pipeline_text(settings: str, robot: str = "one_axis") -> str:
    return (
        f"robid: 1\nname: example\nseed: 7\nrobot: {robot}\n"
        f"stages:\n  read: {{use: acquisition.recorded, with: {{{settings}}}}}\n"
    )


@pytest.fixture(name="data")
def data_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "a.csv").write_text("1\n")
    return folder


def test_named_files_are_found_and_listed(load: Load, data: Path, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text("x: 1\n")
    node = load(pipeline_text("path: a.csv, channels: map.yaml"), data_root=data).stage("read")
    assert node.stage.path == "a.csv"  # type: ignore[attr-defined]
    channels = node.stage.channels  # type: ignore[attr-defined]
    assert Path(channels).read_text() == "x: 1\n"  # opens from anywhere
    assert node.stage.model_dump(mode="json")["channels"] == "map.yaml"  # and is saved as it was written
    assert [(file.setting, file.written, file.path) for file in node.files] == [
        ("path", "a.csv", data / "a.csv"),
        ("channels", "map.yaml", tmp_path / "map.yaml"),
    ]


def test_a_missing_recording_says_where_it_was_looked_for_and_where_to_get_it(
    problems: Read, data: Path
) -> None:
    (line,) = problems(pipeline_text("path: b.csv, origin: example.org"), data_root=data)
    assert line == (
        f"bad.yaml:6:44: stages.read.with.path: there is no file 'b.csv' in the data folder {data} (given by "
        "--data); get it from example.org and set ROBID_DATA or pass --data to the folder that holds b.csv"
    )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("path: /etc/passwd", "'/etc/passwd' is absolute"),
        (
            "path: ../a.csv",
            "'../a.csv' leaves its root by '..'; paths begin at the folder of the pipeline file",
        ),
        ("path: x/../../a.csv", "leaves its root by '..'"),
        ("path: 'C:a.csv'", "'C:a.csv' is absolute"),
        ("path: ~/a.csv", "'~/a.csv' is absolute"),
        ("path: 'x\\..\\a.csv'", "has a backslash"),
        ('path: "a\\0.csv"', "a path must be printable text"),
        ("path: ''", "a path must be printable text"),
        ("path: nul.csv", "'nul.csv' is the name of a device"),
        ("path: a.csv, channels: /etc/passwd", "'/etc/passwd' is absolute"),
        ("path: a.csv, channels: none.yaml", "there is no file 'none.yaml' in"),
        ("path: a.csv, channels: link/hostname", "leads out of the project"),
    ],
)
def test_paths_that_lead_elsewhere_are_refused(
    problems: Read, data: Path, tmp_path: Path, settings: str, message: str
) -> None:
    outside = tmp_path.parent / f"{tmp_path.name}-outside"
    outside.mkdir()
    (outside / "hostname").write_text("x")
    (tmp_path / "link").symlink_to(outside)
    (line,) = problems(pipeline_text(settings), data_root=data)
    assert message in line
    assert line.startswith("bad.yaml:6:")


def test_a_plugin_that_settings_will_need_is_looked_for_now(problems: Read, data: Path) -> None:
    (line,) = problems(pipeline_text("path: a.csv, reader: tape"), data_root=data)
    assert line.startswith("bad.yaml:6:10: stages.read.use: no reader of recordings 'tape'; ")


@pytest.mark.parametrize(
    ("origin", "told"),
    [
        ("nowhere", "the second half is not there"),
        (
            "broken",
            "'acquisition.recorded' (unknown 0) breaks the contract of stages: external_files: KeyError: 'half'",
        ),
    ],
)
def test_what_a_stage_says_of_its_data_files_is_told_with_the_rest(
    problems: Read, data: Path, origin: str, told: str
) -> None:
    found = problems(
        pipeline_text(f"path: a.csv, origin: {origin}") + "  frf: {use: frf.lgo}\n", data_root=data
    )
    assert found[0] == f"bad.yaml:6:37: stages.read.with: {told}"
    assert found[1].startswith("bad.yaml:7:9: stages.frf.use: no stage 'frf.lgo'")


def test_keys_of_nested_settings_are_told_where_they_stand(problems: Read, data: Path) -> None:
    found = problems(
        pipeline_text("path: a.csv, filters: [{cutoff_hz: 3}, {cutof_hz: 0}, {cutoff_hz: 0}]"), data_root=data
    )
    assert found == [
        "bad.yaml:6:84: stages.read.with.filters[1].cutof_hz: unknown key 'cutof_hz'; did you mean 'cutoff_hz'?",
        "bad.yaml:6:99: stages.read.with.filters[2].cutoff_hz: 0 must be greater than 0",
    ]


@pytest.mark.parametrize("robot", ["/etc/robot.yaml", "../robot.yaml", "none.yaml", "robots/none"])
def test_a_robot_outside_the_project_is_refused(problems: Read, data: Path, robot: str) -> None:
    (line,) = problems(pipeline_text("path: a.csv", robot), data_root=data)
    assert line.startswith("bad.yaml:4:1: robot: ")


def test_a_wrong_robot_file_is_told_at_the_robot(problems: Read, data: Path, tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text("robid_robot: 1\n")
    found = problems(pipeline_text("path: a.csv", "robot.yaml"), data_root=data)
    assert all(line.startswith("bad.yaml:4:1: robot: robot.yaml:1:1: ") for line in found)


parts = st.text(st.characters(codec="utf-8"), max_size=6) | st.sampled_from(
    ["..", ".", "", "a", "con", "NUL.txt", "~"]
)


@given(st.lists(parts, min_size=1, max_size=5).map("/".join))
def test_no_accepted_path_leaves_its_root(text: str) -> None:
    try:
        accepted = relative_path(text)
    except ValueError:
        return
    root = "/a/b/c"
    assert os.path.normpath(f"{root}/{accepted}").startswith(root)
    assert "\0" not in accepted


def test_an_accepted_file_is_inside_the_project(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "x").write_text("")
    (tmp_path / "inside").symlink_to(tmp_path / "sub" / "x")
    assert locate_in_project("inside", tmp_path, tmp_path) == (tmp_path / "sub" / "x").resolve()


def test_the_project_is_the_nearest_folder_with_a_mark(tmp_path: Path) -> None:
    inner = tmp_path / "examples" / "one"
    inner.mkdir(parents=True)
    (tmp_path / "pyproject.toml").write_text("")
    assert project_root(inner) == tmp_path


def test_the_data_root_is_the_option_then_the_environment_then_the_default(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project, first, second = tmp_path / "p", tmp_path / "first", tmp_path / "second"
    for folder in (project, first, second):
        folder.mkdir()
    (project / "pyproject.toml").write_text("")
    monkeypatch.delenv("ROBID_DATA", raising=False)
    assert find_places(project / "p.yaml").data_root == (tmp_path / "shared" / "data").resolve()
    monkeypatch.setenv("ROBID_DATA", str(second))
    assert find_places(project / "p.yaml").data_root == second
    assert find_places(project / "p.yaml", first).data_root == first
    monkeypatch.setenv("ROBID_DATA", str(tmp_path / "none"))
    with pytest.raises(ConfigurationError, match="given by ROBID_DATA"):
        find_places(project / "p.yaml")


def test_settings_without_a_file_around_them_are_checked_by_their_text_only() -> None:
    assert isinstance(find_places(Path("p.yaml")), Places)
    assert StageRef.model_validate("frf.log") == StageRef(use="frf.log")
    assert StageRef.model_validate("frf.log").model_dump_json() == '"frf.log"'
    long = StageRef(use="frf.log", with_={"discard": 1})
    assert StageRef.model_validate_json(long.model_dump_json(), strict=True) == long
