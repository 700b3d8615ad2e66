"""Attacks on `robid run` and on its results; then it runs again: same bytes as undisturbed, and nothing left behind.

`python tests/system/attacks.py --kill 1760 --fail 3070 --full 130 --corrupt 1500` runs a short pipeline in forked
processes, each in a fresh folder, and attacks it:

- `kill`: SIGKILL at a random moment, to the process or to its whole group,
- `fail`: one file call, a random one of all below the folder of runs, raises a random error of the system, once or
  from then on for ever,
- `full`: the folder lies on a file system that is full at a random moment, and is made larger afterwards (asks for the
  right to mount one),
- `corrupt`: in a random file of a finished run a bit is flipped, a block is overwritten by noise or by zeros, the end
  is cut off, all is cut off, or the file is removed.

An attack is good where the attacked run ended by the kill, with exit code 0 or with 7 and the system's own words, and
the next `robid run` ends with exit code 0 and the artifacts of an undisturbed run, byte by byte; where neither shows a
traceback or calls a failure its own mistake, no draft stays in the store and no process of theirs lives on. With
`--table` attacks that stand in it already are not made again.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass
from pathlib import Path

from failing_calls import FailingCalls
from stops import append_row, read_table

from robid_core.commands import main as main_of_robid

ROOT = Path(__file__).parents[2]
ROBID = str(Path(sys.executable).with_name("robid"))
KINDS = ("kill", "fail", "full", "corrupt")
ERRORS = (errno.EIO, errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EMFILE, errno.EDQUOT)
DAMAGES = ("flip", "noise", "zeros", "cut", "empty", "gone")
GONE_S = 3.0  # within which processes of a run that was killed are gone
LONGEST_S = 120.0  # who takes longer hangs
KILLED, HANGS = -int(signal.SIGKILL), -999  # exit codes; of one that did not end
ONE_AXIS = """\
robid: 1
name: attacked
seed: 3
robot: one_axis
stages:
  where: {use: design.candidates, with: {count: 2}}
  excite: {use: excitation.multisine, with: {band_hz: [4, 80], lines: 20, period_s: 1, blocks: 1}}
  acquire: {use: acquisition.simulated, inputs: {configurations: where}, with: {plant: one_axis_true, periods: 2}}
  frf: {use: frf.log}
  other: {use: frf.h1}
  more: {use: frf.harmonic}
"""


def worked_example() -> str:
    """The worked example, six drives on a CAN bus included, with the same stages and less of everything."""
    text = (ROOT / "pipeline.yaml").read_text(encoding="utf-8")
    for old, new in (
        (r"count: 4", "count: 2"),
        (r"lines: 100, period_s: 4", "lines: 30, period_s: 4"),
        (r"starts: 20", "starts: 3"),
        (r"candidates: 500", "candidates: 60"),
    ):
        text, found = re.subn(old, new, text)
        assert found == 1, old
    return text


@dataclass(frozen=True)
class Undisturbed:
    """What a run is when nobody attacks it."""

    text: str
    fresh: bool  # each run in a Python of its own, which takes seconds to load
    length_s: float
    calls: int  # of files, below the folder of runs; 0: not counted
    size: int  # bytes of its files
    artifacts: dict[str, str]  # SHA-256 by name


@dataclass(frozen=True)
class Outcome:
    """One attack and what became of it; one line of the table."""

    attack: str
    what: str  # as it was drawn
    code: int  # of the attacked run
    good: bool
    why: str


def run(folder: Path, words: Path, fresh: bool, before: Callable[[], None] = lambda: None) -> int:
    """Fork a process that does `robid run` in a folder, as the leader of its group; return its number.

    `before` is called there first; `words` gets what it says on either stream.
    """
    child = os.fork()
    if child:
        return child
    code = 99
    try:
        os.setsid()
        said = os.open(words, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(said, 1)
        os.dup2(said, 2)
        os.chdir(folder)
        before()
        if fresh:
            os.execv(ROBID, ["robid", "run", "-q", "pipeline.yaml"])
        code = robid_run()
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def robid_run() -> int:
    """Do `robid run` in this process and folder; return its exit code."""
    sys.argv = ["robid", "run", "-q", "pipeline.yaml"]
    try:
        main_of_robid()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def ended(process: int, limit_s: float = LONGEST_S) -> int | None:
    """Return the exit code of a process, or None where it does not end in time."""
    limit = time.monotonic() + limit_s
    while True:
        done, status = os.waitpid(process, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() > limit:
            return None
        time.sleep(0.002)


def ended_or_killed(process: int) -> int:
    """Return the exit code of a process; one that hangs is killed."""
    code = ended(process)
    if code is None:
        os.killpg(process, signal.SIGKILL)
        os.waitpid(process, 0)
        return HANGS
    return code


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every artifact that the run names."""
    artifacts = sorted(folder.glob("runs/*/artifacts/*"))
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in artifacts}


def undisturbed(top: Path, job: str) -> Undisturbed:
    """Run without an attack: once so that all is loaded and compiled, once for its length, once to count its calls."""
    text, fresh = (worked_example(), True) if job == "worked_example" else (ONE_AXIS, False)
    counted, words = top / "calls", top / "words"
    counted.write_text("0", encoding="utf-8")

    def count() -> None:
        calls = FailingCalls(Path("runs"), 0, 0, False)
        calls.install()
        really = os._exit

        def leave(code: int) -> None:
            counted.write_text(str(calls.count), encoding="utf-8")
            really(code)

        os._exit = leave  # type: ignore[assignment]

    def performed(before: Callable[[], None] = lambda: None) -> Path:
        folder = project(Path(tempfile.mkdtemp(dir=top)), text)
        assert ended_or_killed(run(folder, words, fresh, before)) == 0, words.read_text(encoding="utf-8")
        return folder

    if fresh:
        performed()
    else:
        with contextlib.chdir(project(top / "here", text)):
            assert robid_run() == 0
    began = time.monotonic()
    folder = performed()
    length = time.monotonic() - began
    if not fresh:
        performed(count)
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    return Undisturbed(text, fresh, length, int(counted.read_text(encoding="utf-8")), size, hashes(folder))


def project(folder: Path, text: str) -> Path:
    """Make a folder that holds a pipeline."""
    folder.mkdir(exist_ok=True)
    (folder / "pipeline.yaml").write_text(text, encoding="utf-8")
    return folder


class Attack:
    """One attack: drawn from a seed, performed in a folder of its own, judged."""

    def __init__(self, name: str, seed: int, whole: Undisturbed, top: Path) -> None:
        self.name, self.whole = name, whole
        self.draw = random.Random(f"{seed} {name}")
        self.top = top / name
        self.folder, self.words = self.top / "project", self.top / "words.txt"
        self.what = ""

    def perform(self) -> Outcome:
        """Attack, run again, judge."""
        self.top.mkdir()
        self.words.touch()
        with self._disk() as make_room:
            project(self.folder, self.whole.text)
            code, why = getattr(self, f"_{self.name.partition('_')[0]}")()
            make_room()
            why = why or self._after()
        shutil.rmtree(self.top)
        return Outcome(self.name, self.what, code, not why, why)

    @contextlib.contextmanager
    def _disk(self) -> Iterator[Callable[[], None]]:
        """For an attack by a full disk, mount one at the folder; hand out how to enlarge it."""
        if not self.name.startswith("full"):
            yield lambda: None
            return
        self.folder.mkdir()
        pages = max(1, self.draw.randrange(1 + int(1.2 * self.whole.size / 4096)))
        self.what = f"{4 * pages} kB"
        mount = ["mount", "-t", "tmpfs", "-o", f"size={4 * pages}k", "none", str(self.folder)]
        subprocess.run(mount, check=True)
        try:
            larger = ["mount", "-o", "remount,size=64m", str(self.folder)]
            yield lambda: void(subprocess.run(larger, check=True))
        finally:
            subprocess.run(["umount", "-l", str(self.folder)], check=True)

    def _run(self, before: Callable[[], None] = lambda: None) -> int:
        return run(self.folder, self.words, self.whole.fresh, before)

    def _kill(self) -> tuple[int, str]:
        moment = self.draw.uniform(0.0, 1.05 * self.whole.length_s)
        kill = self.draw.choice([os.kill, os.killpg])
        self.what = f"{kill.__name__} at {moment:.3f} s"
        process = self._run()
        code = ended(process, moment)
        if code is not None:
            return code, "" if code == 0 else f"exit code {code} before the kill"
        with contextlib.suppress(ProcessLookupError):  # a group that is not yet one
            kill(process, signal.SIGKILL)
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
        return KILLED, self._left(process)

    def _fail(self) -> tuple[int, str]:
        failing, number = 1 + self.draw.randrange(self.whole.calls), self.draw.choice(ERRORS)
        for_ever = self.draw.random() < 0.5
        self.what = f"{errno.errorcode[number]} at call {failing}{' and for ever' if for_ever else ''}"
        calls = FailingCalls(self.folder / "runs", failing, number, for_ever)
        process = self._run(calls.install)
        return self._told(process, os.strerror(number))

    def _full(self) -> tuple[int, str]:
        process = self._run()
        return self._told(process, os.strerror(errno.ENOSPC))

    def _corrupt(self) -> tuple[int, str]:
        process = self._run()
        code = ended_or_killed(process)
        if code != 0:
            return code, f"exit code {code}"
        files = sorted(path for path in (self.folder / "runs").rglob("*") if path.is_file())
        path, damage = self.draw.choice(files), self.draw.choice(DAMAGES)
        self.what = f"{damage} {path.relative_to(self.folder)}"
        corrupt(path, damage, self.draw)
        return 0, self._left(process)

    def _told(self, process: int, reason: str) -> tuple[int, str]:
        """Wait for a run whose files fail: it does without what failed, or says why it cannot."""
        code = ended_or_killed(process)
        said = self.words.read_text(encoding="utf-8")
        why = self._left(process)
        if code not in (0, 7):
            why = f"exit code {code}: {said[-300:]!r}"
        elif code == 7 and reason not in said:
            why = f"{reason} is not named: {said[-300:]!r}"
        return code, why

    def _after(self) -> str:
        """Run again; return what is wrong, or nothing."""
        process = self._run()
        code = ended_or_killed(process)
        said = self.words.read_text(encoding="utf-8")
        if code != 0:
            return f"the next run: exit code {code}: {said[-300:]!r}"
        if "Traceback" in said or "not your mistake" in said:
            return f"it said {said[-300:]!r}"
        if (found := hashes(self.folder)) != self.whole.artifacts:
            return f"{sorted(found.items() ^ self.whole.artifacts.items())} differ"
        if drafts := list(self.folder.glob("runs/*/store/temporary/*")):
            return f"{len(drafts)} drafts are left"
        return self._left(process)

    def _left(self, group: int) -> str:
        """Wait until the processes of a group are gone; say so where they are not."""
        limit = time.monotonic() + GONE_S
        while time.monotonic() < limit:
            try:
                os.killpg(group, 0)
            except ProcessLookupError:
                return ""
            time.sleep(0.01)
        os.killpg(group, signal.SIGKILL)
        return "a process is left"


def corrupt(path: Path, damage: str, draw: random.Random) -> None:
    """Damage a file in its place, as a failing disk does: other names of it are damaged with it."""
    if damage == "gone":
        path.unlink()
        return
    content = bytearray(path.read_bytes())
    place = draw.randrange(max(1, len(content)))
    if damage == "flip" and content:
        content[place] ^= 1 << draw.randrange(8)
    elif damage in ("noise", "zeros"):
        block = min(len(content) - place, 1 + draw.randrange(512)) if content else 0
        content[place : place + block] = draw.randbytes(block) if damage == "noise" else bytes(block)
    elif damage in ("cut", "empty"):
        del content[place if damage == "cut" else 0 :]
    mode = path.stat().st_mode
    path.chmod(0o644)
    path.write_bytes(content)
    path.chmod(mode)


def void(_: object) -> None:
    """Drop a value."""


def perform_all(names: list[str], seed: int, whole: Undisturbed, top: Path, jobs: int) -> Iterator[Outcome]:
    """Perform attacks, some at a time, each from a process that is forked for it; yield what became of them."""
    waiting, running = list(reversed(names)), dict[int, str]()
    while waiting or running:
        while waiting and len(running) < jobs:
            name = waiting.pop()
            child = os.fork()
            if child == 0:
                try:
                    outcome = Attack(name, seed, whole, top).perform()
                    (top / f"{name}.json").write_text(json.dumps(astuple(outcome)), encoding="utf-8")
                finally:
                    os._exit(0)
            running[child] = name
        child, _ = os.wait()
        name = running.pop(child)
        report = top / f"{name}.json"
        if report.exists():
            yield Outcome(*json.loads(report.read_text(encoding="utf-8")))
            report.unlink()
        else:
            yield Outcome(name, "", HANGS, False, "the harness itself failed, see above")


def main() -> None:
    """Perform the attacks that are asked for; one line for each that is not good, and counts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for kind in KINDS:
        parser.add_argument(f"--{kind}", type=int, default=0, metavar="NUMBER")
    parser.add_argument("--job", choices=["one_axis", "worked_example"], default="one_axis")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--table", type=Path, default=None)
    arguments = parser.parse_args()
    known = {row["attack"] for row in read_table(arguments.table)} if arguments.table else set()
    names = [f"{kind}_{i}" for kind in KINDS for i in range(getattr(arguments, kind))]
    names = [name for name in names if name not in known]
    if arguments.job != "one_axis" and (arguments.fail or arguments.full or arguments.corrupt):
        parser.error(f"--job {arguments.job} can be killed only")
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as top:
        whole = undisturbed(Path(top), arguments.job)
        print(
            f"undisturbed: {whole.length_s:.2f} s, {whole.calls} file calls, {whole.size / 1e6:.2f} MB, "
            f"{len(whole.artifacts)} artifacts",
            flush=True,
        )
        counts = Counter[tuple[str, int, bool]]()
        for i, outcome in enumerate(perform_all(names, arguments.seed, whole, Path(top), arguments.jobs), 1):
            counts[outcome.attack.partition("_")[0], outcome.code, outcome.good] += 1
            if arguments.table:
                append_row(arguments.table, outcome)
            if not outcome.good:
                print(*astuple(outcome), sep=", ", flush=True)
            if i % 100 == 0:
                print(f"{i} of {len(names)}", flush=True)
    for (kind, code, good), number in sorted(counts.items()):
        print(f"{kind}: {number} {'good' if good else 'NOT GOOD'} with exit code {code}")
    good = sum(number for (_, _, is_good), number in counts.items() if is_good)
    print(f"{good} of {len(names)} attacks are good")
    sys.exit(0 if good == len(names) else 1)


if __name__ == "__main__":
    main()
