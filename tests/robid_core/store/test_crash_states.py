"""Whatever the power failure leaves, an artifact is there whole or not at all (R02)."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from robid_crash_states import NotingFiles, crash_states, lay_out  # type: ignore[import-not-found]

from robid_core import Configurations
from robid_core.run.motion import MotionRecords
from robid_core.store import Files, State, Store

KEY = "ab" * 32


def states_of(tmp_path: Path, files: Any, work: Callable[[Store], None]) -> Iterator[tuple[bool, Path]]:
    """Yield (the work was over, folder) for each state that a crash during the work may leave."""
    root = tmp_path / "noted"
    root.mkdir()
    files.root = root
    (root / "run").mkdir()
    files.done = [(("make_folder", "run"), b""), (("sync_folder", ""), b"")]
    work(Store(root / "run", files))
    for number, (count, folders, contents) in enumerate(crash_states(files.done, first=2)):
        place = tmp_path / f"state-{number}"
        lay_out(place, folders, contents)
        yield count == len(files.done), place / "run"
        shutil.rmtree(place)


def put_and_publish(artifact: Configurations) -> Callable[[Store], None]:
    def work(store: Store) -> None:
        store.prepare()
        store.publish("where", store.put(KEY, "where", artifact, {"settings": {"a": 1}}, False))

    return work


def is_whole_or_absent(folder: Path, over: bool, artifact: Configurations) -> bool:
    """Tell whether a store in this state keeps its promise."""
    store = Store(folder)
    found = store.lookup(KEY)
    public = folder / "artifacts" / "where.h5"
    if found.state is State.DAMAGED or (over and found.state is State.ABSENT):
        return False
    if public.exists() and (Configurations.read(public).angle != artifact.angle).any():
        return False
    if found.entry is not None:
        assert (store.read(found.entry, Configurations).angle == artifact.angle).all()
    return True


def test_an_artifact_is_whole_or_absent_in_every_crash_state(
    tmp_path: Path, artifact: Configurations
) -> None:
    count = 0
    for over, folder in states_of(tmp_path, NotingFiles(tmp_path), put_and_publish(artifact)):
        assert is_whole_or_absent(folder, over, artifact)
        put_and_publish(artifact)(Store(folder))  # the next run
        assert is_whole_or_absent(folder, True, artifact)
        assert list((folder / "store" / "temporary").iterdir()) == []
        count += 1
    assert count > 50


def test_what_is_taken_over_is_whole_or_absent_in_every_crash_state_and_its_owner_keeps_it(
    tmp_path: Path, artifact: Configurations
) -> None:
    """Both runs are in the noted sequence; states are looked at from where the second takes over."""
    files, root = NotingFiles(tmp_path), tmp_path / "noted"
    files.root = root
    for name in ("first", "run"):
        (root / name).mkdir(parents=True)
    files.done = [
        (("make_folder", "first"), b""),
        (("make_folder", "run"), b""),
        (("sync_folder", ""), b""),
    ]
    put_and_publish(artifact)(Store(root / "first", files))
    Store(root / "run", files).prepare()
    begun = len(files.done)

    def second_run(store: Store) -> None:
        entry = store.lookup(KEY).entry
        assert entry is not None
        store.take_over(entry)
        store.publish("where", entry)

    second_run(Store(root / "run", files, [root / "first"]))
    assert any(step[0] == "link" and "blobs" in step[1] for step, _ in files.done[begun:])
    count = 0
    for done, folders, contents in crash_states(files.done, first=begun):
        place = tmp_path / f"state-{count}"
        lay_out(place, folders, contents)
        assert is_whole_or_absent(place / "run", done == len(files.done), artifact)
        second_run(Store(place / "run", None, [place / "first"]))
        assert is_whole_or_absent(place / "run", True, artifact)
        assert is_whole_or_absent(place / "first", True, artifact)
        shutil.rmtree(place)
        count += 1
    assert count > 20


class _NoFileSync(NotingFiles):  # type: ignore[misc]
    def sync(self, path: Path) -> None:
        Files.sync(self, path)


class _NoFolderSync(NotingFiles):  # type: ignore[misc]
    def sync_folder(self, path: Path) -> None:
        if path.name != "blobs":
            super().sync_folder(path)


class _IndexFirst(NotingFiles):  # type: ignore[misc]
    """Notes the index entry as if it had been renamed before the bytes were."""

    def replace(self, source: Path, target: Path) -> None:
        super().replace(source, target)
        if target.parent.name == "index":
            rename = self.done.pop()
            blob = next(i for i, (op, _) in enumerate(self.done) if op[0] == "replace" and "blobs" in op[2])
            draft = [entry for entry in self.done[blob:] if entry[0][0] in ("write", "sync")]
            rest = [entry for entry in self.done[blob:] if entry not in draft]
            self.done[blob:] = [*draft, rename, *rest]


@pytest.mark.parametrize("careless", [_NoFileSync, _NoFolderSync, _IndexFirst])
def test_a_careless_store_is_caught(tmp_path: Path, artifact: Configurations, careless: Any) -> None:
    def kept(over: bool, folder: Path) -> bool:
        try:
            return is_whole_or_absent(folder, over, artifact)
        except Exception:  # a torn file under a public name cannot be read
            return False

    states = states_of(tmp_path, careless(tmp_path), put_and_publish(artifact))
    assert not all(kept(over, folder) for over, folder in states)


def test_a_small_file_is_the_old_one_or_the_new_one(tmp_path: Path) -> None:
    def work(store: Store) -> None:
        store.prepare()
        store.write(store.folder / "manifest.json", b"old")
        store.write(store.folder / "manifest.json", b"the new one")

    seen = set()
    for over, folder in states_of(tmp_path, NotingFiles(tmp_path), work):
        path = folder / "manifest.json"
        content = path.read_bytes() if path.exists() else None
        assert content in ({b"the new one"} if over else {None, b"old", b"the new one"})
        seen.add(content)
    assert seen == {None, b"old", b"the new one"}


def test_no_crash_hides_a_motion_that_began_or_a_recording_that_is_done(
    tmp_path: Path, artifact: Configurations
) -> None:
    """A motion begins only after its record cannot be lost; it is done only when its data cannot be."""
    began: list[int] = []
    files = NotingFiles(tmp_path)

    def work(store: Store) -> None:
        store.prepare()
        motions = MotionRecords(store, store.home / "motions")
        motions.begin("acquire", KEY)
        began.append(len(files.done))  # here the robot moves
        store.put(KEY, "acquire", artifact, {}, True)
        motions.finish("acquire", KEY)

    root = tmp_path / "noted"
    root.mkdir()
    (root / "run").mkdir()
    files.root, files.done = root, [(("make_folder", "run"), b""), (("sync_folder", ""), b"")]
    work(Store(root / "run", files))
    moved = 0
    for number, (count, folders, contents) in enumerate(crash_states(files.done, first=2)):
        place = tmp_path / f"state-{number}"
        lay_out(place, folders, contents)
        store = Store(place / "run")
        motions = MotionRecords(store, store.home / "motions")
        known = store.lookup(KEY).state
        if motions.finished(KEY):
            assert known is State.PRESENT
        elif count >= began[0]:
            assert motions.unfinished()
            moved += 1
        shutil.rmtree(place)
    assert moved > 50


def test_the_model_knows_that_nothing_is_sure_without_a_sync(tmp_path: Path) -> None:
    files = NotingFiles(tmp_path)

    def four_bytes(path: Path) -> None:
        path.write_bytes(b"1234")

    files.write(tmp_path / "a", four_bytes)
    states = {tuple(sorted(contents.items())) for _, _, contents in crash_states(files.done)}
    assert states == {(), (("a", b""),), (("a", b"12"),), (("a", b"1234"),)}
    files.sync(tmp_path / "a")
    files.sync_folder(tmp_path)
    assert list(itertools.islice(crash_states(files.done, first=3), 2)) == [
        (3, frozenset({""}), {"a": b"1234"})
    ]
