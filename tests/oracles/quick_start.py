"""Processes of Python in which much is imported already: a fraction of the processor time of Python's start.

A server imports what robid stands on, and robid's pipelines and robots, and forks itself for each process. That has a
folder, variables, a search path and streams of its own and the signals of a process that has just begun, and ends as
Python ends. A bare one has nothing of robid, for tests of what robid does when it is imported. All have the hash seed
of their server: what must not depend on it, as Python's start itself, is tested with Python. Behind a search path of
their own all have that of their server, which is that of the tests: mutated copies of the sources are found by it.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import types
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ROBID = ("-c", "from robid_core.commands import main; main()")
LONGEST = 1 << 18  # bytes of a message
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGCHLD)


class QuickProcess:
    """A process that runs what `python WORDS` would; `["-c", CODE, ...]` or `[FILE, ...]`."""

    def __init__(
        self,
        words: list[str],
        cwd: Path | None = None,
        env: Mapping[str, str] | None = None,
        *,
        bare: bool = False,
    ) -> None:
        environment = dict(os.environ if env is None else env)
        told = {"words": words, "folder": str(cwd or Path.cwd()), "environment": environment}
        self.returncode: int | None = None
        self._streams = os.memfd_create("out"), os.memfd_create("err")
        self._line, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with there:
            given = [there.fileno(), *self._streams]
            socket.send_fds(server(bare), [json.dumps(told).encode()], given)
        self.pid = int(self._line.recv(64))

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end and return its exit code, negative where a signal ended it."""
        if self.returncode is None:
            self._line.settimeout(timeout)
            self.returncode = int(self._line.recv(64))
            self._line.close()
        return self.returncode

    def poll(self) -> int | None:
        """Return the exit code where it has ended."""
        with contextlib.suppress(BlockingIOError):
            return self.wait(timeout=0)
        return None

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Wait for its end and return what it wrote to its two streams."""
        self.wait(timeout)
        written = []
        for stream in self._streams:
            with os.fdopen(stream, "rb") as file:
                file.seek(0)
                written.append(file.read().decode())
        return written[0], written[1]


def run(
    words: list[str], cwd: Path | None = None, env: Mapping[str, str] | None = None, *, bare: bool = False
) -> subprocess.CompletedProcess[str]:
    """Run a process to its end."""
    process = QuickProcess(words, cwd, env, bare=bare)
    out, err = process.communicate()
    assert process.returncode is not None
    return subprocess.CompletedProcess(words, process.returncode, out, err)


@functools.cache
def server(bare: bool) -> socket.socket:
    """Start a server of this process; return the line to it, with whose end it ends."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    process = subprocess.Popen(
        [sys.executable, "-P", __file__, str(there.fileno()), *["bare"] * bare],
        pass_fds=[there.fileno()],
        stdin=subprocess.DEVNULL,
        start_new_session=True,
    )
    there.close()

    @atexit.register
    def end() -> None:
        here.close()
        process.wait()

    return here


# In the server --------------------------------------------------------------------------------------------------


def load(bare: bool) -> None:
    """Import what robid stands on, and what numba imports when it compiles something first; and robid.

    Nothing of `robid_core.run`: the process that imports that owns the server of the run's stages.
    """
    import numba
    import typer  # noqa: F401

    numba.njit(lambda x: x + 1.0)(1.0)
    if not bare:
        import robid_core.commands.app
        import robid_core.pipeline  # noqa: F401


def serve(line: socket.socket) -> dict[str, Any] | None:
    """Fork for each request; return what to do in the fork, and None at the end in the server."""
    while True:
        message, given, _, _ = socket.recv_fds(line, LONGEST, 3)
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        if not message:
            return None
        if not os.fork():
            line.close()
            back = socket.socket(fileno=given[0])
            pid = os.fork()
            if not pid:
                back.close()
                for number, stream in enumerate(given[1:], start=1):
                    os.dup2(stream, number)
                    os.close(stream)
                told: dict[str, Any] = json.loads(message)
                return told
            back.send(str(pid).encode())
            code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
            with contextlib.suppress(OSError):  # nobody asks any more
                back.send(str(code).encode())
            os._exit(0)
        for descriptor in given:
            os.close(descriptor)


def begin(words: list[str], folder: str, environment: dict[str, str]) -> tuple[str, str]:
    """Make this process one that has just begun in a folder; return its code and the name of its file."""
    from numba.core import config

    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    time.tzset()
    tempfile.tempdir = None  # is looked up anew
    config.reload_config()
    sys.dont_write_bytecode = bool(environment.get("PYTHONDONTWRITEBYTECODE"))
    typed = words[0] == "-c"
    sys.argv = ["-c", *words[2:]] if typed else words
    first = "" if typed else str(Path(words[0]).resolve().parent)
    sys.path[:0] = [first, *filter(None, environment.get("PYTHONPATH", "").split(os.pathsep))]
    return (words[1], "<string>") if typed else (Path(words[0]).read_text(encoding="utf-8"), words[0])


def main() -> None:
    """Serve; in a fork, do what was asked for as the main module, as Python would."""
    load(bare=len(sys.argv) > 2)
    line = socket.socket(fileno=int(sys.argv[1]))
    told = serve(line)
    if told is None:
        while True:
            try:
                os.wait()
            except ChildProcessError:
                return
    code, file = begin(**told)
    module = types.ModuleType("__main__")
    if file != "<string>":
        module.__file__ = file
    sys.modules["__main__"] = module
    exec(compile(code, file, "exec", dont_inherit=True), module.__dict__)


if __name__ == "__main__":
    main()
