"""One run at a time in a run folder: a lock that dies with its holder.

`flock` belongs to the open file, so that a killed holder leaves no stale lock behind. The file's text says who
holds it; the text is for people, the lock is not in it. Where the folder is deleted or moved, its lock goes with it:
the holder of such a lock writes nothing more, since another run may hold the folder that has the name now.
"""

from __future__ import annotations

import contextlib
import datetime
import fcntl
import json
import os
import socket
import stat
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from robid_core.errors import StoreError
from robid_core.interruption import heed
from robid_core.store import NoFile, failures_named

LOOK_S = 0.05  # how often a lock that somebody holds is tried


@contextlib.contextmanager
def run_lock(path: Path, wait: bool, waiting: Callable[[str], None]) -> Iterator[Callable[[], None]]:
    """Hold the lock of a run folder; gives what raises StoreError once the folder is no longer the one locked.

    Parameters
    ----------
    path
        The lock file; made where it is missing, never removed.
    wait
        Wait for another holder to end, or refuse.
    waiting
        Called with who holds the lock, before waiting.

    Raises
    ------
    StoreError
        If another process holds the lock and `wait` is false, or the file cannot be opened or locked.
    """
    descriptor = _take(path, wait, waiting)
    while not _stands_at(path, descriptor):  # the folder that was waited for is gone
        os.close(descriptor)
        descriptor = _take(path, wait, waiting)

    def require_held() -> None:
        if not _stands_at(path, descriptor):
            raise StoreError(
                f"{path.parent.parent} was deleted, moved or replaced while this run was in it; what was not written "
                "yet is not stored; leave the folder where it is and run again"
            )

    try:
        with failures_named("lock", path):
            _write(descriptor, {"pid": os.getpid(), "host": socket.gethostname(), "since": _now()})
        try:
            yield require_held
        finally:
            with contextlib.suppress(OSError):  # the text is for people; the lock itself is let go by closing
                os.ftruncate(descriptor, 0)
    finally:
        with contextlib.suppress(OSError):  # the lock is let go whatever closing says
            os.close(descriptor)


def _take(path: Path, wait: bool, waiting: Callable[[str], None]) -> int:
    """Return the descriptor of the lock file, locked."""
    with failures_named("lock", path):
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise NoFile(path)
            if not _try(descriptor):
                holder = _holder(descriptor)
                if not wait:
                    raise StoreError(
                        f"{path.parent.parent}: {holder}; nothing was done; "
                        "wait for it to end, or run without --no-wait"
                    )
                waiting(holder)
                while not _try(descriptor):
                    heed()
                    time.sleep(LOOK_S)
        except BaseException:
            os.close(descriptor)
            raise
        return descriptor


def _stands_at(path: Path, descriptor: int) -> bool:
    """Tell whether an open file still has its name."""
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    return False


def _try(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _holder(descriptor: int) -> str:
    try:
        told = json.loads(os.pread(descriptor, 4096, 0))
        return f"process {told['pid']} on {told['host']} is running here since {told['since']}"
    except (OSError, ValueError, KeyError, TypeError):  # it took the lock and has not written yet
        return "another process is running here"


def _write(descriptor: int, content: dict[str, object]) -> None:
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, json.dumps(content).encode(), 0)


def _now() -> str:
    return datetime.datetime.now().astimezone().isoformat(timespec="seconds")
