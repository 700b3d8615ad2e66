"""Compiled kernels notice when something they call has changed, in another file too; compiling leaves no trace."""

from __future__ import annotations

import gc
import os
from pathlib import Path
from typing import Any

import numba
import pytest
from numba.core import event
from oracles.quick_start import run

from robid_core.compiled.kernel import kernel

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


@pytest.mark.parametrize("enabled", [True, False])
def test_the_garbage_collector_rests_while_a_kernel_is_compiled(enabled: bool) -> None:
    seen = list[bool]()

    class Looking(event.Listener):  # type: ignore[misc]  # numba has no types
        def on_start(self, event: Any) -> None:
            seen.append(gc.isenabled())

        def on_end(self, event: Any) -> None:
            pass

    def inner(x):  # type: ignore[no-untyped-def]
        return 2.0 * x

    compiled = kernel(inner)

    def outer(x):  # type: ignore[no-untyped-def]
        return compiled(x) + 1.0

    looking, before = Looking(), gc.isenabled()
    event.register("numba:compile", looking)
    try:
        gc.enable() if enabled else gc.disable()
        assert numba.njit(outer)(1.0) == 3.0
        assert gc.isenabled() is enabled
    finally:
        event.unregister("numba:compile", looking)
        gc.enable() if before else gc.disable()
    assert seen
    assert not any(seen)  # the outer one, and the one inside where it is not on disk
