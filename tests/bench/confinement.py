"""What a process of its own costs a stage: python tests/bench/confinement.py.

A stage that has next to nothing to do (four configurations of the packaged robot) is made in the run's process and in
one of its own, as third parties' stages are; the difference of the medians is told, as time on the clock and of the
processor. It is what a process imports beyond what the server of processes has, so it does not grow with the stage. The
first stage of a run starts that server, which imports robid; that is told apart.
"""

from __future__ import annotations

import contextlib
import os
import statistics
import tempfile
import time
from pathlib import Path

from robid_core.pipeline import Pipeline
from robid_core.run import ALL, RunOptions, run_pipeline

TEXT = """\
robid: 1
name: confinement
seed: 1
robot: six_axis
stages:
  where: {use: design.candidates, with: {count: 4}}
"""
TIMES = 10


def processor_s() -> float:
    """Return the processor time of this process, of those it has waited for, and of the server with its processes."""
    spent = sum(os.times()[:4])
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if b"multiprocessing.forkserver" in (place / "cmdline").read_bytes():
                fields = (place / "stat").read_text().rpartition(")")[2].split()
                if int(fields[1]) == os.getpid():
                    spent += sum(int(ticks) for ticks in fields[11:15]) / os.sysconf("SC_CLK_TCK")
    return spent


def seconds(pipeline: Pipeline, deadline_s: float | None) -> tuple[float, float]:
    """Return the time on the clock, and of the processor with that of the processes started, of one run."""
    clock, spent = time.perf_counter(), processor_s()
    run_pipeline(pipeline, RunOptions(force=(ALL,), jobs=1, deadline_s=deadline_s))
    return time.perf_counter() - clock, processor_s() - spent


def main() -> None:
    """Measure in turns, so that what else the machine does meets both."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "pipeline.yaml")
        file.write_text(TEXT, encoding="utf-8")
        pipeline = Pipeline.load(file)
        seconds(pipeline, None)
        first = seconds(pipeline, 600.0)
        pairs = [(seconds(pipeline, None), seconds(pipeline, 600.0)) for _ in range(TIMES)]
    for index, what in enumerate(("on the clock", "of the processor")):
        here, there = (statistics.median(pair[side][index] for pair in pairs) for side in (0, 1))
        print(
            f"{what}: {1e3 * here:.0f} ms here, {1e3 * there:.0f} ms in a process: {1e3 * (there - here):.0f} ms; "
            f"the first {1e3 * (first[index] - here):.0f} ms"
        )


if __name__ == "__main__":
    main()
