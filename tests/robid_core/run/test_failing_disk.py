"""A disk that fails in the middle of a run: exit 7, nothing torn, and the next run completes (R03, R04)."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import random
import shutil
from typing import Any

import pytest

from robid_core.errors import StoreError
from robid_core.store import Files

NUMBERS = [errno.ENOSPC, errno.EIO, errno.EROFS, errno.EACCES, errno.EMFILE]


class FailingFiles(Files):
    """Fails at the n-th operation, and at every later one where it says so; a write leaves half a file."""

    def __init__(self, failing: int, number: int, for_ever: bool) -> None:
        self.state = {"count": 0, "failing": failing, "number": number, "for_ever": for_ever}

    def __getattribute__(self, name: str) -> Any:
        found = super().__getattribute__(name)
        if name == "state" or name.startswith("_"):
            return found
        state = self.state

        def operation(*arguments: Any) -> Any:
            state["count"] += 1
            if state["count"] == state["failing"] or (
                state["for_ever"] and state["count"] > state["failing"]
            ):
                if name == "write":
                    with contextlib.suppress(OSError):
                        found(*arguments)
                        arguments[0].write_bytes(arguments[0].read_bytes()[:-7])
                raise OSError(state["number"], os.strerror(state["number"]))
            return found(*arguments)

        return operation


def fails_and_recovers(world: Any, failing: int, number: int, for_ever: bool, wanted: dict[str, str]) -> bool:
    """Run with a failing disk, then without; tell whether the run had that many operations."""
    files, told = FailingFiles(failing, number, for_ever), None
    try:
        world.run(files=files)
    except StoreError as error:
        told = error
    assert told is None or (told.exit_code == 7 and os.strerror(number) in str(told))
    for blob in (world.folder / "store").glob("blobs/*"):
        assert hashlib.sha256(blob.read_bytes()).hexdigest() == blob.stem
    for name, digest in wanted.items():
        public = world.folder / "artifacts" / name
        assert not public.exists() or hashlib.sha256(public.read_bytes()).hexdigest() == digest
    world.run()
    assert world.hashes() == wanted
    assert list((world.folder / "store" / "temporary").iterdir()) == []
    shutil.rmtree(world.folder)
    return bool(files.state["count"] >= failing)


def test_some_file_operation_of_a_run_fails(world: Any) -> None:
    world.run()
    wanted = world.hashes()
    shutil.rmtree(world.folder)
    generator = random.Random(2)
    for number in NUMBERS:
        for for_ever in (False, True):
            fails_and_recovers(world, generator.randint(1, 130), number, for_ever, wanted)


@pytest.mark.full
@pytest.mark.parametrize("for_ever", [False, True])
@pytest.mark.parametrize("number", NUMBERS)
def test_each_file_operation_of_a_run_fails(world: Any, number: int, for_ever: bool) -> None:
    world.run()
    wanted = world.hashes()
    shutil.rmtree(world.folder)
    failing = 1
    while fails_and_recovers(world, failing, number, for_ever, wanted):
        failing += 1
    assert failing > 100


def test_a_folder_that_cannot_be_written_is_one_clear_line(world: Any) -> None:
    (world.project / "runs").write_text("a file where a folder should be")
    with pytest.raises(StoreError, match=r"cannot make .*runs/strange") as caught:
        world.run()
    assert len(str(caught.value).splitlines()) == 1
