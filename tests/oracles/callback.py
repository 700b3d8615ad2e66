"""MuJoCo's control callback in machine code, which reads and writes arrays by their addresses."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numba as nb
import numpy as np
import numpy.typing as npt
from numba.core import cgutils, types
from numba.extending import intrinsic

STAGES = 4  # of Runge and Kutta's method: MuJoCo asks for forces so often a step
MOST = 20  # arrays
ADDRESSES = np.zeros(MOST, dtype=np.int64)  # of the arrays that the callback reads and writes


@intrinsic
def _pointer(_context: Any, address: Any) -> Any:
    """Turn an address into a pointer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    assert isinstance(address, types.Integer)
    return types.voidptr(address), generate


_TABLE = ADDRESSES.ctypes.data


@nb.njit
def table(which, rows, columns):  # type: ignore[no-untyped-def]
    """Return an array of numbers, (rows, columns), by its place among the addresses."""
    addresses = nb.carray(_pointer(_TABLE), (MOST,), np.int64)
    return nb.carray(_pointer(addresses[which]), (rows, columns), np.float64)


@nb.njit
def counts(which):  # type: ignore[no-untyped-def]
    """Return an array of four whole numbers by its place among the addresses."""
    addresses = nb.carray(_pointer(_TABLE), (MOST,), np.int64)
    return nb.carray(_pointer(addresses[which]), (4,), np.int64)


def compiled(act: Any) -> Any:
    """Compile a function of (model, data) as MuJoCo calls it."""
    return nb.cfunc("void(voidptr, voidptr)")(act)


@functools.cache
def _clock() -> Any:
    """Stand still: MuJoCo times the parts of every step, a third of it for a small robot."""
    return nb.cfunc("float64()")(lambda: 0.0)


@contextmanager
def installed(function: Any, arrays: tuple[npt.NDArray[Any], ...]) -> Iterator[None]:
    """Install a compiled callback, global in MuJoCo, on these arrays, and stop MuJoCo's clock."""
    ADDRESSES[: len(arrays)] = [array.ctypes.data for array in arrays]
    timed = mujoco.get_mjcb_time()
    mujoco.set_mjcb_time(_clock().ctypes)
    mujoco.set_mjcb_control(function.ctypes)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(None)
        mujoco.set_mjcb_time(timed)  # None: MuJoCo's own
