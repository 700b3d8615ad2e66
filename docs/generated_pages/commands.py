"""The page of the command line: help, arguments and options of every command, and exit codes, from the code."""

from __future__ import annotations

import inspect

import click
import typer.main

from generated_pages.docstrings import prose
from generated_pages.text import escaped, heading, literal, table
from robid_core import errors
from robid_core.commands.app import COMMANDS, build

OTHER_CODES = {
    0: "done",
    70: "a bug of robid: a report was saved, its path is printed",
    130: "interrupted",
}


def pages() -> dict[str, str]:
    """Return the text of both pages by its path."""
    group = typer.main.get_command(build(list(COMMANDS), debug=False))
    lines = heading("Commands")
    lines += [
        "``robid --help`` lists the commands, ``robid COMMAND --help`` explains one. ``--debug`` shows tracebacks.",
        "",
    ]
    for name in COMMANDS:
        command = group.commands[name]
        lines += heading(f"robid {name}", "-")
        lines += [prose(inspect.cleandoc(command.help or "")), ""]
        context = click.Context(command) if isinstance(command, click.Command) else typer.Context(command)
        rows = []
        for parameter in command.params:
            said = parameter.get_help_record(context) if hasattr(parameter, "get_help_record") else None
            flags, meaning = said if said is not None else (parameter.name, "")
            rows.append((literal(flags), escaped(" ".join(meaning.split()))))
        lines += table(("argument or option", "meaning"), rows, "35 65") if rows else []
    return {"commands.rst": "\n".join(lines), "exit_codes.rst": exit_codes()}


def exit_codes() -> str:
    """Return the page of exit codes: one for each class of errors."""
    classes = [
        kind
        for kind in vars(errors).values()
        if inspect.isclass(kind) and issubclass(kind, errors.RobidError) and kind is not errors.RobidError
    ]
    known: dict[int, list[str]] = {code: [f"{text}"] for code, text in OTHER_CODES.items()}
    for kind in classes:
        known.setdefault(kind.exit_code, []).append(
            f"{literal(kind.__name__)}: {prose(_first_paragraph(kind))}"
        )
    lines = heading("Exit codes")
    lines += [
        "Scripts can tell from the exit code what happened. The message on the screen says what to do.",
        "",
        *table(("code", "meaning"), [(str(c), " ".join(known[c])) for c in sorted(known)], "10 90"),
        "With ``robid run --strict`` one doubt about a fit is enough for exit code 6.",
        "",
        "A message about drives, data or the store begins with the id of its fault: :doc:`/faults`.",
        "",
    ]
    return "\n".join(lines)


def _first_paragraph(kind: type) -> str:
    """Return the first paragraph of a docstring on one line."""
    return " ".join((inspect.getdoc(kind) or "").partition("\n\n")[0].split())
