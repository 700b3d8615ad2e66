"""Compiles what simulations need before the first of them, on all processors, and says so.

What stays on disk serves all installations of a user that have the same sources; nothing is done where it is there.
What a simulation does not need is compiled when it is called.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from robid_core.compiled.machine_code import kept_codes
from robid_core.estimation.response.eigen import eigen
from robid_core.executors import ProcessMap, process_executor
from robid_core.mechanics import WARM_UP
from robid_core.mechanics.closed_loop import run_blocks

_Chain = tuple[Callable[[], object], ...]
_WAVES: tuple[tuple[_Chain, ...], ...] = (
    ((WARM_UP["positions at rest"],), (lambda: eigen(np.eye(2, dtype=np.complex128)[None], 1e6),)),
    (
        (WARM_UP["simulation of eight experiments at once"], WARM_UP["torque of a prescribed motion"]),
        (WARM_UP["simulation of one experiment"], WARM_UP["linear models"]),
    ),
)
"""Groups of kernels: chains of a wave beside one another, each in one process, its calls one after the other.

What the second wave has in common is compiled in the first, and eight experiments at once share their recursion with
prescribed motions: across chains only small functions are compiled twice.
"""
_SECONDS = "15 to 40 s"  # on two idle cores, and on one or a busy machine
_WIDTHS = 2
"""Codes that the simulator's outermost loop has: for one experiment and for eight at once."""


def compile_ahead(
    note: Callable[[int, int, str], None] | None = None,
    jobs: int = 0,
    say: Callable[[str], None] | None = None,
) -> None:
    """Compile the kernels of simulations, unless they are on disk.

    Parameters
    ----------
    note
        Told how many groups of kernels are compiled, of how many, and what is waited for.
    jobs
        Processes; 0 takes as many as there are processors.
    say
        Told once when it begins, which a log shows at once, and once how long it took.
    """
    if kept_codes(run_blocks) >= _WIDTHS:
        return
    total, done = sum(map(len, _WAVES)), 0
    tell = note if note is not None else _say_nothing
    with process_executor(jobs) as tasks:
        text = f"compiling kernels, once, on {_processors(tasks, max(map(len, _WAVES)))}"
        if say is not None:
            say(f"{text}: {_SECONDS}; later runs on this machine load them from disk")
        began = time.perf_counter()
        tell(done, total, text)
        for wave, chains in enumerate(_WAVES):
            for _ in tasks.stream(_compile, [(wave, chain) for chain in range(len(chains))]):
                done += 1
                tell(done, total, text)
    if say is not None:
        say(f"kernels compiled in {time.perf_counter() - began:.1f} s")


def _compile(wave: int, chain: int) -> None:
    for call in _WAVES[wave][chain]:
        call()


def _processors(tasks: ProcessMap, most: int) -> str:
    return "one processor" if tasks.jobs == 1 else f"{min(tasks.jobs, most)} processors"


def _say_nothing(_done: int, _total: int, _text: str) -> None:
    """Take a note and keep quiet."""
