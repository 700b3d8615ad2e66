"""Being told to stop: Ctrl-C, SIGTERM, a closed terminal and a used-up limit of processor time (`ulimit -St`) all end
a run the same way (fault D18).

A signal raises KeyboardInterrupt in the main thread, and leaves a latch behind. Python drops an exception that is
raised inside a `__del__` or a weakref callback, and a stage may swallow one. So the main thread is reminded every half
second until the exception has come out, and whoever waits or reports progress looks at the latch by `heed()`. While
a KeyboardInterrupt is being handled, in `finally` and `except` blocks, none is raised on top of it: a second Ctrl-C
does not break into what the first one cleans up.

Motion needs more care: while drives are up, `at_safe_points()` lets signals interrupt at calls of `heed()` only, and
where something must be finished, `held()` keeps signals waiting. State is the process's, as signals are.
"""

from __future__ import annotations

import contextlib
import functools
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

from robid_core.errors import with_contexts

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGXCPU)
REMIND_S = 0.5  # how often the main thread is reminded of a request that has not come out


class _Latch:
    """What signals have asked for, and what may be done about it now."""

    def __init__(self) -> None:
        self.requested = False
        self.first = 0  # number of the signal that asked
        self.listening = self.held = self.at_safe_points = 0
        self.over = threading.Event()  # nobody has to be reminded any more
        self.reminder: threading.Thread | None = None


_latch = _Latch()


@contextlib.contextmanager
def signals_as_interrupt() -> Iterator[None]:
    """Listen to `SIGNALS` (only the main thread can; one that is ignored stays so, as by nohup).

    The outermost listener begins and ends without a request; inner ones change nothing.
    """
    if threading.current_thread() is not threading.main_thread() or _latch.listening:
        yield
        return
    _latch.requested, _latch.over = False, threading.Event()
    heard = [number for number in SIGNALS if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, _hear) for number in heard}
    show = sys.unraisablehook
    silent = sys.unraisablehook = functools.partial(_show_unless_latched, show)
    _latch.listening = 1
    try:
        yield
    finally:
        _latch.over.set()
        if _latch.reminder is not None:
            _latch.reminder.join()  # a thread that wakes while Python ends may crash it
        _latch.reminder = None
        _latch.listening = 0
        if sys.unraisablehook is silent:
            sys.unraisablehook = show
        for number, handler in before.items():
            if signal.getsignal(number) is _hear:
                signal.signal(number, handler)
        _latch.requested = False


def _show_unless_latched(show: Callable[[Any], object], dropped: sys.UnraisableHookArgs) -> None:
    """Show an exception that Python drops, with its traceback; not a KeyboardInterrupt, which the latch still has."""
    if not (issubclass(dropped.exc_type, KeyboardInterrupt) and _latch.requested):
        show(dropped)


def _forget() -> None:
    """Hear signals as any process does: one that a stage's code has forked is nobody's run, and is ended by them."""
    for number in SIGNALS:
        if signal.getsignal(number) is _hear:
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
    _latch.requested, _latch.listening = False, 0


os.register_at_fork(after_in_child=_forget)


def _hear(number: int, frame: FrameType | None) -> None:
    """Set the latch, and raise where that is safe."""
    with held():  # one that comes now would raise before there is who reminds of it
        first, _latch.requested = not _latch.requested, True
        if first:
            _latch.first = number
            arguments = (number, threading.get_ident(), _latch.over)
            _latch.reminder = threading.Thread(
                target=_remind, args=arguments, name="robid reminder", daemon=True
            )
            _latch.reminder.start()
    if not (_latch.held or _latch.at_safe_points or _latch.over.is_set() or _being_handled()):
        raise KeyboardInterrupt


def _remind(number: int, main: int, over: threading.Event) -> None:
    """Send the signal to the main thread again and again: it wakes who sleeps, too."""
    while not over.wait(REMIND_S):
        with contextlib.suppress(ProcessLookupError):
            signal.pthread_kill(main, number)


def _being_handled() -> bool:
    """Tell whether the main thread is cleaning up after a KeyboardInterrupt, or after what that became."""
    return any(isinstance(error, KeyboardInterrupt) for error in with_contexts(sys.exc_info()[1]))


def settled() -> None:
    """Take note that the request has come out: nobody is reminded any more. For who handles KeyboardInterrupt last."""
    _latch.over.set()


def no_longer() -> None:
    """Ignore signals from now on: the outcome is settled, and the process ends."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def requested() -> bool:
    """Tell whether a signal has asked to stop."""
    return _latch.requested


def out_of_processor_time() -> str:
    """Say so where a limit of processor time was what asked to stop; empty where it was not."""
    if not (_latch.requested and _latch.first == signal.SIGXCPU):
        return ""
    return "the processor time that a limit allows each process is used up (ulimit -t)"


def interrupted_told() -> str:
    """Return the word for what ends with KeyboardInterrupt, and its reason where no person asked for it."""
    return ": ".join(filter(None, ("interrupted", out_of_processor_time())))


def may_be_requested() -> bool:
    """Tell whether a KeyboardInterrupt may come from a signal: nobody listens, or one has asked to stop."""
    return _latch.requested or not _latch.listening


def heed() -> None:
    """Raise KeyboardInterrupt where a signal has asked to stop; called wherever somebody waits or reports progress.

    Not while one is being handled already, nor where signals are held.

    >>> import robid_core as robid
    >>> for _ in range(3):  # a long loop of a plugin
    ...     robid.heed()
    """
    if _latch.requested and not _latch.held and not _being_handled():
        raise KeyboardInterrupt


@contextlib.contextmanager
def at_safe_points() -> Iterator[None]:
    """Let signals interrupt at `heed()` only: what is between two calls runs to its end.

    >>> import robid_core as robid
    >>> with robid.at_safe_points():
    ...     robid.heed()  # here, between two motions, and nowhere else
    """
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
