"""Motion on hardware at most once: a record before anything is enabled, another when the data are safe.

A run that finds a motion begun and not finished does not know where the machine stands. It never moves by
itself; a person looks at the robot and says `--again`. Simulated motion needs none of this.
"""

from __future__ import annotations

import datetime
import json
import os
import socket
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from robid_core.errors import MotionRefused
from robid_core.store import Store, failures_named

STARTED, DONE, GIVEN_UP = "started", "done", "given up"


@dataclass(frozen=True)
class MotionRecord:
    """One motion of a stage: its key, and how far it came."""

    stage: str
    key: str
    state: str
    since: str
    pid: int
    host: str


class MotionRecords:
    """The motion records of a run; each change is on the disk before the call returns.

    `others` are the folders of the records of the runs beside it: a motion that one of them began or finished is not
    made again here.
    """

    def __init__(self, store: Store, folder: Path, others: Sequence[Path] = ()) -> None:
        self._store = store
        self._folder = folder
        self._others = tuple(others)

    def all(self) -> list[MotionRecord]:
        """Return every record; one that cannot be read counts as begun and not finished."""
        with failures_named("read", self._folder):
            names = self._store.files.names(self._folder) if self._folder.is_dir() else []
            return [self._read(self._folder / name) for name in names]

    def _read(self, path: Path) -> MotionRecord:
        try:
            return MotionRecord(**json.loads(self._store.files.read(path)))
        except (ValueError, TypeError):
            return MotionRecord("?", path.stem, STARTED, "an unknown time (the record is damaged)", 0, "?")

    def unfinished(self) -> list[MotionRecord]:
        """Return the motions that were begun and not finished."""
        return [motion for motion in self.all() if motion.state == STARTED]

    def finished(self, key: str) -> bool:
        """Tell whether the motion of this key was carried out and its data stored, by this run or one beside it."""
        known = [*(motion for motion in self.all() if motion.key == key), *self._elsewhere(key)]
        return any(motion.state == DONE for motion in known)

    def unfinished_elsewhere(self, key: str) -> list[MotionRecord]:
        """Return the motions of this key that runs beside this one began and did not finish."""
        return [motion for motion in self._elsewhere(key) if motion.state == STARTED]

    def _elsewhere(self, key: str) -> list[MotionRecord]:
        paths = [folder / f"{key}.json" for folder in self._others]
        with failures_named("read", self._folder):
            return [self._read(path) for path in paths if path.is_file()]

    def begin(self, stage: str, key: str) -> None:
        """Note that a motion is about to begin."""
        since = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
        self._write(MotionRecord(stage, key, STARTED, since, os.getpid(), socket.gethostname()))

    def finish(self, stage: str, key: str) -> None:
        """Note that the data of a motion are stored."""
        known = [motion for motion in self.all() if motion.key == key]
        now = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
        motion = known[0] if known else MotionRecord(stage, key, DONE, now, os.getpid(), socket.gethostname())
        if not known or motion.state != DONE:
            self._write(replace(motion, stage=stage, state=DONE))

    def forget(self, key: str) -> None:
        """Take a record away: the motion was refused before anything moved."""
        path = self._folder / f"{key}.json"
        with failures_named("remove", path):
            self._store.files.remove(path)
            self._store.files.sync_folder(self._folder)

    def give_up(self) -> None:
        """Note that a person has seen what became of the unfinished motions."""
        for motion in self.unfinished():
            self._write(replace(motion, state=GIVEN_UP))

    def _write(self, motion: MotionRecord) -> None:
        with failures_named("write", self._folder):
            self._store.files.make_folder(self._folder)
            self._store.files.sync_folder(self._folder.parent)
        self._store.write_json(self._folder / f"{motion.key}.json", asdict(motion))


def refuse_unfinished(stage: str, unfinished: list[MotionRecord]) -> None:
    """Raise MotionRefused where a motion was begun and not finished."""
    if unfinished:
        first = unfinished[0]
        raise MotionRefused(
            f"stage {stage}: D09: the motion of '{first.stage}' was started at {first.since} (process {first.pid} on "
            f"{first.host}) and not finished; nothing was moved now, and what was recorded is kept; look at the "
            "robot, then run again with --at-the-robot --again"
        )
