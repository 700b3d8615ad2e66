"""Hardware moves at most once, and only when somebody stands beside it."""

from __future__ import annotations

import json
from typing import Any

import pytest

from robid_core.errors import MotionRefused, PluginError, StoreError
from robid_core.run.motion import MotionRecords


@pytest.fixture
def robot_world(world: Any) -> Any:
    world.say("{use: strange}", "{use: strange_hardware}")
    return world


def states(world: Any) -> list[str]:
    return [motion.state for motion in MotionRecords(world.store, world.folder / "store" / "motions").all()]


def test_nothing_moves_unless_somebody_is_at_the_robot(robot_world: Any) -> None:
    with pytest.raises(
        MotionRefused, match=r"stage acquire: it would move the robot .*--at-the-robot"
    ) as caught:
        robot_world.run()
    assert caught.value.exit_code == 3
    assert robot_world.ran() == ["where"]
    assert states(robot_world) == []


def test_a_recording_is_made_once(robot_world: Any) -> None:
    robot_world.run(at_the_robot=True)
    assert robot_world.ran().count("acquire") == 1
    assert states(robot_world) == ["done"]
    robot_world.run(at_the_robot=True)
    robot_world.run()
    assert robot_world.ran() == []


def test_no_update_makes_a_robot_move_again(robot_world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    robot_world.run(at_the_robot=True)
    robot_world.ran()
    robot_world.install(editable=True, version="2.0")
    robot_world.edit("BIAS = 0.0", "BIAS = 0.5")
    monkeypatch.setattr("robid_core.run.identity.__version__", "9.9.9")
    robot_world.run()
    assert robot_world.ran() == ["where", "frf", "fit", "choose", "page"]


def test_force_moves_nothing(robot_world: Any) -> None:
    robot_world.run(at_the_robot=True)
    robot_world.ran()
    with pytest.raises(MotionRefused, match="--force makes no robot move"):
        robot_world.run(at_the_robot=True, force=("acquire",))
    robot_world.run(at_the_robot=True, force=("*",))
    assert "acquire" not in robot_world.ran()


def test_again_records_anew(robot_world: Any) -> None:
    robot_world.run(at_the_robot=True)
    robot_world.ran()
    with pytest.raises(MotionRefused, match="asked for by --again"):
        robot_world.run(again=True)
    robot_world.run(again=True, at_the_robot=True)
    assert robot_world.ran() == ["acquire"]


def test_after_a_kill_in_mid_motion_the_robot_does_not_move_by_itself(robot_world: Any) -> None:
    robot_world.say("{use: strange.measure,", "{use: strange.measure, with: {fault: killed},")
    assert robot_world.elsewhere(at_the_robot=True).returncode == 9
    assert states(robot_world) == ["started"]
    robot_world.say("{fault: killed}", "{noise: 0.2}")  # even another motion is not begun
    for _ in range(2):
        with pytest.raises(
            MotionRefused, match=r"D09: the motion of 'acquire' was started at .* not finished"
        ):
            robot_world.run(at_the_robot=True)
    robot_world.ran()
    robot_world.run(at_the_robot=True, again=True)
    assert robot_world.ran().count("acquire") == 1
    assert sorted(states(robot_world)) == ["done", "given up"]
    robot_world.run()
    assert robot_world.ran() == []


def test_a_motion_that_failed_is_not_repeated_by_itself(robot_world: Any) -> None:
    with pytest.raises(PluginError):
        robot_world.run("stages.acquire.with.fault=drive 2 is silent", at_the_robot=True)
    with pytest.raises(MotionRefused, match="D09"):
        robot_world.run("stages.acquire.with.fault=drive 2 is silent", at_the_robot=True)
    assert robot_world.ran().count("acquire") == 1


def test_a_motion_refused_before_anything_moved_may_be_tried_again(robot_world: Any) -> None:
    with pytest.raises(MotionRefused, match="D03"):
        robot_world.run("stages.acquire.with.fault=refused", at_the_robot=True)
    assert states(robot_world) == []
    assert robot_world.run(at_the_robot=True).exit_code == 0


def test_a_damaged_recording_is_never_made_again_by_itself(robot_world: Any) -> None:
    robot_world.run(at_the_robot=True)
    robot_world.ran()
    blob = robot_world.blob("acquire")
    whole = blob.read_bytes()
    robot_world.flip(blob)
    damaged = blob.read_bytes()
    for _ in range(2):
        with pytest.raises(
            StoreError, match=r"stage acquire: R06: .* is damaged.*cannot be computed again"
        ) as caught:
            robot_world.run(at_the_robot=True)
        assert caught.value.exit_code == 7
    assert blob.read_bytes() == damaged
    assert robot_world.ran() == []
    blob.write_bytes(whole)  # brought back from a copy
    assert robot_world.run().idle


@pytest.mark.parametrize("what", ["blob", "index"])
def test_a_lost_recording_is_told_and_made_again_only_on_demand(robot_world: Any, what: str) -> None:
    robot_world.run(at_the_robot=True)
    manifest = json.loads((robot_world.folder / "manifest.json").read_text())
    lost = {
        "blob": robot_world.blob("acquire"),
        "index": robot_world.folder / "store" / "index" / f"{manifest['stages']['acquire']['key']}.json",
    }[what]
    lost.unlink()
    robot_world.ran()
    with pytest.raises(StoreError, match="R06"):
        robot_world.run(at_the_robot=True)
    assert robot_world.ran() == []
    robot_world.run(at_the_robot=True, again=True)
    assert robot_world.ran() == ["acquire"]


def test_a_kill_between_data_and_done_loses_neither(robot_world: Any) -> None:
    robot_world.run(at_the_robot=True)
    record = next((robot_world.folder / "store" / "motions").iterdir())
    content = json.loads(record.read_text())
    record.write_text(json.dumps({**content, "state": "started"}))
    robot_world.ran()
    assert robot_world.run().idle
    assert states(robot_world) == ["done"]


def test_a_damaged_motion_record_counts_as_unfinished(robot_world: Any) -> None:
    robot_world.run(at_the_robot=True)
    next((robot_world.folder / "store" / "motions").iterdir()).write_text("{")
    with pytest.raises(MotionRefused, match="the record is damaged"):
        robot_world.run("stages.acquire.with.noise=0.5", at_the_robot=True)


def test_each_motion_has_a_raw_folder_of_its_own(robot_world: Any) -> None:
    robot_world.run(at_the_robot=True)
    robot_world.run(at_the_robot=True, again=True)
    names = sorted(path.name for path in (robot_world.folder / "raw").iterdir())
    assert names == ["acquire-1", "acquire-2"]
