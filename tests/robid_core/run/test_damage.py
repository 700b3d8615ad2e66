"""A damaged artifact is named, set aside and made again, never used (R06, R07, A02)."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults.fault import fault

from robid_core.errors import StoreError
from robid_core.run import Silence


class Ear(Silence):
    def __init__(self) -> None:
        self.heard: list[str] = []

    def note(self, text: str) -> None:
        self.heard.append(text)


@pytest.mark.parametrize("stage", ["where", "frf", "page"])
def test_a_flipped_byte_anywhere_is_found_and_mended(world: Any, stage: str) -> None:
    world.run()
    before = world.hashes()
    world.ran()
    blob = world.blob(stage)
    size = blob.stat().st_size
    generator = np.random.default_rng(3)
    for place in [0, size - 1, *generator.integers(size, size=3)]:
        world.flip(world.blob(stage), int(place))
        ear = Ear()
        result = world.run(listener=ear)
        assert world.ran() == [stage]
        assert result.outcomes[stage] == "same"
        assert world.hashes() == before
        assert len(ear.heard) == 1
        assert "R06" in ear.heard[0]
        assert blob.name in ear.heard[0]
    assert len(list((world.folder / "store" / "quarantine").iterdir())) == 10  # 5 blobs and their entries


def test_a_file_edited_under_its_public_name_is_found_too(world: Any) -> None:
    world.run()
    before = world.hashes()
    public = world.folder / "artifacts" / "fit.h5"
    assert public.stat().st_mode & 0o222 == 0
    public.chmod(0o644)
    public.write_bytes(b"mine")  # the same file as in the store
    world.ran()
    world.run()
    assert world.ran() == ["fit"]
    assert world.hashes() == before


def test_a_public_file_that_was_replaced_or_deleted_comes_back(world: Any) -> None:
    world.run()
    before = world.hashes()
    (world.folder / "artifacts" / "fit.h5").unlink()
    page = world.folder / "artifacts" / "page.html"
    page.unlink()
    page.write_text("mine")
    world.ran()
    world.run()
    assert world.ran() == []
    assert world.hashes() == before


@pytest.mark.parametrize("damage", ["flip", "empty", "missing", "not json", "another key"])
def test_a_damaged_index_entry_is_as_good_as_none(world: Any, damage: str) -> None:
    result = world.run()
    before = world.hashes()
    folder = world.folder / "store" / "index"
    entry: Path = folder / f"{result.manifest.stages['frf'].key}.json"
    if damage == "flip":
        world.flip(entry, entry.read_bytes().index(b"sha256") + 12)
    elif damage == "missing":
        entry.unlink()
    elif damage == "another key":
        entry.write_bytes((folder / f"{result.manifest.stages['fit'].key}.json").read_bytes())
    else:
        entry.write_bytes({"empty": b"", "not json": b"[1, 2"}[damage])
    world.ran()
    world.run()
    assert world.ran() == ["frf"]
    assert world.hashes() == before


def test_every_bit_of_an_index_entry_is_guarded(world: Any) -> None:
    result = world.run(last="where")
    key = result.manifest.stages["where"].key
    path = world.folder / "store" / "index" / f"{key}.json"
    whole = path.read_bytes()
    good = world.store.lookup(key)
    newer: list[str] = []
    for place in range(len(whole)):
        data = bytearray(whole)
        data[place] ^= 4
        path.write_bytes(data)
        try:
            found = world.store.lookup(key)
        except StoreError as error:  # the digit of the format became a larger one
            newer.append(str(error))
            continue
        assert found.state.value == "damaged" or found == good, place
    assert all("newer robid" in line for line in newer)


def test_two_keys_with_the_same_bytes_are_both_mended(world: Any) -> None:
    world.run()
    world.run("stages.fit.with.hold=0.001")  # the same bytes under a second key
    world.flip(world.blob("fit"))
    world.run("stages.fit.with.hold=0.001")
    world.ran()
    assert world.run().exit_code == 0
    assert world.run().idle


def socket_at(path: Path) -> None:
    """Leave a socket, by a path that is short enough for one."""
    with contextlib.chdir(path.parent), socket.socket(socket.AF_UNIX) as made:
        made.bind("s")
        Path("s").rename(path.name)


NO_FILES: dict[str, Callable[[Path], None]] = {
    "pipe": os.mkfifo,
    "folder": Path.mkdir,
    "socket": socket_at,
    "link to itself": lambda path: path.symlink_to(path.name),
}


@fault(
    "R06",
    sees="a pipe, a folder, a socket or a link to itself where a file of the store belongs is set aside, and what it "
    "held is made again",
    mutant=(
        "robid_core/store/files.py",
        "    if stat.S_ISREG(os.fstat(descriptor).st_mode):",
        "    if True:",
    ),
)
@pytest.mark.parametrize("kind", NO_FILES)
@pytest.mark.parametrize("place", ["blob", "index", "page"])
def test_R06_what_is_no_file_is_set_aside_and_not_waited_for(world: Any, place: str, kind: str) -> None:
    result = world.run()
    before = world.hashes()
    path: Path = {
        "blob": world.blob("fit"),
        "index": world.folder / "store" / "index" / f"{result.manifest.stages['fit'].key}.json",
        "page": world.folder / "artifacts" / "page.html",
    }[place]
    path.unlink()
    NO_FILES[kind](path)
    if (place, kind) == ("page", "folder"):  # it may hold what a person has put there
        with pytest.raises(
            StoreError, match=r"page\.html.*a folder stands where a file belongs; move it away"
        ):
            world.run()
        path.rmdir()
    world.ran()
    ear = Ear()
    world.run(listener=ear)
    assert world.ran() == ([] if place == "page" else ["fit"])
    assert world.hashes() == before
    damaged = [heard for heard in ear.heard if "R06: " in heard]
    assert all(f"{path.name} is no file" in heard for heard in damaged)
    assert len(damaged) == (place != "page")


@fault(
    "R03",
    sees="exit 7: a log that is a pipe or a folder is no file, to be moved away; a pipe is not waited for",
    mutant=(
        "robid_core/run/log.py",
        "        if path.is_fifo() or path.is_dir() or path.is_socket():",
        "        if False:",
    ),
)
@pytest.mark.parametrize("kind", ["pipe", "folder", "socket"])
def test_R03_a_log_that_is_no_file_is_told(world: Any, kind: str) -> None:
    world.run()
    log = world.folder / "log.txt"
    log.unlink()
    NO_FILES[kind](log)
    done = world.elsewhere()
    assert done.returncode == 7
    assert f"cannot write {log}: {log} is no file" in done.stderr
    assert "move it away and run again" in done.stderr


@fault(
    "R06",
    sees="a pipe, a folder or a socket where the manifest belongs is set aside, and a manifest is written",
    mutant=(
        "robid_core/run/manifest.py",
        "            except NoFile as error:",
        "            except ZeroDivisionError as error:",
    ),
)
@pytest.mark.parametrize("kind", NO_FILES)
def test_R06_what_stands_for_the_manifest_is_set_aside(world: Any, kind: str) -> None:
    world.run()
    before = world.hashes()
    manifest = world.folder / "manifest.json"
    manifest.unlink()
    NO_FILES[kind](manifest)
    world.ran()
    ear = Ear()
    world.run(listener=ear)
    assert world.ran() == []
    assert world.hashes() == before
    assert (
        "manifest.json: damaged (a folder, a pipe or a device stands there); it was set aside" in ear.heard[0]
    )
    assert '"status": "done"' in manifest.read_text()


@fault(
    "R04",
    sees="exit 7: which of the folders is none, not the folder of the whole run, and to move that away",
    mutant=("robid_core/store/files.py", "error.errno in (errno.ENOTDIR, errno.EEXIST) and", "False and"),
)
@pytest.mark.parametrize("name", ["artifacts", "store", "store/blobs", "store/temporary"])
def test_R04_a_file_in_place_of_a_folder_is_named(world: Any, name: str) -> None:
    world.run(last="where")
    place = world.folder / name
    place.rename(world.project / "away")
    place.write_text("mine")
    with pytest.raises(StoreError, match=f": {place} is no folder; .*move it away and run again"):
        world.run(last="where")


@fault(
    "R04",
    sees="exit 7: a lock that is a pipe or a device is no file, and to move it away",
    mutant=(
        "robid_core/run/lock.py",
        "            if not stat.S_ISREG(os.fstat(descriptor).st_mode):",
        "            if False:",
    ),
)
def test_R04_a_lock_that_is_no_file_is_told(world: Any) -> None:
    world.run(last="where")
    lock = world.folder / "store" / "lock"
    lock.unlink()
    lock.symlink_to("/dev/null")
    with pytest.raises(StoreError, match=r"cannot lock .*lock is no file; .*move it away and run again"):
        world.run(last="where")
