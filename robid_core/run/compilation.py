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

_CHAINS: tuple[tuple[Callable[[], object], ...], ...] = (
    (WARM_UP["simulation of eight experiments at once"], WARM_UP["torque of a prescribed motion"]),
    (WARM_UP["linear models"], WARM_UP["simulation of one experiment"]),
    (lambda: eigen(np.eye(2, dtype=np.complex128)[None], 1e6),),
)
"""Groups of kernels, each compiled by one process, one call after the other: a call finds what those before compiled.

Eight experiments at once and prescribed motions share their recursions on lanes, linear models and one experiment
theirs on numbers; across the chains only small functions are compiled twice.
"""
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
    total = len(_CHAINS)
    tell = note if note is not None else _say_nothing
    with process_executor(jobs) as tasks:
        text = f"compiling kernels, once, on {_processors(tasks, total)}"
        tell(0, total, text)
        for done, _ in enumerate(tasks.stream(_compile, [(chain,) for chain in range(total)]), start=1):
            tell(done, total, text)


def _compile(chain: int) -> None:
    for call in _CHAINS[chain]:
        call()


def _processors(tasks: ProcessMap, most: int) -> str:
    return "one processor" if tasks.jobs == 1 else f"{min(tasks.jobs, most)} processors"


def _say_nothing(_done: int, _total: int, _text: str) -> None:
    """Take a note and keep quiet."""
