"""Tell people what they wait for, where it takes long: compiling happens once, and nobody should think of a hang."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Iterator

COMPILING = "robid: compiling kernels, once; later sessions load them from disk"
PATIENCE_S = 3.0  # loading them takes less


@contextlib.contextmanager
def told_if_slow(text: str = COMPILING, patience_s: float = PATIENCE_S) -> Iterator[None]:
    """Write a line to standard error where the body takes longer than `patience_s`."""
    timer = threading.Timer(patience_s, lambda: print(text, file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
