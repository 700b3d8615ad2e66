"""Processes of stages that need not import robid anew: a server imports it once and forks itself for each.

The server is multiprocessing's: it runs no code of third parties, ends with the run, and gives each stage the state of
a process that has just begun. It starts with the signals of a run blocked, so Ctrl-C at a terminal reaches the run and
its stages, and not the server.
"""

from __future__ import annotations

import multiprocessing
import os
from multiprocessing.context import ForkServerContext, SpawnContext

_IMPORTED = ["robid_core.run.preloaded"]
_OWNER = os.getpid()


def process_context() -> ForkServerContext | SpawnContext:
    """Return what starts the process of a stage.

    A process that was forked from one that has a server cannot use it, and starts Python anew for each stage.
    """
    if os.getpid() != _OWNER:
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_IMPORTED)
    return context
