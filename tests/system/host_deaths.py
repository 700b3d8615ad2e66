"""Hosts that die: host and drives as two processes on loopback, the host killed or stopped at a random moment.

`python tests/system/host_deaths.py --deaths 1000 --table tests/system/host_deaths.csv` serves a simulated drive from
this process and lets `robid run` move it from a child, again and again. The child is killed (SIGKILL), or stopped
(SIGSTOP) and then continued (SIGCONT) or killed, at the n-th frame that it sends or at a moment of the undisturbed
run's length. Then the pipeline is run once more. A death is good where

- the drive stood still within its watchdog, its quick-stop ramp and 2 ms after the last heartbeat that it heard,
- it was switched off then and nothing moved it again, whatever the continued host still sent,
- the motion began once at most in both runs, and the second run did not move where it had begun: it refused, or had
  the whole recording of a host that died after it had switched the drive off,
- the exit codes are the documented ones, and no process of the host is left.

Times are those of the drive, looked at once a millisecond; its clock follows the wall clock and never jumps, so that a
busy computer makes no drive late. Deaths that stand in the table already are not made again.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import math
import multiprocessing
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from stops import append_row, install, read_table

LOOK_S = 1e-3
ROOM_S = 2e-3  # beside watchdog and ramp: a cycle of the drive and the time between two looks
HELD_UP_S = 0.2  # a drive without time for so long: the computer was too busy, and the death is tried again
MOST_ATTEMPTS = 10
LONGEST_S = 30.0  # who takes longer hangs
GONE_S = 1.0  # within which processes of a dead host are cleared away
REFUSED, ABORTED, HANGS = 3, 4, -999  # exit codes; of one that did not end
LOADED = ["robid_core.commands.app", "robid_acquisition.drives", "robid_mcap.writer"]  # once, for all chunks
PLANT = "one_axis_true"
PIPELINE = """\
robid: 1
name: death
seed: 3
robot: one_axis
drives: {{use: drill-udp, with: {{interface: virtual, plant: one_axis_true, port: {port}}}}}
stages:
  where: {{use: design.candidates, with: {{count: 1}}}}
  excite: {{use: excitation.multisine, with: {{band_hz: [4, 80], lines: 10, period_s: 0.5, blocks: 1}}}}
  acquire: {{use: acquisition.drives, inputs: {{configurations: where}}, with: {{periods: 2}}}}
"""


@dataclass(frozen=True)
class Case:
    """One death, as it was drawn."""

    death: int
    kind: str  # kill; continue: stopped and continued; stop: stopped, and killed after a while
    trigger: str  # frame, clock or motion (the clock from its beginning)
    share: float  # of the frames, of the length or of the motion's length, of an undisturbed run
    pause_s: float  # between the stop and what follows
    away_rad: float  # where the motor stands at first, from the start of the motion


@dataclass(frozen=True)
class Outcome:
    """What became of it; one line of the table."""

    death: int
    kind: str
    trigger: str
    at: float  # frame or second
    pause_ms: float
    speed: float  # rad/s, when the watchdog fired
    ramp_ms: float  # that the quick stop takes from there
    rest_ms: float  # from the last heartbeat to rest, less watchdog and ramp; nan where the drive was at rest
    motions: int  # that began in both runs
    code: int
    again: int  # exit code of the second run
    good: bool
    why: str


def draw(death: int, seed: int) -> Case:
    """Draw a case: half of them kills, half by frames, where bring-up and loading are densest."""
    generator = random.Random(f"{seed}/{death}")
    kind = generator.choice(["kill", "kill", "continue", "stop"])
    pause_s = generator.choice([generator.uniform(0.005, 0.5), generator.uniform(0.3, 0.6)])
    return Case(
        death,
        kind,
        generator.choice(["frame", "clock", "motion", "motion"]),
        generator.random(),
        0.0 if kind == "kill" else pause_s,
        generator.uniform(-60.0, 60.0),
    )


@dataclass
class Seen:
    """What the drives saw of one host, by their clock in s."""

    heard: float = -math.inf  # the last heartbeat
    quiet: float = -math.inf  # that, or when the host was missed
    lost: list[tuple[float, float]] = field(
        default_factory=list
    )  # enabled: when, and when the watchdog was due
    missed: bool = False  # the watchdog fired, enabled or not
    moves: list[float] = field(default_factory=list)  # moves to a start, beginnings of a run
    runs: int = 0
    held_up_s: float = 0.0  # that this process got no time to serve the drive
    looks: list[tuple[float, float, bool]] = field(default_factory=list)  # when, speed, whether powered

    @property
    def too_busy(self) -> bool:
        """Whether the computer had no time for the drive, or for a host that nobody disturbed."""
        return self.missed or self.held_up_s >= HELD_UP_S


class Drives:
    """One simulated drive on a port, watched from outside, over many hosts."""

    def __init__(self) -> None:
        from robid_stop_drill.udp import UdpEnd

        from robid_can.drive import DriveSystem
        from robid_can.drives import nameplates
        from robid_core import Robot

        robot = Robot.load(PLANT)
        self.bus = UdpEnd()
        self.plate = nameplates(robot)[0]
        plant = robot.plant()
        plant.rest(np.zeros(1))
        plant.track(np.zeros((2, 1)), 0)  # loads what is compiled, for which no drive stands still later
        self.system = DriveSystem(
            self.bus, robot.plant(), [self.plate], [1], sample_time_s=robot.sample_time_s
        )
        self.began = time.monotonic()
        self.start = float("nan")  # of the motion, rad
        self.seen = Seen()
        self._watch()

    def _watch(self) -> None:
        """Note heartbeats, losses of the host and the beginnings of motion, as they reach the drive and its motor."""
        node, motors, system = self.system.nodes[0], self.system.motors, self.system
        hear, lose, move, track = node.hear_heartbeat, node._lose_host, motors.move, motors.track

        def heard(node_id: int, now_us: int) -> None:
            self.seen.heard = self.seen.quiet = now_us * 1e-6
            hear(node_id, now_us)

        def lost() -> None:
            self.seen.quiet, self.seen.missed = system.time_s, True
            if node.state.name == "OPERATION_ENABLED":
                self.seen.lost.append((system.time_s, self.seen.heard + self.watchdog_s))
            lose()

        def moved(axis: int, target: float, *how: Any) -> None:
            self.seen.moves.append(system.time_s)
            self.start = target
            move(axis, target, *how)

        def tracked(*what: Any) -> None:
            self.seen.moves.append(system.time_s)
            self.seen.runs += 1
            track(*what)

        node.hear_heartbeat, node._lose_host = heard, lost  # type: ignore[method-assign]
        motors.move, motors.track = moved, tracked  # type: ignore[method-assign]

    def begin(self, away_rad: float) -> None:
        """Forget the last host; a person has switched the drive on and turned the motor by hand."""
        self.system.nodes[0].boot(self.system.now_ns // 1000)
        self.system.motors.settle(self.system.now_ns)
        if math.isfinite(self.start):
            self.system.motors.angle = np.array([self.start + away_rad])
        while self.bus.recv(0) is not None:
            pass
        self.bus.received, self.seen = 0, Seen()

    def serve(self) -> None:
        """Let the drive catch up with the wall clock by a look at most, or wait for a frame until it may."""
        behind_s = time.monotonic() - self.began - self.system.time_s
        self.seen.held_up_s = max(self.seen.held_up_s, behind_s)
        if behind_s < LOOK_S:
            self.bus.wait(LOOK_S - behind_s)
        else:
            self.system.advance(LOOK_S)
        node = self.system.nodes[0]
        powered = node.state.name in ("SWITCHED_ON", "OPERATION_ENABLED", "QUICK_STOP_ACTIVE")
        self.seen.looks.append((self.system.time_s, abs(node.axis.speed), powered))

    @property
    def watchdog_s(self) -> float:
        """After which silence the drive stops, as the host has set it."""
        from robid_can import dictionary as od

        return (self.system.nodes[0].objects.number(od.CONSUMER_HEARTBEAT) & 0xFFFF) * 1e-3

    def since_motion_s(self) -> float:
        """How long ago the first motion for this host began; 0 where none did."""
        return self.system.time_s - self.seen.moves[0] if self.seen.moves else 0.0

    def settled(self) -> bool:
        """Tell whether a silent host can change nothing any more: the watchdog has fired long ago, or never will."""
        time_s, speed, _ = self.seen.looks[-1]
        return not speed and time_s > self.seen.quiet + self.watchdog_s + 10 * ROOM_S


class Host:
    """`robid run` in a child that is forked from this process, where everything is loaded already."""

    def __init__(self, folder: Path) -> None:
        self.words = folder.with_name(f"{folder.name}-said-{time.monotonic_ns()}")
        self.pid = os.fork()
        self.code: int | None = None
        if not self.pid:
            self._become(folder)

    def _become(self, folder: Path) -> None:
        code = 70
        try:
            os.setsid()
            os.chdir(folder)
            to = os.open(self.words, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(to, 1)
            os.dup2(to, 2)
            from robid_core.commands import main

            main(["run", "-q", "pipeline.yaml", "--at-the-robot"])
        except SystemExit as end:
            code = int(end.code or 0)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)

    def signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        if not self.ended():
            os.kill(self.pid, number)

    def ended(self) -> bool:
        """Tell whether it has ended, and collect it."""
        if self.code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.code = os.waitstatus_to_exitcode(status) if pid else None
        return self.code is not None

    def left_over(self) -> list[int]:
        """Return the processes of its session that are still there after a while."""
        end = time.monotonic() + GONE_S
        while (there := _in_session(self.pid)) and time.monotonic() < end:
            time.sleep(0.01)
        return there


def _in_session(session: int) -> list[int]:
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields_of = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields_of[3]) == session:
            found.append(int(stat.parent.name))
    return found


class Drill:
    """A drive, a project in which all is made but the motion, and what an undisturbed run is like."""

    def __init__(self, top: Path) -> None:
        from robid_core.commands.app import command_line

        self.top, self.drives = top, Drives()
        self.project = top / "project"
        self.project.mkdir()
        file = self.project / "pipeline.yaml"
        file.write_text(PIPELINE.format(port=self.drives.bus.port), "utf-8")
        with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
            command_line(["run", "-q", str(file), "--until", "excite"])
        for attempt in range(MOST_ATTEMPTS):
            self.drives.begin(away_rad=0.0)
            began = time.monotonic()
            host = self.follow(self.copy(f"undisturbed-{attempt}"), 5 * LONGEST_S)
            if not self.drives.seen.too_busy:
                break
        assert host.code == 0, host.words.read_text()
        assert self.drives.seen.runs == 1
        self.whole = {
            "frame": self.drives.bus.received,
            "clock": time.monotonic() - began,
            "motion": self.drives.since_motion_s(),
        }

    def copy(self, name: str) -> Path:
        """Return a fresh copy of the project."""
        return Path(shutil.copytree(self.project, self.top / name))

    def follow(self, folder: Path, limit_s: float) -> Host:
        """Let a host run to its end."""
        host, end = Host(folder), time.monotonic() + limit_s
        while not host.ended() and time.monotonic() < end:
            self.drives.serve()
        return host

    def perform(self, case: Case) -> Outcome:
        """Perform a death on a computer that has time for the drive."""
        for _ in range(MOST_ATTEMPTS):
            outcome, too_busy = self.attempt(case)
            if not too_busy:
                break
        return outcome

    def attempt(self, case: Case) -> tuple[Outcome, bool]:
        """Let the host die and the drive settle, run again, judge; tell whether the computer was too busy, too."""
        drives, folder = self.drives, self.copy(f"death-{case.death}")
        drives.begin(case.away_rad)
        at = case.share * self.whole[case.trigger]
        now = {
            "frame": lambda: drives.bus.received,
            "clock": lambda: time.monotonic() - began,
            "motion": drives.since_motion_s,
        }[case.trigger]
        began, host = time.monotonic(), Host(folder)
        while not host.ended() and now() < at:
            drives.serve()
        host.signal(signal.SIGKILL if case.kind == "kill" else signal.SIGSTOP)
        if case.kind != "kill":
            goes_on = time.monotonic() + case.pause_s
            while time.monotonic() < goes_on:
                drives.serve()
            host.signal(signal.SIGCONT if case.kind == "continue" else signal.SIGKILL)
        end = time.monotonic() + LONGEST_S
        while not (host.ended() and drives.settled()) and time.monotonic() < end:
            drives.serve()
        seen = drives.seen
        drives.begin(case.away_rad)
        second = self.follow(folder, LONGEST_S)
        outcome = judge(case, at, (host, seen), (second, drives.seen), drives)
        shutil.rmtree(folder)
        return outcome, seen.held_up_s >= HELD_UP_S or drives.seen.too_busy


def judge(
    case: Case, at: float, first: tuple[Host, Seen], second: tuple[Host, Seen], drives: Drives
) -> Outcome:
    """Compare what the drive saw of both hosts with what it must see."""
    (host, seen), (again, seen_again) = first, second
    rest_s = speed = float("nan")
    whys = []
    for lost, due in seen.lost:
        after = [look for look in seen.looks if look[0] > lost]
        speed = max(one for when, one, _ in seen.looks if abs(when - lost) <= ROOM_S)
        ramp_s = speed / drives.plate.quick_stop_deceleration
        turning = [when for when, one, _ in after if one]
        rest_s = max(turning, default=lost) - due - ramp_s
        if not rest_s <= ROOM_S:
            whys.append(f"rest {1e3 * rest_s:.1f} ms after watchdog and ramp")
        if any(powered for when, _, powered in after if when > lost + ramp_s + ROOM_S):
            whys.append("powered after the watchdog")
        if any(when > lost for when in seen.moves):
            whys.append("moved after the watchdog")
    if len(seen.lost) > 1:
        whys.append("enabled anew after the watchdog")
    if seen.looks[-1][1] or seen.looks[-1][2]:
        whys.append("not at rest and off at the end")
    if seen.runs + seen_again.runs > 1:
        whys.append("the motion began twice")
    finished = seen.runs and not seen.lost  # the host itself had switched the drive off: all may be recorded
    if (
        seen.moves
        and host.code
        and (seen_again.moves or again.code not in ((REFUSED, 0) if finished else (REFUSED,)))
    ):
        whys.append(f"the second run moved {len(seen_again.moves)} times, or ended with {again.code}")
    if not seen.moves and again.code not in (0, REFUSED):
        whys.append(f"the second run ended with {again.code}")
    possible = {(ABORTED if seen.moves else REFUSED) if seen.lost else 0}
    if seen.missed and not seen.moves:  # not enabled yet, a drive says so, and the host refuses
        possible |= {REFUSED}
    if case.kind != "continue":
        possible |= {0, -signal.SIGKILL}
    if host.code not in possible:
        whys.append(f"exit code {host.code}: {host.words.read_text()[-200:]!r}")
    if left := [*host.left_over(), *again.left_over()]:
        whys.append(f"processes {left} are left")
    return Outcome(
        case.death,
        case.kind,
        case.trigger,
        round(at, 3),
        round(1e3 * case.pause_s, 1),
        round(speed, 2),
        round(1e3 * speed / drives.plate.quick_stop_deceleration, 2),
        round(1e3 * rest_s, 2),
        seen.runs + seen_again.runs,
        host.code if host.code is not None else HANGS,
        again.code if again.code is not None else HANGS,
        not whys,
        "; ".join(whys),
    )


def perform(deaths: list[int], seed: int) -> list[Outcome]:
    """Perform deaths that share a drive and what is loaded; to be called in a process of its own."""
    with tempfile.TemporaryDirectory() as top:
        sys.path.insert(0, str(install(Path(top))))
        drill = Drill(Path(top))
        try:
            return [drill.perform(draw(death, seed)) for death in deaths]
        finally:
            drill.drives.bus.shutdown()


def main() -> None:
    """Draw and perform deaths; one line each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--deaths", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--chunk", type=int, default=50, help="deaths that share a process")
    parser.add_argument("--table", type=Path, default=None)
    arguments = parser.parse_args()
    known = {int(row["death"]) for row in read_table(arguments.table)} if arguments.table else set()
    wanted = [death for death in range(arguments.deaths) if death not in known]
    chunks = [wanted[i : i + arguments.chunk] for i in range(0, len(wanted), arguments.chunk)]
    good = 0
    server = multiprocessing.get_context("forkserver")
    server.set_forkserver_preload(LOADED)
    with ProcessPoolExecutor(arguments.jobs, server, max_tasks_per_child=1) as processes:
        for outcomes in processes.map(perform, chunks, [arguments.seed] * len(chunks)):
            for outcome in outcomes:
                good += outcome.good
                print(*astuple(outcome), sep=", ", flush=True)
                if arguments.table:
                    append_row(arguments.table, outcome)
    print(f"{good} of {len(wanted)} deaths are good")
    sys.exit(0 if good == len(wanted) else 1)


if __name__ == "__main__":
    main()
