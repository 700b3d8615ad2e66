"""What a process of its own costs a stage: python tests/bench/confinement.py.

A stage that has next to nothing to do (four configurations of the packaged robot) is made in the run's process and in
one of its own, as third parties' stages are; the difference of the medians is told, as time on the clock and of the
processor. It is the start of Python and the import of robid, so it does not grow with the stage.
"""

from __future__ import annotations

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


def seconds(pipeline: Pipeline, deadline_s: float | None) -> tuple[float, float]:
    """Return the time on the clock, and of the processor with that of the processes started, of one run."""
    clock, spent = time.perf_counter(), sum(os.times()[:4])
    run_pipeline(pipeline, RunOptions(force=(ALL,), jobs=1, deadline_s=deadline_s))
    return time.perf_counter() - clock, sum(os.times()[:4]) - spent


def main() -> None:
    """Measure in turns, so that what else the machine does meets both."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "pipeline.yaml")
        file.write_text(TEXT, encoding="utf-8")
        pipeline = Pipeline.load(file)
        seconds(pipeline, None)
        pairs = [(seconds(pipeline, None), seconds(pipeline, 600.0)) for _ in range(TIMES)]
    for index, what in enumerate(("on the clock", "of the processor")):
        here, there = (statistics.median(pair[side][index] for pair in pairs) for side in (0, 1))
        print(
            f"{what}: {1e3 * here:.0f} ms here, {1e3 * there:.0f} ms in a process: {1e3 * (there - here):.0f} ms"
        )


if __name__ == "__main__":
    main()
