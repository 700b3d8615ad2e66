"""Compiles what simulations need before the first of them, on all processors, and says so.

What stays on disk serves all installations of a user that have the same sources; nothing is done where it is there.
What a simulation does not need is compiled when it is called.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robid_core.compiled.machine_code import kept_codes
from robid_core.estimation.response.eigen import eigen
from robid_core.executors import ProcessMap, process_executor
from robid_core.mechanics import WARM_UP
from robid_core.mechanics.closed_loop import run_blocks

_PARTS: dict[str, Callable[[], object]] = {
    **WARM_UP,
    "eigenvectors": lambda: eigen(np.eye(2, dtype=np.complex128)[None], 1e6),
}
_WIDTHS = 2
"""Codes that the simulator's outermost loop has: for one experiment and for eight at once."""


def compile_ahead(note: Callable[[int, int, str], None] | None = None, jobs: int = 0) -> None:
    """Compile the kernels of simulations, unless they are on disk.

    Parameters
    ----------
    note
        Told how many groups of kernels are compiled, of how many, and what is waited for.
    jobs
        Processes; 0 takes as many as there are processors.
    """
    if kept_codes(run_blocks) >= _WIDTHS:
        return
    names = list(_PARTS)
    tell = note if note is not None else _say_nothing
    with process_executor(jobs) as tasks:
        text = f"compiling kernels, once, on {_processors(tasks, len(names))}"
        tell(0, len(names), text)
        for done, _ in enumerate(tasks.stream(_compile, [(name,) for name in names]), start=1):
            tell(done, len(names), text)


def _compile(name: str) -> None:
    _PARTS[name]()


def _processors(tasks: ProcessMap, most: int) -> str:
    return "one processor" if tasks.jobs == 1 else f"{min(tasks.jobs, most)} processors"


def _say_nothing(_done: int, _total: int, _text: str) -> None:
    """Take a note and keep quiet."""
