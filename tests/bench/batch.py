"""Time, linearity and memory of batches of simulations: `python tests/bench/batch.py`.

Paper B's procedure (24 experiments x 100 configurations x 15 s, six axes, friction, both ripples, sampled control,
saturation, sensor noise) through `simulate_portions`: a share of it by threads of this process, by two processes and by
two workers of dask, or with `--full` the whole of it by threads. Times are on the wall, on a machine that may be
shared: processor time stands beside them. Memory is what a process of its own needs at most above what it had.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported: one thread unless said
for _folder in (Path(__file__).parent, Path(__file__).parents[1]):
    if str(_folder) not in sys.path:
        sys.path.append(str(_folder))

import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
from bench_table import Row, markdown  # noqa: E402
from workload import LOWER, UPPER, bench_robot, random_experiments  # noqa: E402

from robid_core import ExperimentBatch, simulate_portions  # noqa: E402
from robid_core.executors import process_executor  # noqa: E402
from robid_core.robot.experiments import PORTION  # noqa: E402
from robid_core.stage import map_in_process  # noqa: E402

FloatArray = npt.NDArray[np.float64]
N_EXPERIMENT, N_CONFIGURATION, DURATION = 24, 100, 15.0  # Paper B's procedure
MEGABYTE = 1e6
N_ROUND = 7


def experiments(n_configuration: int, duration: float, n_experiment: int = N_EXPERIMENT) -> ExperimentBatch:
    """Return the same experiments in many configurations of the bench's robot."""
    robot = bench_robot()
    reference = random_experiments(robot, n_experiment, duration).reference
    generator = np.random.default_rng(7)
    angle = np.repeat(generator.uniform(LOWER, UPPER, (n_configuration, robot.n_axis)), n_experiment, axis=0)
    which = np.tile(np.arange(n_experiment), n_configuration)
    return ExperimentBatch(robot, reference, robot.motor_angle(angle), which, np.arange(len(angle)))


def processor_seconds() -> float:
    """Return the processor time of this process and of every process that it or its children started."""
    parents: dict[int, int] = {}
    ticks: dict[int, int] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has just ended
            fields = stat.read_text(encoding="ascii", errors="replace").rpartition(") ")[2].split()
            parents[int(stat.parent.name)], ticks[int(stat.parent.name)] = (
                int(fields[1]),
                sum(map(int, fields[11:13])),
            )
    family = {os.getpid()}
    while more := {pid for pid, parent in parents.items() if parent in family} - family:
        family |= more
    return sum(ticks.get(pid, 0) for pid in family) / os.sysconf("SC_CLK_TCK")


def seconds_of(tasks: Any, batch: ExperimentBatch, n_thread: int | None) -> tuple[float, float]:
    """Return time on the wall and of processors that a batch takes; nothing is kept of it."""
    processors, start = processor_seconds(), time.perf_counter()
    for _ in simulate_portions(tasks, [batch], n_thread=n_thread):
        pass
    return time.perf_counter() - start, processor_seconds() - processors


@contextlib.contextmanager
def dask_workers() -> Iterator[Any]:
    """Give a map over two workers of dask, where it is installed."""
    from robid_core.registry import EXECUTORS, registry

    with registry().load(EXECUTORS, "dask")(n_workers=2) as tasks:
        yield tasks


def whole_procedure(n_configuration: int) -> list[Row]:
    """Time of Paper B's procedure by every way to two cores, from a share of its configurations."""
    batch, few = experiments(n_configuration, DURATION), experiments(4, 5.0)
    share = n_configuration / N_CONFIGURATION
    rows = []
    ways: dict[str, tuple[Callable[[], Any], int | None]] = {
        "2 threads of one process": (lambda: contextlib.nullcontext(map_in_process), 2),
        "1 thread": (lambda: contextlib.nullcontext(map_in_process), 1),
        "2 processes": (lambda: process_executor(jobs=2), 0),
        "2 workers of dask": (dask_workers, 0),
    }
    if share >= 1:
        ways = {"2 threads of one process": ways["2 threads of one process"]}
    for name, (executor, n_thread) in ways.items():
        with executor() as tasks:
            seconds_of(tasks, few, n_thread)  # workers start and load their kernels: four portions
            wall, processor = seconds_of(tasks, batch, n_thread)
        target = 120.0 if name != "1 thread" else None
        rows.append(
            Row(
                f"24 x 100 x 15 s, {name} ({share:.0%} measured)",
                f"{wall / share:.0f} s on the wall, {processor / share:.0f} s of processors",
                f"{target:.0f} s" if target else "",
                wall / share <= target if target else None,
            )
        )
    return rows


def line_through(x: list[float], y: list[float]) -> tuple[float, float, float]:
    """Return slope, offset and R^2 of the straight line through points."""
    slope, offset = np.polyfit(x, y, 1)
    rest = np.array(y) - slope * np.array(x) - offset
    return float(slope), float(offset), float(1 - np.var(rest) / np.var(y))


def linearity() -> list[Row]:
    """Processor time on one thread over the number of experiments and over their duration."""
    seconds_of(map_in_process, experiments(1, 1.0), 1)
    counts, durations = [1, 2, 4, 6, 8], [1.0, 2.0, 4.0, 6.0, 8.0]

    batches = [experiments(n, 2.0) for n in counts] + [experiments(2, duration) for duration in durations]
    rounds = [[seconds_of(map_in_process, batch, 1)[1] for batch in batches] for _ in range(N_ROUND)]
    least = np.min(rounds, axis=0).tolist()  # who else computes makes it more
    by_count, by_duration = least[: len(counts)], least[len(counts) :]
    rows = []
    for name, x, y in (
        ("number of experiments (24 to 192, 2 s each)", [N_EXPERIMENT * n * 2.0 for n in counts], by_count),
        ("duration (1 to 8 s, 48 experiments)", [2 * N_EXPERIMENT * d for d in durations], by_duration),
    ):
        slope, offset, fit = line_through(x, y)
        rows.append(
            Row(
                f"processor time of one thread over {name}",
                f"{1e3 * slope:.2f} ms a simulated second ({1 / slope:.0f} x real time), offset {offset:.2f} s, "
                f"R^2 {fit:.4f}",
                "R^2 0.99",
                fit >= 0.99,
            )
        )
    return rows


# Memory, each case in a process of its own -------------------------------------------------------------------------


def high_water() -> float:
    """Return the largest resident memory of this process since `reset_high_water`, bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return 1024.0 * next(float(line.split()[1]) for line in lines if line.startswith("VmHWM"))


def measure_memory(n_configuration: int, keep: bool, n_thread: int) -> dict[str, float]:
    """Return bytes recorded, and the peak above what was there before, of one batch."""
    batch = experiments(n_configuration, 5.0)
    first = experiments(1, 5.0)
    for _ in simulate_portions(map_in_process, [first], n_thread=n_thread):
        pass
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # forget the largest so far
    before = high_water()
    position = np.empty(batch.shape) if keep else None
    torque = np.empty(batch.shape) if keep else None
    largest = 0.0
    for portion in simulate_portions(map_in_process, [batch], n_thread=n_thread):
        if position is None or torque is None:
            largest = max(largest, float(np.abs(portion.torque).max()))  # what a study would keep
        else:
            position[portion.first : portion.last] = portion.position
            torque[portion.first : portion.last] = portion.torque
    return {"recorded": 2.0 * 8 * float(np.prod(batch.shape)), "peak": high_water() - before}


def memory() -> list[Row]:
    """Peak memory over what is recorded, with results kept and with results passed on."""

    def case(n_configuration: int, keep: bool) -> dict[str, float]:
        arguments = [sys.executable, __file__, "--measure-memory", json.dumps([n_configuration, keep, 2])]
        said = subprocess.run(arguments, check=True, capture_output=True, text=True).stdout
        found: dict[str, float] = json.loads(said.strip().splitlines()[-1])
        return found

    counts = [8, 16, 32]
    rows = []
    for keep, words in ((True, "kept"), (False, "passed on")):
        cases = [case(n, keep) for n in counts]
        x, y = ([one[name] / MEGABYTE for one in cases] for name in ("recorded", "peak"))
        slope, offset, _ = line_through(x, y)
        limit = 1.1 if keep else 0.1
        rows.append(
            Row(
                f"peak memory over recorded bytes ({x[0]:.0f} to {x[-1]:.0f} MB), results {words}, 2 threads",
                f"{slope:.2f} bytes a byte and {offset:.0f} MB (a portion records "
                f"{2 * 8 * 6 * PORTION / MEGABYTE:.0f} MB)",
                f"at most {limit}",
                slope <= limit,
            )
        )
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Measure, print the table; exit code 1 where a target was missed and `--check` asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("benches", nargs="*", choices=["time", "linear", "memory", []], help="default: all")
    parser.add_argument("--configurations", type=int, default=8, help="how many of the 100 are measured")
    parser.add_argument("--full", action="store_true", help="all 100 configurations, by threads")
    parser.add_argument("--check", action="store_true", help="fail where a target is missed")
    parser.add_argument("--measure-memory", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.measure_memory:
        print(json.dumps(measure_memory(*json.loads(options.measure_memory))))
        return 0
    count = N_CONFIGURATION if options.full else options.configurations
    benches: dict[str, Callable[[], list[Row]]] = {
        "time": lambda: whole_procedure(count),
        "linear": linearity,
        "memory": memory,
    }
    rows: list[Row] = []
    for name in options.benches or benches:
        print(f"{name} ...", file=sys.stderr, flush=True)
        rows += benches[name]()
    print(markdown(rows))
    return int(options.check and any(row.reached is False for row in rows))


if __name__ == "__main__":
    sys.exit(main())
