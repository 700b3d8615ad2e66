"""The store of one run: artifacts by the hash of their bytes, found by the key of what made them.

Folders: `artifacts/` holds the names a user opens; `store/blobs/` the bytes, read-only and named by their
sha256; `store/index/` says which key gave which bytes; `store/quarantine/` what was found damaged;
`store/temporary/` what is being written. Data go first, index after, each by way of a temporary file, fsync,
rename and fsync of the folder: whenever the power fails, an artifact is there whole or not at all. Reading
verifies the hash. Nothing here is pickled, and no time stamp of a file decides anything.

Runs that stand side by side are one store to whoever looks for a key: what another run made is found, verified, and
taken over as a second name of the same bytes, so that each run stays whole when another is deleted.
"""

from __future__ import annotations

import contextlib
import dataclasses
import enum
import itertools
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from robid_core.artifacts import Artifact
from robid_core.errors import ConfigurationError, StoreError
from robid_core.store.entry import Entry, entry_from_bytes, entry_to_bytes
from robid_core.store.files import Files, NoFile, failures_named

SAFE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")

AnyArtifact = TypeVar("AnyArtifact", bound=Artifact)


class State(enum.Enum):
    """What the store holds under a key."""

    PRESENT = "present"
    ABSENT = "absent"
    DAMAGED = "damaged"


@dataclass(frozen=True)
class Lookup:
    """Answer to a key: the state, the entry where it could be read, and what is wrong in words."""

    key: str
    state: State
    entry: Entry | None = None
    problem: str = ""
    owner: str = ""  # name of the run beside this one that has it, where this one does not


class Store:
    """Artifacts of one run folder; writers hold the run's lock, readers need none.

    `others` are the folders of the runs beside it, whose artifacts are found here too; `require_held` raises StoreError
    where the lock is held no more, and is called before anything is written or taken away.
    """

    def __init__(
        self,
        folder: Path,
        files: Files | None = None,
        others: Sequence[Path] = (),
        require_held: Callable[[], None] = lambda: None,
    ) -> None:
        self.folder = folder
        self.others = tuple(others)
        self._require_held = require_held
        self.files = files or Files()
        self.artifacts = folder / "artifacts"
        self.home = folder / "store"
        self.blobs = self.home / "blobs"
        self.index = self.home / "index"
        self.quarantine = self.home / "quarantine"
        self.temporary = self.home / "temporary"
        self._count = itertools.count()

    def prepare(self) -> None:
        """Make the folders and clear away what a killed run was writing; needs the run's lock."""
        with failures_named("prepare", self.folder):
            folders = (self.artifacts, self.home, self.blobs, self.index, self.quarantine, self.temporary)
            for folder in folders:
                self.files.make_folder(folder)
            for folder in (self.folder.parent, self.folder, *folders):  # also what a killed run left unsynced
                self.files.sync_folder(folder)
            for name in self.files.names(self.temporary):
                with failures_named("clear away", self.temporary / name):
                    self.files.remove(self.temporary / name)

    def lookup(self, key: str) -> Lookup:
        """Say whether the artifact made under `key` is here or in a run beside, every byte of it verified."""
        found = self._own(key)
        if found.state is not State.ABSENT:
            return found
        owner = self._owner(key)
        if owner is None:
            return found
        return replace(owner.lookup(key), owner=owner.folder.name)

    def take_over(self, entry: Entry) -> None:
        """Bring an artifact of a run beside this one into this store: bytes first, index after.

        Nothing happens where it is here already.

        Raises
        ------
        StoreError
            If no run has it any more, or it cannot be written.
        """
        if self._own(entry.key).state is State.PRESENT:
            return
        owner = self._owner(entry.key)
        if owner is None:
            raise StoreError(f"{entry.stage}: the run that had it was changed or deleted; run again")
        with failures_named("take over", self.artifacts / f"{_safe(entry.stage)}{entry.suffix}"):
            if self._problem(entry):
                draft = self._draft(entry.suffix)
                try:
                    self._second_name(owner.blobs / entry.blob_name, draft)
                    self._settle(draft, self.blobs / entry.blob_name, read_only=True)
                except BaseException:
                    self._drop(draft)
                    raise
            self.write(self.index / f"{entry.key}.json", entry_to_bytes(entry))

    def _owner(self, key: str) -> Store | None:
        """Return the store of the first run beside this one that has an intact artifact under a key."""
        for folder in self.others:
            other = Store(folder, self.files)
            with contextlib.suppress(StoreError):  # it cannot be read, or a newer robid wrote it
                if other.lookup(key).state is State.PRESENT:
                    return other
        return None

    def _own(self, key: str) -> Lookup:
        path = self.index / f"{key}.json"
        with failures_named("read", path):
            try:
                data = self.files.read(path)
            except FileNotFoundError:
                return Lookup(key, State.ABSENT)
            except NoFile as error:
                return Lookup(key, State.DAMAGED, None, str(error))
            entry = entry_from_bytes(data, str(path))
            if entry is None or entry.key != key:
                return Lookup(key, State.DAMAGED, None, f"{path} is damaged")
            problem = self._problem(entry)
            return Lookup(key, State.DAMAGED if problem else State.PRESENT, entry, problem)

    def _problem(self, entry: Entry) -> str:
        blob = self.blobs / entry.blob_name
        try:
            found = self.files.digest(blob)
        except FileNotFoundError:
            return f"{blob} is missing"
        except NoFile as error:
            return str(error)
        return "" if found == entry.sha256 else f"{blob} is damaged: its sha256 is {found[:12]}..."

    def put(
        self, key: str, stage: str, artifact: Artifact, ingredients: Mapping[str, Any], recording: bool
    ) -> Entry:
        """Store an artifact under its key: bytes first, index after; return its entry."""
        with failures_named("write", self.artifacts / f"{_safe(stage)}{artifact.suffix}", size_of(artifact)):
            draft = self._draft(artifact.suffix)
            try:
                self.files.write(draft, artifact.write)
                entry = Entry(
                    key=key,
                    stage=stage,
                    artifact=type(artifact).__name__,
                    sha256=self.files.digest(draft),
                    suffix=artifact.suffix,
                    recording=recording,
                    ingredients=ingredients,
                )
                if self._problem(entry):
                    self._settle(draft, self.blobs / entry.blob_name, read_only=True)
                else:  # the same bytes are there from another key
                    self.files.remove(draft)
            except BaseException:
                self._drop(draft)
                raise
            self.write(self.index / f"{key}.json", entry_to_bytes(entry))
            return entry

    def publish(self, stage: str, entry: Entry) -> Path:
        """Give an artifact the name a user opens, `artifacts/<stage>.h5`; return its path."""
        blob, path = self.blobs / entry.blob_name, self.artifacts / f"{_safe(stage)}{entry.suffix}"
        with failures_named("write", path):
            with contextlib.suppress(NoFile):
                if path.exists() and (path.samefile(blob) or self.files.digest(path) == entry.sha256):
                    return path
            draft = self._draft(entry.suffix)
            try:
                self._second_name(blob, draft)
                self.files.replace(draft, path)
                self.files.sync_folder(self.artifacts)
            except BaseException:
                self._drop(draft)
                raise
        return path

    def _second_name(self, blob: Path, draft: Path) -> None:
        """Give the same bytes another name; where the file system knows no second names, a copy."""
        try:
            self.files.link(blob, draft)
        except OSError:
            self.files.copy(blob, draft)
            self.files.sync(draft)

    def read(self, entry: Entry, artifact: type[AnyArtifact]) -> AnyArtifact:
        """Read an artifact, verified; StoreError where its bytes are no longer what they were."""
        blob = self.verified_path(entry)
        with failures_named("read", blob):
            return artifact.read(blob)

    def verified_path(self, entry: Entry) -> Path:
        """Return the file with an artifact's bytes; StoreError where they are no longer what they were."""
        blob = self.blobs / entry.blob_name
        with failures_named("read", blob):
            problem = self._problem(entry)
        if problem:
            raise StoreError(f"{entry.stage}: {problem}; run again: it is set aside and made anew")
        return blob

    def digest_of(self, artifact: Artifact) -> str:
        """Return the sha256 that an artifact's bytes would have."""
        with failures_named("write", self.temporary, size_of(artifact)):
            draft = self._draft(artifact.suffix)
            try:
                self.files.write(draft, artifact.write)
                return self.files.digest(draft)
            finally:
                self._drop(draft)

    @contextlib.contextmanager
    def draft(self, suffix: str) -> Iterator[Path]:
        """Give a path for a file that is wanted for a while only."""
        path = self._draft(suffix)
        try:
            yield path
        finally:
            self._drop(path)

    def withdraw(self, stage: str) -> None:
        """Take away the name of a stage's earlier artifact; its bytes stay in the store."""
        self._require_held()
        with failures_named("remove", self.artifacts / _safe(stage)):
            for name in self.files.names(self.artifacts):
                if Path(name).stem == stage:
                    self.files.remove(self.artifacts / name)

    def set_aside(self, key: str, entry: Entry | None) -> Path | None:
        """Move what is damaged to the quarantine folder; return where the artifact went."""
        self._require_held()
        index = self.index / f"{key}.json"
        with failures_named("set aside", index):
            place = None
            if entry is not None and (self.blobs / entry.blob_name).exists():
                place = self._set_aside_blob(entry)
            self.files.replace(index, self._free_name(index.name))
            self.files.sync_folder(self.index)
            return place

    def set_aside_file(self, path: Path) -> Path:
        """Move a damaged file of the run to the quarantine folder; return where it went."""
        with failures_named("set aside", path):
            place = self._free_name(path.name)
            self.files.replace(path, place)
            self.files.sync_folder(path.parent)
            return place

    def _set_aside_blob(self, entry: Entry) -> Path:
        blob, place = self.blobs / entry.blob_name, self._free_name(entry.blob_name)
        for name in self.files.names(self.artifacts):
            if (self.artifacts / name).samefile(blob):
                self.files.remove(self.artifacts / name)
        self.files.replace(blob, place)
        self.files.sync_folder(self.blobs)
        return place

    def write(self, path: Path, data: bytes) -> None:
        """Write a small file of the run at once and for good: whole, or as it was."""

        def writer(draft: Path) -> None:
            draft.write_bytes(data)

        with failures_named("write", path, len(data)):
            draft = self._draft(path.suffix)
            try:
                self.files.write(draft, writer)
                self._settle(draft, path)
            except BaseException:
                self._drop(draft)
                raise

    def write_json(self, path: Path, value: Any) -> None:
        """Write a value as JSON, as `write` does."""
        self.write(path, json.dumps(value, indent=1, allow_nan=False).encode() + b"\n")

    def _settle(self, draft: Path, path: Path, read_only: bool = False) -> None:
        if read_only:
            self.files.protect(draft)
        self.files.sync(draft)
        self.files.replace(draft, path)
        self.files.sync_folder(path.parent)

    def _drop(self, draft: Path) -> None:
        """Take a draft away after a failure; the next run clears what even that could not remove."""
        try:
            self.files.remove(draft)
        except OSError:
            return

    def _draft(self, suffix: str) -> Path:
        self._require_held()
        return self.temporary / f"{os.getpid()}-{next(self._count)}{suffix}"

    def _free_name(self, name: str) -> Path:
        taken = set(self.files.names(self.quarantine))
        candidates = itertools.chain([name], (f"{n}-{name}" for n in itertools.count(2)))
        return self.quarantine / next(candidate for candidate in candidates if candidate not in taken)


def _safe(name: str) -> str:
    if not SAFE_NAME.fullmatch(name):
        raise ConfigurationError(
            f"'{name}' cannot be the name of a file; use letters, digits, '_', '-' and '.'"
        )
    return name


def size_of(artifact: Artifact) -> int:
    """Return about how many bytes an artifact takes on the disk."""
    total = 4096
    for item in dataclasses.fields(artifact):
        value = getattr(artifact, item.name)
        parts = value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else (value,)
        for part in parts:
            if isinstance(part, np.ndarray):
                total += part.nbytes
            elif isinstance(part, Artifact):
                total += size_of(part)
            elif isinstance(part, str):
                total += len(part)
    return total
