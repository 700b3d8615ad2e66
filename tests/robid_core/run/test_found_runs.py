"""A run is found by its pipeline file though what the file names is gone: its data, its plant, its plugins."""

from pathlib import Path
from typing import Any

import pytest

from robid_core.errors import ConfigurationError, RobidError
from robid_core.pipeline import Pipeline
from robid_core.run import RunFolder


def test_the_run_of_a_pipeline_is_found_without_what_the_pipeline_names(world: Any) -> None:
    world.run()
    world.say("{use: strange.where}", "{use: strange.gone, with: {path: data that was there.csv}}")
    with pytest.raises(RobidError):
        Pipeline.load(world.file)
    assert RunFolder.find(world.file).path == world.folder


def test_a_file_that_is_no_pipeline_is_told_as_such(tmp_path: Path) -> None:
    (tmp_path / "notes.yaml").write_text("- just\n- a list\n")
    with pytest.raises(ConfigurationError, match=r"notes\.yaml:1"):
        RunFolder.find(tmp_path / "notes.yaml")


def test_a_run_is_found_by_its_name(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    world.run()
    monkeypatch.chdir(world.file.parent)
    assert RunFolder.find(Path(world.folder.name)).path.resolve() == world.folder.resolve()
    with pytest.raises(ConfigurationError, match="other: not a run, there is no such file or folder"):
        RunFolder.find(Path("other"))
