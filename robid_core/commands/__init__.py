"""The command line: one file per command, imported when it is called; only these modules print.

`main` is the console script. A mistake of the user is a message and an exit code (`robid_core.errors`), never a
traceback; `--debug` shows it. A mistake of ours is saved as a report, whose place is told.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    from robid_core.commands.app import command_line

    command_line(list(sys.argv[1:] if arguments is None else arguments))
