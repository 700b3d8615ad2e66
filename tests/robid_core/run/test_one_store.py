"""Runs side by side are one store: what one made another takes over, and hardware moves once for all of them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from faults.fault import fault

from robid_core.errors import MotionRefused, StoreError
from robid_core.run import Action, RunOptions, preview_run
from robid_core.run.folder import RunFolder
from robid_core.store import canonical_json, text_hash

OTHER = ("name=other", "stages.fit.with.rows=3")


@pytest.fixture
def robot_world(world: Any) -> Any:
    world.say("{use: strange}", "{use: strange_hardware}")
    return world


def other(world: Any) -> Path:
    return Path(world.project / "runs" / "other")


def blobs(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_ino for path in (folder / "store" / "blobs").iterdir()}


@fault(
    "R04",
    sees="a run beside this one that only another user may read takes no part",
    mutant=("robid_core/run/folder.py", "    except PermissionError:", "    except FileExistsError:"),
)
def test_R04_a_run_beside_that_may_not_be_read_is_passed_over(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed, is_dir = other(world) / "store" / "index", Path.is_dir

    def refused(path: Path) -> bool:
        if path == closed:
            raise PermissionError(13, "Permission denied", str(path))
        return is_dir(path)

    closed.mkdir(parents=True)
    assert RunFolder(world.folder).others() == (other(world),)
    monkeypatch.setattr(Path, "is_dir", refused)
    assert RunFolder(world.folder).others() == ()


def test_another_fit_under_another_name_does_not_measure_again(world: Any) -> None:
    world.run()
    world.ran()
    before = world.hashes()
    told = {one.stage: one for one in preview_run(world.pipeline(*OTHER), RunOptions())}
    assert told["acquire"].action is Action.KEEP
    assert told["acquire"].reasons == ("made by run 'strange'",)
    assert not other(world).exists()  # a preview writes nothing
    result = world.run(*OTHER)
    assert world.ran() == ["fit", "choose", "page"]
    assert [name for name, outcome in result.outcomes.items() if outcome == "kept"] == [
        "where",
        "acquire",
        "frf",
    ]
    assert world.hashes() == before
    shared = blobs(world.folder).items() & blobs(other(world)).items()
    assert len(shared) >= 3  # second names, no copies


def test_a_run_stays_whole_when_the_one_that_it_took_from_is_deleted(world: Any) -> None:
    world.run()
    world.run(*OTHER)
    shutil.rmtree(world.folder)
    world.ran()
    assert world.run(*OTHER).idle
    assert world.ran() == []


def test_a_damaged_artifact_of_another_run_is_not_taken(world: Any) -> None:
    world.run()
    world.flip(world.blob("acquire"))
    world.ran()
    assert world.run(*OTHER).outcomes["acquire"] == "made"
    assert world.ran()[0] == "acquire"


def test_what_a_newer_robid_left_beside_is_passed_over(world: Any) -> None:
    world.run()
    for path in (world.folder / "store" / "index").iterdir():
        content = {**json.loads(path.read_text()), "format": 99}
        content["check"] = text_hash(canonical_json({k: v for k, v in content.items() if k != "check"}))
        path.write_text(json.dumps(content))
    assert world.run(*OTHER).outcomes["acquire"] == "made"


def test_a_recording_serves_all_runs_of_a_folder(robot_world: Any) -> None:
    robot_world.run(at_the_robot=True)
    robot_world.ran()
    robot_world.run(*OTHER)  # nobody is at the robot
    assert "acquire" not in robot_world.ran()
    shutil.rmtree(robot_world.folder)
    robot_world.run(*OTHER)
    assert robot_world.ran() == []


def test_a_recording_that_another_run_made_and_lost_is_not_made_again_by_itself(robot_world: Any) -> None:
    robot_world.run(at_the_robot=True)
    robot_world.flip(robot_world.blob("acquire"))
    robot_world.ran()
    with pytest.raises(StoreError, match=r"stage acquire: R06: .*cannot be computed again"):
        robot_world.run(*OTHER, at_the_robot=True)
    assert "acquire" not in robot_world.ran()
    robot_world.run(*OTHER, at_the_robot=True, again=True)
    assert robot_world.ran().count("acquire") == 1
    robot_world.run(*OTHER)
    assert robot_world.ran() == []


def test_a_motion_that_another_run_began_is_not_begun_again(robot_world: Any) -> None:
    fault = "stages.acquire.with.fault=killed"
    robot_world.say("{use: strange.measure,", "{use: strange.measure, with: {fault: killed},")
    assert robot_world.elsewhere(at_the_robot=True).returncode == 9
    robot_world.ran()
    with pytest.raises(MotionRefused, match="D09: the motion of 'acquire' was started"):
        robot_world.run(*OTHER, fault, at_the_robot=True)
    assert "acquire" not in robot_world.ran()
