"""Says when a kernel is about to be compiled because its machine code is not on disk yet."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Any

from numba.core import event

from robid_core.compiled.machine_code import is_kernel


def on_standard_error(kernel: str) -> None:
    """Tell a person what is waited for."""
    text = f"robid: compiling kernels, once: {kernel} and others; later sessions load them from disk"
    print(text, file=sys.stderr, flush=True)


@contextlib.contextmanager
def compilation_told(tell: Callable[[str], None] = on_standard_error) -> Iterator[None]:
    """Call `tell` with the name of the first kernel that is compiled in here, before it is."""
    listener = _First(tell)
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)


class _First(event.Listener):  # type: ignore[misc]
    """Hears numba begin to compile."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell: Callable[[str], None] | None = tell

    def on_start(self, event: Any) -> None:
        function = event.data["dispatcher"]
        if self._tell is not None and is_kernel(function):
            tell, self._tell = self._tell, None
            tell(function.py_func.__name__)

    def on_end(self, event: Any) -> None:
        """Nothing is told then."""
