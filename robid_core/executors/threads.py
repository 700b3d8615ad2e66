"""One thread for linear algebra and compiled kernels: the same bytes whatever the machine is doing.

Sums in another order give another last digit, and libraries choose the order by the number of threads. So a
run computes with one thread per process, and uses the cores with processes; or with threads of its own where each
computes something alone, as the simulated experiments of a batch (`stream_threads`).
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator

THREADS = 1
VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)


def set_variables() -> None:
    """Tell libraries that are still to be loaded to use one thread."""
    for name in VARIABLES:
        os.environ[name] = str(THREADS)
    numba = sys.modules.get("numba")
    if numba is None or numba.config.NUMBA_NUM_THREADS == THREADS:
        os.environ["NUMBA_NUM_THREADS"] = str(THREADS)  # numba refuses another value later: never taken back
    else:
        numba.set_num_threads(THREADS)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Compute with one thread: libraries loaded before by their own switch, later ones by the environment."""
    from threadpoolctl import threadpool_limits

    before = {name: os.environ.get(name) for name in VARIABLES}
    set_variables()
    try:
        with threadpool_limits(limits=THREADS):
            yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def thread_settings() -> dict[str, int]:
    """Say with how many threads a run computes."""
    return {"linear_algebra": THREADS, "kernels": THREADS}
