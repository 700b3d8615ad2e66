"""A signal is never lost: it raises, or it waits in the latch until somebody looks (D18)."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any

import pytest
from faults.fault import fault

from robid_core import interruption
from robid_core.errors import with_contexts
from robid_core.interruption import at_safe_points, heed, held, requested, signals_as_interrupt

INTERRUPTION = "robid_core/interruption.py"
ALL = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


@pytest.fixture(autouse=True)
def _default_handlers():
    """Whoever runs the tests may ignore signals, as a shell does for work in the background."""
    before = [signal.signal(number, signal.SIG_DFL) for number in ALL]
    yield
    for number, handler in zip(ALL, before, strict=True):
        signal.signal(number, handler)


@pytest.mark.parametrize("number", ALL)
def test_each_signal_raises_once_and_stays_in_the_latch(number: signal.Signals) -> None:
    with signals_as_interrupt():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
        assert requested()
        for _ in range(3):  # who swallowed it meets it again
            with pytest.raises(KeyboardInterrupt):
                heed()
    assert not requested()
    heed()


def test_a_signal_right_after_another_does_not_break_into_what_the_first_cleans_up() -> None:
    cleaned = []

    def work() -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            for number in ALL:
                signal.raise_signal(number)
            cleaned.append("all")

    with signals_as_interrupt(), pytest.raises(KeyboardInterrupt):
        work()
    assert cleaned == ["all"]
    with signals_as_interrupt():
        for _ in range(2):  # a person who insists is heard
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)


def test_cleaning_up_may_wait_and_call_others_that_look() -> None:
    """A look raises nothing on top of what is being handled, in nested calls, generators and context managers."""
    cleaned = []

    @contextlib.contextmanager
    def thing():
        try:
            yield
        finally:
            time.sleep(1.2 * interruption.REMIND_S)  # long enough to be reminded
            heed()
            cleaned.append("generator")

    def work() -> None:
        try:
            with thing():
                signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            heed()
            cleaned.append("except")
            raise RuntimeError("what became of it") from None
        finally:
            heed()
            cleaned.append("finally")

    with signals_as_interrupt(), pytest.raises(RuntimeError):
        work()
    assert cleaned == ["generator", "except", "finally"]


def test_a_signal_that_python_drops_wakes_who_sleeps_all_the_same() -> None:
    class Unlucky:
        def __del__(self) -> None:
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)

    began = time.monotonic()
    with signals_as_interrupt():
        Unlucky()
        with pytest.raises(KeyboardInterrupt):
            time.sleep(60)
    assert time.monotonic() - began < 10


@pytest.mark.parametrize("place", ["__del__", "weakref"])
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_signal_that_python_drops_is_met_at_the_next_look(place: str) -> None:
    came = []

    def hit(*_: object) -> None:
        came.append(place)
        signal.raise_signal(signal.SIGHUP)

    class Unlucky:
        __del__ = hit if place == "__del__" else None

    with signals_as_interrupt():
        thing = Unlucky() if place == "__del__" else threading.Event()
        watcher = weakref.ref(thing, hit if place == "weakref" else None)
        del thing  # Python prints "Exception ignored" and goes on
        assert came == [place]
        del watcher
        with pytest.raises(KeyboardInterrupt):
            heed()


@fault(
    "D18",
    sees="no traceback where Python drops what a signal raises, at a fork or in a `__del__`; of other errors, as ever",
    mutant=(
        INTERRUPTION,
        "    if not (issubclass(dropped.exc_type, KeyboardInterrupt) and _latch.requested):\n",
        "    if True:\n",
    ),
)
def test_D18_a_signal_that_python_drops_is_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[type[BaseException]] = []
    show = shown.append
    monkeypatch.setattr(sys, "unraisablehook", lambda dropped: show(dropped.exc_type))
    before = sys.unraisablehook

    class Unlucky:
        def __init__(self, call: Callable[[], object]) -> None:
            self.call = call

        def __del__(self) -> None:
            self.call()

    with signals_as_interrupt():
        Unlucky(lambda: signal.raise_signal(signal.SIGTERM))
        Unlucky(lambda: 1 / 0)
        assert requested()
    assert shown == [ZeroDivisionError]
    assert sys.unraisablehook is before


@fault(
    "D18",
    sees="a run that ends at two signals at once, also where Python drops what they raise: somebody reminds it",
    mutant=(
        INTERRUPTION,
        "    with held():  # one that comes now",
        "    with contextlib.nullcontext():  # one that comes now",
    ),
)
def test_D18_a_signal_within_another_does_not_keep_it_from_being_reminded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Reminder(threading.Thread):
        def __init__(self, **settings: Any) -> None:
            signal.raise_signal(signal.SIGTERM)
            super().__init__(**settings)

    monkeypatch.setattr(threading, "Thread", Reminder)
    with signals_as_interrupt():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert "robid reminder" in [thread.name for thread in threading.enumerate()]


def test_at_safe_points_a_signal_waits_for_the_next_look() -> None:
    reached = []

    def move() -> None:
        with at_safe_points():
            for number in ALL:
                signal.raise_signal(number)
            reached.append("the look")
            heed()
            reached.append("what is behind it")

    with signals_as_interrupt(), pytest.raises(KeyboardInterrupt):
        move()
    assert reached == ["the look"]


def test_held_not_even_a_look_raises_and_holds_nest() -> None:
    with signals_as_interrupt():
        with held():
            with held():
                signal.raise_signal(signal.SIGTERM)
                heed()
            heed()
        with pytest.raises(KeyboardInterrupt):
            heed()


def test_an_inner_listener_neither_forgets_nor_stops_listening() -> None:
    with signals_as_interrupt():
        with held():
            signal.raise_signal(signal.SIGINT)
        with signals_as_interrupt():
            assert requested()
        assert requested()
        assert signal.getsignal(signal.SIGHUP) is interruption._hear
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_DFL


def test_another_thread_changes_no_handler() -> None:
    def listen() -> None:
        with signals_as_interrupt():
            assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL

    thread = threading.Thread(target=listen)
    thread.start()
    thread.join()


LOADING = """
import builtins, os, signal, sys
module, number, how = sys.argv[1:]
for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(each, signal.SIG_DFL)
real, hit = builtins.__import__, []
def spy(name, *rest, **more):
    if name == module and not hit:
        hit.append(name)
        try:
            os.kill(os.getpid(), int(number))
        except KeyboardInterrupt:
            if how == "raised":
                raise
            raise ImportError("what some library makes of it") from None
    return real(name, *rest, **more)
builtins.__import__ = spy
from robid_core.commands import main
sys.argv = ["robid", "doctor"]
main()
"""


@pytest.mark.parametrize("number", ALL)
@pytest.mark.parametrize(("module", "how"), [("robid_core.commands.app", "raised"), ("typer", "swallowed")])
def test_the_command_line_listens_before_it_loads_anything(
    module: str, how: str, number: signal.Signals
) -> None:
    command = [sys.executable, "-c", LOADING, module, str(int(number)), how]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


def test_exceptions_that_go_in_circles_end_no_search() -> None:
    first, second = ValueError("first"), KeyError("second")
    first.__context__, second.__context__ = second, first
    assert list(with_contexts(first)) == [first, second]
