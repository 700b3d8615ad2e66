"""An interruption while worker processes are being started."""

from __future__ import annotations

import math
import subprocess
import sys
import threading

from faults.fault import fault

from robid_core.executors.process import process_executor

INTERRUPTED = """
import math, os, signal
from multiprocessing import util
from robid_core.executors.process import process_executor, start_resource_tracker
from robid_core.interruption import heed, settled, signals_as_interrupt

start_resource_tracker()
start = util.spawnv_passfds

def started_and_interrupted(*arguments):
    process = start(*arguments)
    os.kill(os.getpid(), signal.SIGTERM)
    return process

util.spawnv_passfds = started_and_interrupted
with signals_as_interrupt(), process_executor(2) as tasks:
    try:
        tasks(math.sqrt, [(1.0,), (4.0,)])
        heed()
    except KeyboardInterrupt:
        settled()
        print("interrupted")
"""


@fault(
    "D18",
    sees="interrupted, and no traceback of a worker process that was being started",
    mutant=(
        "robid_core/executors/process.py",
        "            with held():  # a worker",
        "            with contextlib.nullcontext():  # a worker",
    ),
)
def test_D18_a_worker_that_is_being_started_shows_no_traceback_when_its_run_is_interrupted() -> None:
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "interrupted\n", "")


def test_nothing_of_a_pool_lives_on_when_it_has_stopped() -> None:
    """Its manager thread closes a pipe at its end, to which an ending interpreter writes."""
    with process_executor(2) as tasks:
        assert tasks(math.sqrt, [(1.0,), (4.0,)]) == [1.0, 2.0]
        started = [thread for thread in threading.enumerate() if "ExecutorManager" in type(thread).__name__]
        assert started
    assert not any(thread.is_alive() for thread in started)
