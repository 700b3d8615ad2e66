"""The few file operations that the store is made of, and what a failed one says.

Everything that the store, the manifest and the motion records do to a disk goes through `Files`. Tests hand
in another one: to fail the n-th call, or to note every call and build each state that a loss of power could
leave behind.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import shutil
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from robid_core.errors import StoreError, said_by

CHUNK = 1 << 20  # bytes hashed at a time

# What a person can do about it, by the name the system gives the failure.
ADVICE = {
    errno.ENOSPC: "free some space and run again",
    errno.EDQUOT: "free some of your quota and run again",
    errno.EROFS: "the file system is read-only; move the project or mount it writable",
    errno.EACCES: "give yourself that right and run again",
    errno.EPERM: "give yourself that right and run again",
    errno.EMFILE: "raise the limit of open files (ulimit -n) and run again",
    errno.ENFILE: "the machine has too many files open; close some programs and run again",
    errno.EFBIG: "a limit on the size of files is set (ulimit -f), or the file system has one; raise it and run again",
    errno.EIO: "the disk reports an error; check it before you run again",
    errno.EISDIR: "a folder stands where a file belongs; move it away and run again",
    errno.ENOTDIR: "a file stands where a folder belongs; move it away and run again",
    errno.EEXIST: "a file stands where a folder belongs; move it away and run again",
    errno.ENXIO: "a socket or a device stands where a file belongs; move it away and run again",
    errno.ELOOP: "a link leads to itself; remove it and run again",
    errno.ENOENT: "a folder on the way to it is gone, or a link leads nowhere; bring it back, or remove the link",
}
OF_FILES = {
    errno.EACCES,
    errno.EPERM,
    errno.EISDIR,
    errno.ENOTDIR,
    errno.EEXIST,
    errno.ENXIO,
    errno.ELOOP,
    errno.ENOENT,
}


class NoFile(OSError):
    """What stands under a name is a folder, a pipe, a socket, a device: no file of ours, and reading may never end."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path} is no file")


class Files:
    """Operations on real files; each one either does what its name says or raises OSError."""

    def make_folder(self, path: Path) -> None:
        """Create one folder whose parent exists; nothing happens where it stands already."""
        path.mkdir(exist_ok=True)

    def write(self, path: Path, writer: Callable[[Path], None]) -> None:
        """Let `writer` create the file; an OSError that a library dressed up comes out as what it was."""
        try:
            writer(path)
        except StoreError as error:
            if isinstance(error.__cause__, OSError):
                raise error.__cause__ from None
            raise

    def sync(self, path: Path) -> None:
        """Bring a file's content to the disk."""
        _sync(path, os.O_RDONLY)

    def sync_folder(self, path: Path) -> None:
        """Bring a folder's names to the disk (where the file system can)."""
        try:
            _sync(path, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0))
        except OSError as error:
            if error.errno != errno.EINVAL:  # some network file systems cannot sync a folder
                raise

    def protect(self, path: Path) -> None:
        """Make a file read-only for everyone."""
        path.chmod(0o444)

    def replace(self, source: Path, target: Path) -> None:
        """Give a file its final name at once, in the place of what had it."""
        source.replace(target)

    def link(self, source: Path, target: Path) -> None:
        """Give a file a second name."""
        os.link(source, target)

    def copy(self, source: Path, target: Path) -> None:
        """Copy a file's content, where a second name is impossible."""
        shutil.copyfile(source, target)

    def remove(self, path: Path) -> None:
        """Take a name away; nothing happens where there is none."""
        path.unlink(missing_ok=True)

    def read(self, path: Path) -> bytes:
        """Read a small file; NoFile where something else has its name."""
        with _opened(path) as file:
            return file.read()

    def digest(self, path: Path) -> str:
        """Return the sha256 of a file's content, in hex; NoFile where something else has its name."""
        digest = hashlib.sha256()
        with _opened(path) as file:
            while block := file.read(CHUNK):
                digest.update(block)
        return digest.hexdigest()

    def names(self, path: Path) -> list[str]:
        """Return the names in a folder, sorted."""
        return sorted(entry.name for entry in path.iterdir())


def _opened(path: Path) -> BinaryIO:
    """Open a file for reading; what is none is not waited for."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError as error:
        if error.errno in (errno.ENXIO, errno.ELOOP):  # a socket, a link to itself
            raise NoFile(path) from error
        raise
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        return os.fdopen(descriptor, "rb")
    os.close(descriptor)
    raise NoFile(path)


def _sync(path: Path, flags: int) -> None:
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def failures_named(doing: str, path: Path | None, needed: int | None = 0) -> Iterator[None]:
    """Turn an OSError into a StoreError: what was done to which path, why it failed, what to do.

    Parameters
    ----------
    doing
        The verb: "write", "read", "set aside".
    path
        What the user knows it by; None where the system named no file.
    needed
        Bytes that were to be written, for the message when the disk is full; None where it is not known which disk is.
    """
    try:
        yield
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else said_by(error).partition("\n")[0]
        if error.errno in (errno.ENOTDIR, errno.EEXIST) and (obstacle := _obstacle(error.filename)):
            why = f"{obstacle} is no folder"
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        room = _room(path, needed) if full and path is not None and needed is not None else ""
        otherwise = (
            "move it away and run again" if isinstance(error, NoFile) else "check the disk and run again"
        )
        advice = ADVICE.get(error.errno or 0, otherwise)
        what = doing if path is None else f"{doing} {path}"
        raise StoreError(f"cannot {what}: {why}{room}; what was finished before is kept; {advice}") from error


def _obstacle(path: str | None) -> Path | None:
    """Return what stands on the way to a path, or in its place, and is no folder."""
    way = [*reversed(Path(path).parents), Path(path)] if path else []
    return next((place for place in way if os.path.lexists(place) and not place.is_dir()), None)


# Failures of the machine, whoever's code they meet.
OF_THE_MACHINE = frozenset(ADVICE) - OF_FILES


def _room(path: Path, needed: int) -> str:
    """Say what a full disk lacks: room, or files that it may still hold (inodes)."""
    for folder in path.parents:
        with contextlib.suppress(OSError):
            system = os.statvfs(folder)
            if system.f_files and not system.f_favail:
                return f" (all {system.f_files} files that this disk can hold are there; remove some)"
            free = system.f_bavail * system.f_frsize / 1e6
            return f" (about {max(needed / 1e6, 0.1):.1f} MB needed, {free:.1f} MB free)"
    return ""
