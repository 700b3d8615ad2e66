"""The command line: one file per command, imported when it is called; only these modules print.

`main` is the console script. A mistake of the user is a message and an exit code (`robid_core.errors`), never a
traceback; `--debug` shows it. A mistake of ours is saved as a report, whose place is told. Signals are listened to
before anything else is loaded.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from robid_core.interruption import interrupted_told, no_longer, requested, settled, signals_as_interrupt
from robid_core.standard_streams import lost_on_the_way, never_failing, open_closed_streams

INTERRUPTED = 130
UNDELIVERED = 7  # as whatever cannot be written
MOTION_ABORTED = 4  # says more than that the run was interrupted


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    if arguments is None:
        open_closed_streams()
        never_failing("stdout", matters=True)
        never_failing("stderr")
    with signals_as_interrupt():
        code = _exit_code(arguments) or _undelivered()
        if arguments is None:  # what comes now comes too late
            no_longer()
    sys.exit(code)


def _undelivered() -> int:
    """Return the exit code of a command whose words did not arrive, 0 where they did."""
    error = lost_on_the_way("stdout")
    if error is None:
        return 0
    sys.stderr.write(
        f"R03: what was to be printed could not be written ({error.strerror}); the rest is done\n"
    )
    return UNDELIVERED


def _exit_code(arguments: Sequence[str] | None) -> str | int | None:
    """Run the command line; who was told to stop ends as interrupted, also where somebody swallowed that."""
    code: str | int | None = None
    try:
        from robid_core.commands.app import command_line

        command_line(list(sys.argv[1:] if arguments is None else arguments))
    except SystemExit as end:
        settled()
        code = end.code
    except KeyboardInterrupt:
        settled()
    except Exception:
        settled()
        if not requested():  # an import that is interrupted fails in many ways
            raise
    if requested() and code not in (INTERRUPTED, MOTION_ABORTED):
        sys.stderr.write(f"{interrupted_told()}\n")
        code = INTERRUPTED
    return code
