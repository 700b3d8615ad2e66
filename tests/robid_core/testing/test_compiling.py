"""What a check compiles in a second process: calls that exist and work, none where the code is on disk."""

from __future__ import annotations

import subprocess
import sys

import pytest

import robid_core.testing.compiling as c


def test_the_second_process_compiles_what_it_is_for() -> None:
    ran = subprocess.run([sys.executable, "-c", c._CALLS], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert c.kept_codes(c.run_prescribed)


def test_it_is_started_where_nothing_is_on_disk_and_ends_with_the_check(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    started: list[subprocess.Popen[bytes]] = []

    class Waiting(subprocess.Popen):  # type: ignore[type-arg]
        def __init__(self, arguments: list[str], **more: object) -> None:
            super().__init__([arguments[0], "-c", "import time; time.sleep(60)"], **more)  # type: ignore[call-overload]
            started.append(self)

    monkeypatch.setattr(c.subprocess, "Popen", Waiting)
    with c.compiled_beside():
        pass
    assert started == []
    monkeypatch.setattr(c, "kept_codes", lambda _: 0)
    with c.compiled_beside():
        assert started[0].poll() is None
    assert started[0].returncode < 0  # killed
