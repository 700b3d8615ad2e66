"""Tasks for the tests of executors, in a module that worker processes can import."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt


def total(values: npt.NDArray[np.float64], scale: float) -> npt.NDArray[np.float64]:
    """Return what rounds differently in another order."""
    values *= scale  # a task may change what it is given
    result: npt.NDArray[np.float64] = np.sum(values, axis=0)
    return result


def square(number: int) -> int:
    """Return a square."""
    return number**2


def die_once(number: int, folder: str, mark: str) -> int:
    """Kill the worker in the middle of the marked task, the first time it runs."""
    if str(number) == mark:
        try:
            (Path(folder) / "died").touch(exist_ok=False)
        except FileExistsError:
            return number**2
        time.sleep(0.2)
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2


def die_at(number: int, mark: int) -> int:
    """Kill every worker that runs the marked task."""
    if number == mark:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


class Unpackable(Exception):
    """An exception that can be packed and not unpacked."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(first)
        self.second = second


def raise_unpackable(number: int) -> int:
    """Raise what does not survive the way home."""
    if number == 1:
        raise Unpackable("too much", "of this")
    return number
