"""The commands by name, each imported only when the command line mentions it.

Every file `robid_core/commands/<name>.py` defines a function `command` with typer's annotations; its docstring
is the help. Here stand the one-line summaries, so that `robid --help` imports nothing but typer.
"""

from __future__ import annotations

import os
import resource
from collections.abc import Callable
from importlib import import_module
from typing import Annotated, Any

import typer

from robid_core import __version__
from robid_core.commands.failures import guarded
from robid_core.errors import StoreError

COMMANDS = {
    "run": "Run a pipeline: what is up to date is kept, the rest is made.",
    "plan": "Show who feeds whom, and how long the robot will move.",
    "validate": "Check a pipeline file and report all its mistakes.",
    "stages": "List the plugins, effects included, or explain one: settings, meaning, YAML to paste.",
    "diagnose": "Find what a robot's simulation gets wrong, from records of its motion.",
    "show": "Show a result readably.",
    "diff": "Compare two runs: settings, versions, results.",
    "adopt": "Put what a fit found into the robot file.",
    "init": "Make a new project from a template, or around the URDF of your robot.",
    "export": "Write a robot for other programs: URDF, MJCF, state space, table of parameters.",
    "records": "Say what a recording holds, or recover a cut one.",
    "doctor": "Check the installation, or look for implausible numbers in a robot.",
    "schema": "Print the JSON schema of pipeline files, or of robot files, for editors.",
}
LEAST_MEMORY = 2**30
"""Bytes of address space: the least with which one small axis was fitted are 750 MB, with 550 MB runs hung."""
_HELP = (
    "Find what a robot's simulation gets wrong: from excitation to frequency responses, stiffness and report."
)
_EXIT_CODES = (
    "Exit codes: 0 done, 2 a pipeline, robot file or option, 3 motion refused, 4 motion stopped, 5 data rejected, "
    "6 a result that must not be used, 7 a file could not be read or written, 8 a plugin, 70 a bug of robid, "
    "130 interrupted."
)


def build(words: list[str], debug: bool) -> typer.Typer:
    """Return the command line; a command whose name is not among `words` is known by its summary only."""
    app = typer.Typer(name="robid", help=_HELP, no_args_is_help=True, rich_markup_mode=None)
    app.pretty_exceptions_enable = False
    app.callback(context_settings={"help_option_names": ["-h", "--help"]}, epilog=_EXIT_CODES)(_options)
    for name, summary in COMMANDS.items():
        function = import_module(f"robid_core.commands.{name}").command if name in words else _unused
        help_text = None if name in words else summary
        app.command(name, help=help_text, short_help=summary)(guarded(function, debug))
    return app


def command_line(arguments: list[str]) -> None:
    """Run the command line; ends with SystemExit."""
    debug = "--debug" in arguments
    arguments = [word for word in arguments if word != "--debug"]
    # A shell that completes gives the line in the environment and runs without arguments.
    line = os.environ.get("_TYPER_COMPLETE_ARGS", "") + " " + os.environ.get("COMP_WORDS", "")
    words = arguments + line.split()
    guarded(ask_room, debug)()
    load = guarded(build, debug)
    load(words, debug)(args=arguments, prog_name="robid")


def ask_room() -> None:
    """Refuse a limit of memory with which libraries end Python, or do not come back.

    Raises
    ------
    StoreError
        That says how much there is and how much it takes.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < LEAST_MEMORY:
        raise StoreError(
            f"memory is limited to {limit / 2**20:.0f} MB (ulimit -v), and robid asks for at least "
            f"{LEAST_MEMORY / 2**20:.0f} MB, most of it for libraries; raise the limit and run again"
        )


def _unused() -> None:
    raise AssertionError("a command that was not on the command line")


def _version(value: bool) -> None:
    if value:
        typer.echo(f"robid {__version__}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show tracebacks; works with every command.")
    ] = False,
) -> None:
    del version, debug


Command = Callable[..., Any]
