"""What can go wrong, one class per exit code of the command line.

A message has three parts: where, what, what to do ("acquire: drive 2 sent no feedback for 50 ms after
enable; is its node id 2?"). Exit codes: 0 done, 2 configuration, 3 refused before anything moved, 4 motion
aborted, 5 data rejected, 6 numerics not trustworthy, 7 store or I/O, 8 plugin, 70 a bug of ours, 130
interrupted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

LONGEST = 20_000  # characters of an exception that are shown; lists of mistakes in a file are shorter


class RobidError(Exception):
    """Base of every error that robid raises on purpose; `exit_code` is what the command line returns."""

    exit_code: ClassVar[int] = 70
    warnings: tuple[str, ...] = ()
    """What the stages of a run warned of before it failed, by a stage each."""


class ConfigurationError(RobidError):
    """A pipeline, robot or settings file says something that cannot be done."""

    exit_code = 2


class MotionRefused(RobidError):
    """A check before the motion failed; nothing has moved."""

    exit_code = 3


class MotionAborted(RobidError):
    """The motion was stopped; the message says in which state the machine is."""

    exit_code = 4


class StopNotConfirmed(MotionAborted):
    """Not every motor was seen to stand still after the command to stop; the message names those that were not."""


class DataRejected(RobidError):
    """Measured data are not good enough for what is asked of them."""

    exit_code = 5


class PoorExcitation(DataRejected):
    """The inputs at a line do not span all axes; the message gives the line in Hz and its condition number."""


class NotTrustworthy(RobidError):
    """A computation ended, but its result must not be used."""

    exit_code = 6


class NotIdentifiable(NotTrustworthy):
    """The data do not determine a parameter; the message names it, and `names` where a program asks."""

    def __init__(self, message: str, names: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.names = tuple(names)


class StoreError(RobidError):
    """Reading or writing results failed; the message gives the path."""

    exit_code = 7


class PluginError(RobidError):
    """A plugin failed or broke its contract; the message names the stage, the distribution and its version."""

    exit_code = 8


class ExtraMissing(PluginError):
    """A plugin belongs to an optional extra whose packages are not installed; the message says how to."""


def said_by(error: BaseException) -> str:
    """Return the text of an exception, also of one whose `__str__` fails; the beginning of a very long one."""
    try:
        text = str(error)
    except BaseException as second:
        return f"(its text cannot be shown: {class_of(second)})"
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}... ({len(text)} characters)"


def class_of(error: BaseException) -> str:
    """Return the name of an exception's class, also of one that hides it."""
    try:
        return str(type(error).__name__)
    except BaseException:
        return "an exception whose class cannot be named"


def with_contexts(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an exception and those that were being handled when it was raised, each once: they may go in circles."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        yield error
        seen.add(id(error))
        error = error.__context__
