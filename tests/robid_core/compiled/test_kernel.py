"""Compiled kernels notice when something they call has changed, in another file too."""

from __future__ import annotations

import os
from pathlib import Path

from oracles.quick_start import run

_LAW = """
from robid_core.compiled.kernel import kernel
@kernel
def law(x):
    return {slope} * x
"""
_LOOP = """
from law import law
from robid_core.compiled.kernel import kernel
@kernel
def loop(x):
    return law(x) + 1.0
print(loop(2.0), sum(loop.stats.cache_hits.values()))
"""


def test_a_cached_kernel_is_compiled_again_when_a_law_in_another_file_changes(tmp_path: Path) -> None:
    def answer(slope: float) -> list[str]:
        (tmp_path / "law.py").write_text(_LAW.format(slope=slope))
        (tmp_path / "loop.py").write_text(_LOOP)
        environment = os.environ | {
            "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        return run(["loop.py"], tmp_path, environment, bare=True).stdout.split()

    assert answer(1.0) == ["3.0", "0"]
    assert answer(1.0) == ["3.0", "1"]
    assert answer(4.0) == ["9.0", "0"]
