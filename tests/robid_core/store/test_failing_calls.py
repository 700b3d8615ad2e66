"""The n-th file operation fails, once or for ever: a clear StoreError, nothing torn, and the next run completes.

ENOSPC, EDQUOT, EIO, EROFS, EACCES, EMFILE (R03, R04).
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robid_core import Configurations
from robid_core.errors import StoreError
from robid_core.store import Files, State, Store

KEY = "cd" * 32
NUMBERS = [errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS, errno.EACCES, errno.EMFILE]
OPERATIONS = [
    "make_folder", "write", "sync", "sync_folder", "protect", "replace", "link", "copy", "remove", "read", "digest",
    "names",
]  # fmt: skip


class FailingFiles(Files):
    """Fails from the n-th operation on, once or for ever; a write that fails leaves half a file."""

    def __init__(self, failing: int, number: int, for_ever: bool) -> None:
        self.count = 0
        for name in OPERATIONS:
            setattr(self, name, self._wrapped(name, getattr(Files, name), failing, number, for_ever))

    def _wrapped(
        self, name: str, real: Callable[..., Any], failing: int, number: int, for_ever: bool
    ) -> Callable[..., Any]:
        def operation(*arguments: Any) -> Any:
            self.count += 1
            if self.count == failing or (for_ever and self.count > failing):
                if name in ("write", "copy"):
                    with contextlib.suppress(OSError):
                        real(self, *arguments)
                        target = arguments[0 if name == "write" else 1]
                        target.write_bytes(target.read_bytes()[:-7])
                raise OSError(number, os.strerror(number))
            return real(self, *arguments)

        return operation


def work(store: Store, artifact: Configurations) -> None:
    store.prepare()
    entry = store.put(KEY, "where", artifact, {}, False)
    store.publish("where", entry)
    store.read(entry, Configurations)
    store.write(store.folder / "manifest.json", b"{}")


def nothing_is_torn(folder: Path) -> None:
    for blob in (folder / "store" / "blobs").glob("*"):
        assert hashlib.sha256(blob.read_bytes()).hexdigest() == blob.stem
    for index in (folder / "store" / "index").glob("*"):
        assert Store(folder).lookup(index.stem).state is State.PRESENT
    for public in (folder / "artifacts").glob("*"):
        Configurations.read(public)
    manifest = folder / "manifest.json"
    assert not manifest.exists() or manifest.read_bytes() == b"{}"


@pytest.mark.parametrize("for_ever", [False, True])
@pytest.mark.parametrize(
    "number", [NUMBERS[0], *(pytest.param(number, marks=pytest.mark.full) for number in NUMBERS[1:])]
)
def test_each_operation_of_the_store_may_fail(
    tmp_path: Path, artifact: Configurations, number: int, for_ever: bool
) -> None:
    told: list[tuple[int, str]] = []
    for failing in range(1, 1000):
        folder = tmp_path / str(failing)
        folder.mkdir()
        files = FailingFiles(failing, number, for_ever)
        try:
            work(Store(folder, files), artifact)
        except StoreError as error:
            told.append((error.exit_code, str(error)))
        nothing_is_torn(folder)
        work(Store(folder), artifact)
        nothing_is_torn(folder)
        assert list((folder / "store" / "temporary").iterdir()) == []
        if files.count < failing:
            break
    assert len(told) > 30
    assert {code for code, _ in told} == {7}
    assert all(os.strerror(number) in text and str(tmp_path) in text for _, text in told)


def test_a_full_disk_is_told_with_what_is_needed_and_what_is_free(
    tmp_path: Path, artifact: Configurations
) -> None:
    with pytest.raises(StoreError, match=r"MB needed, .* MB free\).*free some space and run again"):
        work(Store(tmp_path, FailingFiles(17, errno.ENOSPC, True)), artifact)


def test_where_files_cannot_have_two_names_the_public_one_is_a_copy(
    tmp_path: Path, artifact: Configurations
) -> None:
    class NoLinks(Files):
        def link(self, source: Path, target: Path) -> None:
            raise OSError(errno.EPERM, "no links here")

    store = Store(tmp_path, NoLinks())
    work(store, artifact)
    public = tmp_path / "artifacts" / "where.h5"
    assert not public.samefile(next(store.blobs.iterdir()))
    nothing_is_torn(tmp_path)
    before = public.stat().st_ino
    store.publish("where", store.lookup(KEY).entry)  # type: ignore[arg-type]
    assert public.stat().st_ino == before


def test_a_real_write_that_stops_half_way_is_told_and_leaves_nothing(tmp_path: Path) -> None:
    code = """
import resource, signal, sys
from pathlib import Path
import numpy as np
from robid_core import Configurations
from robid_core.errors import StoreError
from robid_core.store import Store
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
store = Store(Path(sys.argv[1]))
store.prepare()
artifact = Configurations(("a",), np.random.default_rng(0).normal(size=(100000, 1)))
for limit in range(300_000, 830_000, 40_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        store.put("e" * 64, "where", artifact, {}, False)
        break
    except StoreError as error:
        print(error)
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
store.put("e" * 64, "where", artifact, {}, False)
"""
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("File too large") >= 10
    nothing_is_torn(tmp_path)
    assert list((tmp_path / "store" / "temporary").iterdir()) == []
