"""What plugins of third parties do while a pipeline is read or planned, in a copy of this process.

Settings, checks and `plan_lines` of a plugin are its author's code, as its stages are: one that crashes or calls
`os._exit` there ended the command without a word, `os._exit(0)` as if all were well. A fork of the command costs
milliseconds, and only where a plugin of a third party is named; what it returns or raises comes back through a pipe.
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Collection
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeVar

from robid_core.errors import PluginError
from robid_core.executors.task import surviving
from robid_core.interruption import may_be_requested
from robid_core.registry import GROUPS, Plugin, registry
from robid_core.run.confined_stage import last_frame
from robid_core.store import failures_named

R = TypeVar("R")


def foreign_plugins(file: Path) -> list[Plugin]:
    """Return the plugins of third parties whose names stand in a file; none where it cannot be read."""
    try:
        if not file.is_file():
            return []
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    found = [plugin for group in GROUPS for plugin in registry().plugins(group) if plugin.is_foreign]
    return [plugin for plugin in found if plugin.name in text]


def in_a_copy(action: Callable[[], R], plugins: Collection[Plugin], doing: str) -> R:
    """Return what an action gives in a copy of this process, or raise what it raises.

    Raises PluginError where the copy ended without either: the code of one of the plugins ended or crashed it.
    """
    if not plugins:
        return action()
    with failures_named("read plugins of third parties in a copy of this process", None):
        here, there = multiprocessing.Pipe(duplex=False)
        crash = os.memfd_create("robid-crash")  # a file on no disk, which may be full or read-only
        sys.stdout.flush()
        sys.stderr.flush()
        pid = os.fork()
    if not pid:
        here.close()
        _work(action, there, crash)
    there.close()
    status = 0
    try:
        kind, value = here.recv()
    except EOFError:
        kind, value = "nothing", None
    except BaseException:
        os.kill(pid, signal.SIGKILL)
        raise
    finally:
        here.close()
        status = os.waitpid(pid, 0)[1]
        last = last_frame(Path(f"/proc/self/fd/{crash}"))
        os.close(crash)
    if kind == "nothing":
        raise PluginError(_how_it_ended(os.waitstatus_to_exitcode(status), plugins, doing, last))
    if kind == "streams":
        raise PluginError(_blamed("closed or replaced a standard stream (file 0, 1 or 2)", plugins, doing))
    if kind == "error":
        if isinstance(value, Exception) or (isinstance(value, KeyboardInterrupt) and may_be_requested()):
            raise value
        how = f"raised {type(value).__name__}, which no plugin may"
        raise PluginError(_blamed(how, plugins, doing)) from value
    result: R = value
    return result


def _work(action: Callable[[], object], there: Connection, crash: int) -> None:
    """Do it in the copy, tell, and end without what the original still has to do."""
    faulthandler.enable(crash, all_threads=False)
    streams = _standard_files()
    try:
        message = "result", action()
    except BaseException as error:
        message = "error", surviving(error)
    if _standard_files() != streams:  # the command would go on without a word
        message = "streams", None
    try:
        sys.stdout.flush()
        sys.stderr.flush()
        there.send(message)
    except Exception:  # nobody listens any more, or the plugin took streams that are not its own
        os._exit(1)
    os._exit(0)


def _standard_files() -> list[tuple[int, int] | None]:
    """Return device and inode of each of the three standard files, None for one that is closed."""
    found: list[tuple[int, int] | None] = []
    for number in range(3):
        try:
            status = os.fstat(number)
        except OSError:
            found.append(None)
        else:
            found.append((status.st_dev, status.st_ino))
    return found


def loaded_apart(plugin: Plugin, action: Callable[[Any], R]) -> R:
    """Return what an action makes of what a plugin registers; that of a third party is imported in a copy only."""
    foreign = [plugin] if plugin.is_foreign else []
    return in_a_copy(lambda: action(plugin.load()), foreign, f"{plugin.name} was imported")


def _how_it_ended(code: int, plugins: Collection[Plugin], doing: str, place: str) -> str:
    if code < 0:
        how = f"crashed with {signal.Signals(-code).name}{place}"
    else:
        how = f"ended the process with exit code {code}, which no plugin may"
    return _blamed(how, plugins, doing)


def _blamed(how: str, plugins: Collection[Plugin], doing: str) -> str:
    whose = " or of ".join(sorted({f"{plugin.distribution} {plugin.version}" for plugin in plugins}))
    return f"R09: while {doing}, the code of {whose} {how}; nothing was done; tell the author of the plugin"
