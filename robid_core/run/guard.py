"""What is asked of a stage's code: errors that name it, and a result of the promised type.

Plugins are trusted code; this is no sandbox. An error of ours passes with the stage's name before it, any
other becomes a PluginError with three lines of cause, and the whole trace goes to the log.
"""

from __future__ import annotations

import contextlib
import logging
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robid_core.artifacts import Artifact
from robid_core.artifacts.soundness import unsound
from robid_core.errors import PluginError, RobidError, class_of, said_by
from robid_core.executors.task import StandIn
from robid_core.interruption import may_be_requested
from robid_core.pipeline import StageNode
from robid_core.stage import Stage
from robid_core.store import OF_THE_MACHINE, failures_named

OUR_CODES = range(2, 9)  # of the kinds of errors; no plugin's error is a success, or a mistake of robid
NO_MEMORY = "not enough memory; ask for fewer configurations, blocks or periods, or for a shorter period"
LONGEST_LINE = 1000  # characters of what a plugin says of its failure; the log has all


@contextlib.contextmanager
def named_errors(node: StageNode, log: logging.Logger, log_path: Path) -> Iterator[None]:
    """Let an error say which stage and plugin it comes from."""
    try:
        yield
    except BaseException as error:  # SystemExit too, and what libraries cancel or skip with
        if isinstance(error, KeyboardInterrupt) and may_be_requested():
            raise
        if isinstance(error, RobidError) and not isinstance(error, StandIn) and error.exit_code in OUR_CODES:
            text = said_by(error)
            log.error("stage %s: %s", node.name, text, exc_info=True)
            if not text:
                place = _where(error, _package(node))
                text = f"{node.plugin} raised {class_of(error)} without a message\n  {place}\n  full trace: {log_path}"
            if not text.startswith((f"{node.name}:", f"stage {node.name}:")):
                error.args = (f"stage {node.name}: {text}",)
            raise
        log.error("stage %s: %s failed", node.name, node.plugin, exc_info=True)
        if isinstance(error, OSError) and error.errno in OF_THE_MACHINE:
            named = ", with" if error.filename else ""
            file = Path(error.filename) if error.filename else None
            with failures_named(f"run stage {node.name}, {node.plugin}{named}", file, needed=None):
                raise
        raise PluginError(
            f"stage {node.name}: {node.plugin} failed: {_first_line(error)}\n"
            f"  {_where(error, _package(node))}\n"
            f"  full trace: {log_path}"
        ) from error


def _package(node: StageNode) -> str:
    return node.plugin.target.partition(":")[0].partition(".")[0]


def _first_line(error: BaseException) -> str:
    what = NO_MEMORY if isinstance(error, MemoryError) else said_by(error).partition("\n")[0]
    if len(what) > LONGEST_LINE:
        what = f"{what[:LONGEST_LINE]}..."
    if isinstance(error, StandIn):
        return what
    return f"{class_of(error)}: {what}" if what else class_of(error)


def _where(error: BaseException, package: str) -> str:
    """Return the last line of the plugin's own code that the error went through."""
    told = object.__getattribute__(error, "__dict__").get("robid_frames")  # its class may answer by an error
    frames = told or traceback.extract_tb(object.__getattribute__(error, "__traceback__"))
    own = [f for f in frames if f"/{package}/" in f.filename or f.filename.endswith(f"/{package}.py")]
    if not frames:
        return "the trace is empty"
    last = (own or frames)[-1]
    return f"{last.filename}:{last.lineno}, in {last.name}: {last.line or ''}".rstrip(": ")


def checked_result(name: str, plugin: object, stage: Stage, result: Any) -> Artifact:
    """Return a stage's result; PluginError where it is not of the type its kind promises, or unsound (R12)."""
    promised = stage.output
    if not isinstance(result, promised):
        raise PluginError(
            f"stage {name}: R12: {plugin} returned {_a(type(result).__name__)}, but its kind "
            f"'{stage.kind}' promises {_a(promised.__name__)}; nothing was stored"
        )
    if not _found_again(type(result)) or result.suffix != promised.suffix:
        raise PluginError(
            f"stage {name}: R12: {plugin} returned {_a(type(result).__name__)}, a class that nobody could read back: "
            f"it must stand at the top of a module, and its files end in '{promised.suffix}'; nothing was stored"
        )
    problem = next(unsound(result), "")
    if problem:
        raise PluginError(
            f"stage {name}: R12: {plugin} gave a result that cannot be: {problem}; nothing was stored"
        )
    return result


def _found_again(kind: type[Artifact]) -> bool:
    """Tell whether another process finds a class by its name."""
    return getattr(sys.modules.get(kind.__module__), kind.__qualname__, None) is kind


def _a(noun: str) -> str:
    return f"an {noun}" if noun[:1].lower() in set("aeiou") else f"a {noun}"
