"""What a person sees when a command fails, and with which exit code it ends."""

from __future__ import annotations

import functools
import os
import platform
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

import typer

from robid_core import __version__
from robid_core.commands import INTERRUPTED
from robid_core.errors import (
    ConfigurationError,
    PluginError,
    RobidError,
    StopNotConfirmed,
    StoreError,
    said_by,
)
from robid_core.interruption import interrupted_told

P = ParamSpec("P")
R = TypeVar("R")

BUG = 70
LONGEST_NAME = 200  # of a file in a message


def guarded(function: Callable[P, R], debug: bool) -> Callable[P, R]:
    """Return the function with every error turned into a message and an exit code."""

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except RobidError as error:
            if debug:
                traceback.print_exc()
            else:
                _say(said_by(error))
            if isinstance(error, StopNotConfirmed) and sys.stderr.isatty():
                _say("\a" * 3)  # a person at the robot may look elsewhere
            raise SystemExit(error.exit_code) from error
        except KeyboardInterrupt as error:
            if debug:
                traceback.print_exc()
            _say(interrupted_told())
            raise SystemExit(INTERRUPTED) from error
        except MemoryError as error:
            if debug:
                traceback.print_exc()
            _say(
                f"not enough memory: {said_by(error) or 'none is left, or a limit is set (ulimit -v)'}; ask for less: "
                "a shorter period, fewer lines or blocks"
            )
            raise SystemExit(ConfigurationError.exit_code) from error
        except Exception as error:
            if _meant_for_typer(error):
                raise
            refused = error if isinstance(error, OSError) and error.errno else None
            if debug:
                traceback.print_exc()
            elif refused is not None:
                _say(_refusal_of_the_system(refused))
            else:
                _say(_bug_message(error))
            raise SystemExit(BUG if refused is None else StoreError.exit_code) from error
        except BaseException as error:  # SystemExit and the like, which nothing of robid raises here
            if debug:
                traceback.print_exc()
            _say(_ended_message(error))
            raise SystemExit(PluginError.exit_code) from error

    return call


def _meant_for_typer(error: Exception) -> bool:
    """Tell whether the parser of the command line handles this: its own exceptions, and a closed pipe."""
    own = isinstance(error, typer.Exit | typer.Abort) or hasattr(error, "show")
    return own or isinstance(error, BrokenPipeError)


def _refusal_of_the_system(error: OSError) -> str:
    try:
        Path.cwd()
    except FileNotFoundError:
        return "the current folder is gone; go to one that exists and run the same command there"
    name = str(error.filename or "")
    where = f"{name[:LONGEST_NAME]}{'...' if len(name) > LONGEST_NAME else ''}: " if name else ""
    return f"{where}{os.strerror(error.errno or 0)}; the system refuses it; --debug shows where"


def _bug_message(error: Exception) -> str:
    first = f"robid failed, and this is not your mistake: {type(error).__name__}: {said_by(error)}"
    try:
        place = f"a report is in {_save_report()}"
    except OSError as refused:
        place = f"no report could be saved ({refused})"
    return f"{first}\n{place}; the same command with --debug shows the traceback"


def _ended_message(error: BaseException) -> str:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return (
        f"R09: {frame.filename}:{frame.lineno}, in {frame.name}, raised {type(error).__name__}, which ends Python and "
        "which no plugin may; what was finished before is kept; tell the author of the plugin"
    )


def _save_report() -> Path:
    """Write the traceback, the command and the versions where anyone may write; nothing of the data."""
    handle, name = tempfile.mkstemp(prefix="robid-report-", suffix=".txt", text=True)
    lines = [
        f"robid {__version__}, Python {platform.python_version()}, {platform.platform()}",
        f"command: {' '.join(sys.argv)}",
        f"folder: {Path.cwd()}",
        "",
        traceback.format_exc(),
    ]
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write("\n".join(lines))
    return Path(name)


def _say(text: str) -> None:
    typer.echo(text, err=True)
