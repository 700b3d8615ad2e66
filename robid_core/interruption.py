"""Being told to stop: Ctrl-C, SIGTERM and a closed terminal all end a run the same way (fault D18).

A signal raises KeyboardInterrupt in the main thread, and leaves a latch behind. Python drops an exception that is
raised inside a `__del__` or a weakref callback, and a stage may swallow one; the latch stays, and whoever waits or
reports progress looks at it by `heed()`. A signal that follows within a second only sets the latch, so that a
second Ctrl-C does not break into what the first one cleans up.

Motion needs more care: while drives are up, `at_safe_points()` lets signals interrupt at calls of `heed()` only, and
while they are being stopped, `held()` keeps signals waiting until that is done. State is the process's, as signals are.
"""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Iterator
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
REPEATED_S = 1.0  # a signal so soon after one that was raised is the same wish


class _Latch:
    """What signals have asked for, and what may be done about it now."""

    def __init__(self) -> None:
        self.requested = False
        self.raised_at = -REPEATED_S
        self.listening = self.held = self.at_safe_points = 0


_latch = _Latch()


@contextlib.contextmanager
def signals_as_interrupt() -> Iterator[None]:
    """Listen to SIGINT, SIGTERM and SIGHUP (only the main thread can; one that is ignored stays so, as by nohup).

    The outermost listener begins and ends without a request; inner ones change nothing.
    """
    if threading.current_thread() is not threading.main_thread() or _latch.listening:
        yield
        return
    _latch.requested, _latch.raised_at = False, -REPEATED_S
    heard = [number for number in SIGNALS if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, _hear) for number in heard}
    _latch.listening = 1
    try:
        yield
    finally:
        _latch.listening = 0
        for number, handler in before.items():
            if signal.getsignal(number) is _hear:
                signal.signal(number, handler)
        _latch.requested = False


def _hear(number: int, frame: FrameType | None) -> None:
    """Set the latch, and raise where that is safe."""
    _latch.requested = True
    repeated = time.monotonic() - _latch.raised_at < REPEATED_S
    if not (repeated or _latch.held or _latch.at_safe_points):
        _raise()


def _raise() -> None:
    _latch.raised_at = time.monotonic()
    raise KeyboardInterrupt


def no_longer() -> None:
    """Ignore signals from now on: the outcome is settled, and the process ends."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def requested() -> bool:
    """Tell whether a signal has asked to stop."""
    return _latch.requested


def heed() -> None:
    """Raise KeyboardInterrupt where a signal has asked to stop; called wherever somebody waits or reports progress."""
    if _latch.requested and not _latch.held:
        _raise()


@contextlib.contextmanager
def at_safe_points() -> Iterator[None]:
    """Let signals interrupt at `heed()` only: what is between two calls runs to its end."""
    _latch.at_safe_points += 1
    try:
        yield
    finally:
        _latch.at_safe_points -= 1


@contextlib.contextmanager
def held() -> Iterator[None]:
    """Keep signals waiting: not even `heed()` raises. For what must be finished, such as stopping a robot."""
    _latch.held += 1
    try:
        yield
    finally:
        _latch.held -= 1
