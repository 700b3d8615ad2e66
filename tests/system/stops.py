"""Stops at random moments, with axes that disobey and signals doubled and tripled, in one process and under a deadline.

`python tests/system/stops.py --stops 200 --table tests/system/stops.csv` runs `robid run` on six CAN drives again and
again. One to five axes obey no order to stop; one to three signals (SIGINT, SIGTERM, SIGHUP) come at a moment of
simulated time, or at a moment of wall time counted from the start of the process. A stop is good where every drive
was told within one cycle, the run ended in time, its exit code is the documented one and its message names the drives
that disobeyed and no other. Stops that stand in the table already are not made again.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ROBID = str(Path(sys.executable).with_name("robid"))
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
CYCLE_MS = 1.0
LONGEST_S = 30.0  # from the first signal to the end of the process; who takes longer hangs
MOTION_S = 150.0  # simulated seconds in which signals of the first kind come
PIPELINE = """\
robid: 1
name: stop
seed: 3
robot: six_axis
drives: {{use: drill, with: {drives}}}
stages:
  where: {{use: design.candidates, with: {{count: 1}}}}
  excite: {{use: excitation.multisine, with: {{band_hz: [4, 80], lines: 30, period_s: 4, blocks: 1}}}}
  acquire: {{use: acquisition.drives, inputs: {{configurations: where}}, with: {{periods: 10, settle_periods: 1}}}}
"""


@dataclass(frozen=True)
class Case:
    """One stop, as it was drawn."""

    stop: int
    deadline: bool  # in a process of its own
    clock: str  # simulated or wall
    at_s: float
    gaps_s: tuple[float, ...]  # between the signals, on that clock
    numbers: tuple[int, ...]
    deaf: tuple[int, ...]


@dataclass(frozen=True)
class Outcome:
    """What became of it; one line of the table."""

    stop: int
    deadline: bool
    clock: str
    at_s: float
    signals: str
    deaf: str
    drives: str  # not up, stopped, not stopped
    told_ms: float  # the drive that was told last, after the stop began
    seconds: float  # wall time from the first signal to the end
    code: int
    good: bool
    why: str


def draw(stop: int, seed: int) -> Case:
    """Draw a case; every fourth one before or about the beginning, by wall clock."""
    generator = random.Random(f"{seed}/{stop}")
    clock = generator.choice(["simulated", "simulated", "wall"])
    at_s = generator.uniform(0.0, MOTION_S) if clock == "simulated" else generator.uniform(0.2, 7.0)
    numbers = [generator.choice(SIGNALS) for _ in range(generator.randint(1, 3))]
    spread = 1.0 if clock == "simulated" else 0.5
    gaps = [generator.choice([0.0, generator.uniform(0, spread)]) for _ in numbers[1:]]
    deaf = generator.sample(range(1, 7), generator.randint(1, 5))
    return Case(stop, stop % 2 == 1, clock, at_s, tuple(gaps), tuple(map(int, numbers)), tuple(sorted(deaf)))


def install(folder: Path) -> Path:
    """Install the drill's package as pip would; return the folder for PYTHONPATH."""
    site = folder / "site"
    shutil.copytree(HERE / "robid_stop_drill", site / "robid_stop_drill")
    info = site / "robid_stop_drill-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: robid_stop_drill\nVersion: 1.0\n", "utf-8")
    entries = "drill = robid_stop_drill:DrillDrives\ndrill-udp = robid_stop_drill.udp:UdpDrives\n"
    (info / "entry_points.txt").write_text(f"[robid.drives]\n{entries}", "utf-8")
    return site


def prepare(folder: Path, site: Path) -> Path:
    """Make what all stops share, everything before the motion; return the project."""
    project = folder / "project"
    project.mkdir()
    settings = {"plant": "six_axis_true", "report": "none"}
    (project / "pipeline.yaml").write_text(PIPELINE.format(drives=json.dumps(settings)), "utf-8")
    command = [ROBID, "run", "-q", "pipeline.yaml", "--until", "excite"]
    subprocess.run(command, cwd=project, env=environment(site), check=True, capture_output=True)
    return project


def environment(site: Path) -> dict[str, str]:
    """Variables of a run that finds the drill."""
    return {**os.environ, "PYTHONPATH": str(site), "PYTHONDONTWRITEBYTECODE": "1"}


def perform(case: Case, project: Path, site: Path) -> Outcome:
    """Run, interrupt, judge."""
    with tempfile.TemporaryDirectory(dir=project.parent) as top:
        folder, report = Path(top, "project"), Path(top, "report.json")
        shutil.copytree(project, folder)
        moments = [case.at_s]
        for gap in case.gaps_s:
            moments.append(moments[-1] + gap)
        timed = list(zip(moments, case.numbers, strict=True))
        settings = {"plant": "six_axis_true", "deaf": case.deaf, "report": str(report)}
        settings["signals"] = timed if case.clock == "simulated" else []
        (folder / "pipeline.yaml").write_text(PIPELINE.format(drives=json.dumps(settings)), "utf-8")
        command = [ROBID, "run", "-q", "pipeline.yaml", *(["--deadline", "300"] if case.deadline else [])]
        began = time.monotonic()
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment(site),
            text=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
            preexec_fn=_heard,
        )
        first = began
        if case.clock == "wall":
            for moment, number in timed:
                time.sleep(max(0.0, began + moment - time.monotonic()))
                process.send_signal(number)
            first = began + case.at_s
        try:
            _, said = process.communicate(timeout=LONGEST_S + (60 if case.clock == "simulated" else 0))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return _outcome(case, "?", float("nan"), LONGEST_S, -9, "hangs")
        seconds = time.monotonic() - first
        if case.clock == "simulated" and report.exists():
            seconds = time.time() - report.stat().st_mtime  # the stop ended when the report was written
        return judge(case, report, said, process.returncode, seconds)


def _heard() -> None:
    """Let the run hear signals that whoever started this ignores."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)


def judge(case: Case, report: Path, said: str, code: int, seconds: float) -> Outcome:
    """Compare what a run said with what the drives saw."""
    if not report.exists():
        why = (
            ""
            if code == 130 and "interrupted" in said
            else f"exit code {code} without a stop: {said[-200:]!r}"
        )
        return _outcome(case, "not up", float("nan"), seconds, code, why)
    seen = json.loads(report.read_text(encoding="utf-8"))
    told = seen["told_ms"]
    last = max(told.values(), default=float("nan"))
    whys = []
    if sorted(map(int, told)) != [1, 2, 3, 4, 5, 6] or not last < CYCLE_MS:
        whys.append(f"told {told}")
    disobeyed = [node for node in range(1, 7) if seen["state"][str(node)] != "SWITCH_ON_DISABLED"]
    turning = [node for node in range(1, 7) if seen["speed"][str(node)]]
    if disobeyed != list(case.deaf):
        whys.append(f"nodes {disobeyed} were not off")
    if code != 4:
        whys.append(f"exit code {code}")
    if (": USE THE EMERGENCY STOP" in said) != bool(turning):
        whys.append(f"nodes {turning} turn, and it said {said[-300:]!r}")
    named = [node for node in range(1, 7) if f"(node {node})" in said]
    if named != sorted({*disobeyed, *turning}):
        whys.append(f"nodes {named} are named")
    return _outcome(case, "not stopped" if turning else "not off", last, seconds, code, "; ".join(whys))


def _outcome(case: Case, drives: str, told_ms: float, seconds: float, code: int, why: str) -> Outcome:
    names = " ".join(signal.Signals(number).name for number in case.numbers)
    deaf = " ".join(map(str, case.deaf))
    rounded = round(case.at_s, 3), names, deaf, drives, round(told_ms, 3), round(seconds, 2), code
    return Outcome(case.stop, case.deadline, case.clock, *rounded, not why, why)


def read_table(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table, none where there is no file; lines with # say how it was made."""
    if not path.exists():
        return []
    lines = path.read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def append_row(path: Path, outcome: Any) -> None:
    """Add a line to a table, and before the first one the names of its columns."""
    fresh = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([[column.name for column in fields(outcome)]] * fresh + [astuple(outcome)])


def main() -> None:
    """Draw and perform stops; one line each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stops", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--table", type=Path, default=None)
    arguments = parser.parse_args()
    known = {int(row["stop"]) for row in read_table(arguments.table)} if arguments.table else set()
    outcomes = []
    with tempfile.TemporaryDirectory() as top, ThreadPoolExecutor(arguments.jobs) as threads:
        site = install(Path(top))
        project = prepare(Path(top), site)
        cases = [draw(stop, arguments.seed) for stop in range(arguments.stops) if stop not in known]
        for outcome in threads.map(lambda case: perform(case, project, site), cases):
            outcomes.append(outcome)
            print(*astuple(outcome), sep=", ", flush=True)
            if arguments.table:
                append_row(arguments.table, outcome)
    good = sum(outcome.good for outcome in outcomes)
    print(f"{good} of {len(outcomes)} stops are good")
    sys.exit(0 if good == len(outcomes) else 1)


if __name__ == "__main__":
    main()
