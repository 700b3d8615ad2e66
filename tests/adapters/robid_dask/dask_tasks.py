"""Tasks for the tests of the dask executor, in a module that its workers can import."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def solve(seed: int, matrix: FloatArray) -> dict[str, Any]:
    """Return what rounds differently with another library or number of threads."""
    noise = np.random.default_rng(seed).normal(size=matrix.shape)
    values, vectors = np.linalg.eigh(matrix @ matrix.T + noise @ noise.T)
    return {"seed": seed, "values": values, "vectors": vectors, "complex": np.fft.rfft(matrix, axis=0)}


def process_number(_: int) -> int:
    """Return where the task ran; long enough that two workers share the work."""
    time.sleep(0.1)
    return os.getpid()


def process_or_not(number: int) -> int:
    """Return at once."""
    return number


def threads(_: int) -> tuple[list[int], int]:
    """Return with how many threads libraries of linear algebra and numba compute."""
    import numba
    from threadpoolctl import threadpool_info

    return [library["num_threads"] for library in threadpool_info()], numba.get_num_threads()


def die_once(index: int, folder: str) -> int:
    """Kill the worker in the middle of task 2, the first time it runs."""
    mark = Path(folder) / "died"
    if index == 2:
        try:
            mark.touch(exist_ok=False)
        except FileExistsError:
            return index**2
        os.kill(os.getpid(), signal.SIGKILL)
    return index**2


def die(_: int) -> None:
    """Kill every worker that tries."""
    os.kill(os.getpid(), signal.SIGKILL)


def refuse(index: int) -> int:
    """Raise from task 1 on, each with its own message."""
    if index >= 1:
        raise ValueError(f"task {index} cannot be done")
    return index


def wait(mark: str) -> None:
    """Tell that the task has begun and go on for a minute."""
    Path(mark).touch()
    time.sleep(60)


class Unpackable(Exception):
    """An exception that can be packed and not unpacked."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(first)
        self.second = second


def raise_unpackable(_: int) -> None:
    """Raise what does not survive the way home."""
    raise Unpackable("too much", "of this")
