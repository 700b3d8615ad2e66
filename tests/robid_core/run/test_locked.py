"""--locked refuses a run that is not the one in the manifest, and says how it differs."""

from __future__ import annotations

import json
from typing import Any

import pytest

from robid_core.errors import ConfigurationError, StoreError
from robid_core.run.manifest import with_hash


def refusal(world: Any, *overrides: str) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        world.run(*overrides, locked=True)
    assert caught.value.exit_code == 2
    return [line.strip() for line in str(caught.value).splitlines() if line.startswith("  ")]


def test_there_must_be_a_manifest(world: Any) -> None:
    with pytest.raises(ConfigurationError, match="no manifest"):
        world.run(locked=True)


def test_the_same_run_is_allowed_also_from_an_empty_store(world: Any) -> None:
    world.run()
    before = world.hashes()
    assert world.run(locked=True).idle
    for path in (world.folder / "store" / "index").iterdir():
        path.unlink()
    world.run(locked=True)
    assert world.hashes() == before


def test_settings_of_the_file_and_of_the_command_line_are_named(world: Any) -> None:
    world.run()
    assert refusal(world, "stages.fit.with.hold=0.1") == [
        "--set: [] -> ['stages.fit.with.hold=0.1']",
        "stage fit: setting hold: 0.0 -> 0.1",
    ]
    world.say("seed: 7", "seed: 8")
    lines = refusal(world)
    assert lines[:2] == ["the pipeline file changed", "seed: 7 -> 8"]
    assert "stage fit: seed changed" in lines


def test_versions_threads_and_robot_are_named(world: Any) -> None:
    world.run()
    path = world.folder / "manifest.json"
    content = json.loads(path.read_text())
    content["environment"]["versions"]["numpy"] = "1.0.0"
    content["environment"]["threads"]["kernels"] = 8
    content["robot"]["sha256"] = "0" * 64
    path.write_text(json.dumps(with_hash(content)))
    lines = refusal(world)
    assert lines[0].startswith("the robot changed")
    assert lines[1].startswith("numpy: 1.0.0 -> 2")
    assert lines[2] == "threads of kernels: 8 -> 1"


def test_plugins_and_stages_are_named(world: Any) -> None:
    world.run()
    world.install(editable=True, version="1.1")
    world.say("  page:", "  other: {use: strange.where}\n  page:")
    lines = refusal(world)
    assert "stage other is new" in lines
    assert 'stage fit: version of the plugin: "1.0" -> "1.1"' in lines


def test_a_refusal_changes_nothing(world: Any) -> None:
    world.run()
    before = (world.folder / "manifest.json").read_bytes()
    world.ran()
    refusal(world, "seed=9")
    assert (world.folder / "manifest.json").read_bytes() == before
    assert world.ran() == []


def test_the_manifest_holds_what_a_run_was_made_of(world: Any) -> None:
    world.run("stages.fit.with.hold=0.001")
    content = json.loads((world.folder / "manifest.json").read_text())
    assert content["status"] == "done"
    assert {"python", "robid", "numpy", "scipy", "numba", "pydantic", "h5py", "robid_strange_stages"} <= set(
        content["environment"]["versions"]
    )
    assert "pytest" not in content["environment"]["versions"]  # took no part
    assert content["environment"]["threads"] == {"linear_algebra": 1, "kernels": 1}
    assert content["environment"]["platform"]["processor"]
    assert content["pipeline"]["overrides"] == ["stages.fit.with.hold=0.001"]
    assert content["stages"]["fit"]["inputs"] == {"frf": "frf"}
    assert content["stages"]["fit"]["sha256"] == world.hashes()["fit.h5"]
    assert len(content["stages"]["fit"]["ingredients"]["seed"]) == 32
    assert (world.folder / "pipeline.yaml").read_bytes() == world.file.read_bytes()


def test_a_newer_manifest_is_told(world: Any) -> None:
    world.run()
    path = world.folder / "manifest.json"
    path.write_text(json.dumps(with_hash(json.loads(path.read_text()) | {"robid_manifest": 99})))
    with pytest.raises(StoreError, match="newer robid"):
        world.run()
