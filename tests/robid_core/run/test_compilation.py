"""Kernels are compiled before the first simulation, said so, and nowhere else."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

_SMALL = "from robid_core.compiled.kernel import kernel\n\n\n@kernel\ndef plus(x):\n    return x + 1.0\n"
_AHEAD = """
import robid_core.run.compilation as c
def part():
    import small
    small.plus(1.0)
c._WAVES = (((part,),),)
if __name__ == "__main__":
    c.compile_ahead(lambda done, total, text: print(done, total, text))
"""
_TOLD = """
from robid_core.compiled.telling import compilation_told
import small
with compilation_told(print):
    small.plus(1.0)
"""


def said(script: Path, text: str, cache: Path) -> list[str]:
    script.write_text(text)
    small = script.with_name("small.py")
    if not small.exists():
        small.write_text(_SMALL)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def test_what_is_compiled_ahead_is_told_and_found_by_the_next_process(tmp_path: Path) -> None:
    told = said(tmp_path / "ahead.py", _AHEAD, tmp_path / "cache")
    assert [line.split(" ", 2)[:2] for line in told] == [["0", "1"], ["1", "1"]]
    assert "compiling kernels, once" in told[0]
    assert said(tmp_path / "told.py", _TOLD, tmp_path / "cache") == [], "nothing is left to compile"


def test_the_first_kernel_that_is_not_on_disk_is_told_before_it_is_compiled(tmp_path: Path) -> None:
    told = said(tmp_path / "told.py", _TOLD, tmp_path / "cache")
    assert len(told) == 1
    assert said(tmp_path / "told.py", _TOLD, tmp_path / "cache") == []


@pytest.mark.usefixtures("monkeypatch")
def test_nothing_is_done_where_the_simulator_is_on_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    from robid_core.run import compilation

    monkeypatch.setattr(compilation, "kept_codes", lambda _: 2)
    monkeypatch.setattr(compilation, "process_executor", lambda _: pytest.fail("work is given out"))
    compilation.compile_ahead()
