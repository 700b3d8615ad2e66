"""`robid diagnose`: the pipeline that it writes, and its messages."""

from __future__ import annotations

from pathlib import Path

import pytest

from robid_core.commands.diagnose import (
    FILE,
    HEADING,
    Asked,
    below_one_folder,
    command,
    pipeline_text,
    robots_of,
)
from robid_core.errors import ConfigurationError
from robid_core.pipeline import Pipeline


def test_the_pipeline_reads_every_record_and_explains_them_together(tmp_path: Path) -> None:
    """It is valid, and asks for what was asked for."""
    for name in ("a.mcap", "b.mcap"):
        (tmp_path / name).write_bytes(b"")
    text = pipeline_text("one_axis", ["a.mcap", "b.mcap"], Asked(only=["friction.stribeck@axis_1"]))
    (tmp_path / FILE).write_text(text, encoding="utf-8")
    pipeline = Pipeline.load(tmp_path / FILE, data_root=tmp_path)
    stages = {node.name: node for node in pipeline.stages}
    assert tuple(stages["explain"].inputs["record"]) == ("record_1", "record_2")
    assert stages["explain"].stage.only == ("friction.stribeck@axis_1",)  # type: ignore[attr-defined]


def test_a_record_of_another_payload_has_its_robot(tmp_path: Path) -> None:
    """It is read as a variant of that name, which the diagnosis knows; a robot for no record is refused."""
    records = [tmp_path / "bare.mcap", tmp_path / "loaded.mcap"]
    for path in records:
        path.write_bytes(b"")
    (tmp_path / "arm.yaml").write_text("robid_robot: 1\nname: arm\nbase: one_axis\n", encoding="utf-8")
    names = [path.name for path in records]
    robots = robots_of([f"{records[1]}=arm.yaml"], records, names)
    assert robots == {"loaded.mcap": "arm.yaml"}
    (tmp_path / FILE).write_text(pipeline_text("one_axis", names, Asked(robots=robots)), encoding="utf-8")
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
    text = pipeline_text("one_axis", ["a.mcap", "b.mcap"], Asked(apart=["b.mcap"]))
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
    with pytest.raises(ConfigurationError, match="there is no such file"):
        below_one_folder([tmp_path / "c.mcap"], None)


def test_a_file_of_somebody_else_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor is anything run."""
    monkeypatch.chdir(tmp_path)
    record, mine = tmp_path / "a.mcap", tmp_path / FILE
    record.write_bytes(b"")
    mine.write_text("robid: 1\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match="was not written by robid diagnose"):
        command([record], "one_axis")
    assert mine.read_text(encoding="utf-8") == "robid: 1\n"
    assert HEADING.startswith("#")


def test_a_test_of_one_law_stands_alone(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="--test asks for one law"):
        command([tmp_path / "a.mcap"], "one_axis", only=["friction.dahl"], test="friction.stribeck@axis_1")
