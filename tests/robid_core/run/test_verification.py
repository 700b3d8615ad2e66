"""What stands in a run's folder is held against what the run wrote: manifest, raw logs, artifacts by their names."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from faults.fault import fault
from fuzz.damage import damaged

from robid_core.commands.show import run_lines, verification_line
from robid_core.errors import StoreError
from robid_core.run import Manifest, RunOptions, Silence, preview_run
from robid_core.run.folder import RunFolder
from robid_core.run.manifest import with_hash
from robid_core.run.results import manifest_of
from robid_core.run.verification import changed_files, known_hash, raw_logs


class Ear(Silence):
    def __init__(self) -> None:
        self.heard: list[str] = []

    def note(self, text: str) -> None:
        self.heard.append(text)


@fault(
    "R06",
    sees="exit 7 of `robid show` and `robid diff`: the manifest is damaged; run again: it is written anew",
    mutant=(
        "robid_core/run/manifest.py",
        '    if ("check" in content or version > 1) and content.get("check") != with_hash(content)["check"]:',
        "    if False:",
    ),
)
def test_a_damaged_manifest_never_reads_as_another_one(world: Any) -> None:
    world.run()
    path = world.folder / "manifest.json"
    whole = path.read_bytes()
    folder = RunFolder(world.folder)
    sound, same, messages = Manifest.read(folder), 0, []
    for number in range(600):
        path.write_bytes(damaged(whole, number)[0])
        try:
            assert Manifest.read(folder) == sound
            same += 1  # white space
        except StoreError as error:
            messages.append(str(error))
    assert same < 60
    assert all(f"R06: {path}: damaged (" in message for message in messages)


@fault(
    "R06",
    sees="a note that the damaged manifest was set aside, and where; the run goes on, nothing finished is made again",
    mutant=(
        "robid_core/run/manifest.py",
        "    except DamagedManifest as error:",
        "    except KeyError as error:",
    ),
)
@pytest.mark.parametrize(
    "content", [b"", b"\x00" * 50, b"[]", b'{"robid_manifest": 2}', b"\xff\xfe{", b"[" * 5000]
)
def test_a_damaged_manifest_is_set_aside_and_in_nobodys_way(world: Any, content: bytes) -> None:
    world.run()
    before = world.hashes()
    world.ran()
    path = world.folder / "manifest.json"
    path.write_bytes(content)
    pipeline = world.pipeline()
    assert all(one.entry is not None for one in preview_run(pipeline, RunOptions()))
    with pytest.raises(StoreError, match="nothing to hold this run to; run without --locked"):
        preview_run(pipeline, RunOptions(locked=True))
    ear = Ear()
    world.run(listener=ear)
    assert world.ran() == []
    assert world.hashes() == before
    (note,) = ear.heard
    assert "R06: " in note
    aside = Path(note.rpartition("set aside as ")[2])
    assert aside.read_bytes() == content
    assert Manifest.read(RunFolder(world.folder)) is not None


def test_a_manifest_of_the_format_before_is_read(world: Any) -> None:
    world.run()
    path = world.folder / "manifest.json"
    content = json.loads(path.read_text()) | {"robid_manifest": 1}
    del content["check"]
    for record in content["stages"].values():
        del record["raw"]
    path.write_text(json.dumps(content))
    manifest = Manifest.read(RunFolder(world.folder))
    assert manifest is not None
    assert not any(record.raw for record in manifest.stages.values())


@fault(
    "R06",
    sees="`robid show RUN`: which raw log, artifact or page is missing, changed or damaged since the run made it",
    mutant=("robid_core/run/runner.py", "raw_logs(self.folder, node.name)", "dict[str, str]()"),
)
def test_the_hash_of_a_raw_log_stands_in_the_manifest_and_is_held_against_it(world: Any) -> None:
    raw = world.folder / "raw"
    raw.mkdir(parents=True)
    (raw / "acquire.mcap").write_bytes(b"as measured")
    (raw / "acquire.mcap.part").write_bytes(b"of a run that was killed")
    world.run()
    folder = RunFolder(world.folder)
    assert manifest_of(folder).stages["acquire"].raw == {
        "raw/acquire.mcap": hashlib.sha256(b"as measured").hexdigest()
    }
    world.run()  # kept stages keep it
    manifest = manifest_of(folder)
    assert "raw/acquire.mcap" in manifest.stages["acquire"].raw
    assert changed_files(folder, manifest) == []
    (raw / "acquire.mcap").write_bytes(b"as measurec")
    (words,) = changed_files(folder, manifest)
    assert words == f"R06: {raw / 'acquire.mcap'}: changed or damaged since the run made it"
    assert words in run_lines(folder, manifest)
    (raw / "acquire.mcap").unlink()
    assert changed_files(folder, manifest) == [f"R06: {raw / 'acquire.mcap'}: is missing"]


def test_each_motion_of_a_stage_has_its_log_and_no_other_stages(tmp_path: Path) -> None:
    for name in ("raw/a-1/a.mcap", "raw/a-2/a.mcap", "raw/a-b-1/a-b.mcap", "raw/a-b.mcap", "raw/a-x/a.mcap"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(name.encode())
    assert list(raw_logs(RunFolder(tmp_path), "a")) == ["raw/a-1/a.mcap", "raw/a-2/a.mcap"]
    assert list(raw_logs(RunFolder(tmp_path), "a-b")) == ["raw/a-b-1/a-b.mcap", "raw/a-b.mcap"]
    assert raw_logs(RunFolder(tmp_path), "c") == {}


@fault(
    "R06",
    sees="exit 7 of `robid show FILE`: not what the run made; without a run: verified by its seal, or not verified",
    mutant=("robid_core/commands/show.py", "        refuse_damaged(path, sha256)\n", "        pass\n"),
)
@pytest.mark.parametrize("name", ["fit.h5", "page.html"])
def test_show_verifies_a_file(world: Any, name: str, tmp_path: Path) -> None:
    world.run()
    path = world.folder / "artifacts" / name
    assert verification_line(path) == "  verified: these are the bytes that the run made"
    loose = tmp_path / name
    shutil.copyfile(path, loose)
    sealed = "verified: these are the bytes that were written"
    unsealed = "not verified: no manifest beside it knows this file, and it has no seal"
    assert verification_line(loose) == f"  {sealed if name == 'fit.h5' else unsealed}"
    other = world.folder / "artifacts" / ("where.h5" if name == "fit.h5" else "x.html")
    content = other.read_bytes() if other.exists() else b"<html>another page</html>"
    path.unlink()
    path.write_bytes(content)  # sealed as well, and another result
    with pytest.raises(StoreError, match="not what the run made"):
        verification_line(path)


def test_a_file_that_no_manifest_knows_has_no_hash(world: Any) -> None:
    world.run()
    stray = world.folder / "artifacts" / "stray.h5"
    stray.write_bytes(b"")
    assert known_hash(stray) == ""
    assert known_hash(world.folder / "artifacts" / "fit.h5") == world.hashes()["fit.h5"]


Broken = Callable[[dict[str, Any]], object]


@pytest.mark.parametrize(
    "broken",
    [
        lambda c: c.pop("stages"),
        lambda c: c.update(stages=[1]),
        lambda c: c.update(more=1),
        lambda c: c.pop("seed"),
    ],
)
def test_a_manifest_with_a_right_hash_and_wrong_content_is_damaged_too(world: Any, broken: Broken) -> None:
    world.run()
    path = world.folder / "manifest.json"
    content = json.loads(path.read_text())
    broken(content)
    path.write_text(json.dumps(with_hash(content)))
    with pytest.raises(StoreError, match="damaged"):
        Manifest.read(RunFolder(world.folder))
