"""Results of a map in the order of its arguments while they come, few at a time: for work larger than the memory.

An executor may have a method `stream(function, arguments)` beside being called: arguments are asked for when there is
room for another task, results are handed on as soon as it is their turn. One that has not is called with a few
tasks at a time.
"""

from __future__ import annotations

import inspect
import itertools
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

PORTION = 16  # tasks at a time for an executor that can only be called: nobody is idle for long


def stream(
    tasks: Callable[..., list[Any]], function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]
) -> Generator[Any]:
    """Yield ``function(*argument)`` for every argument, in order, computed wherever the map `tasks` computes.

    Leaving the iterator early gives up what is still to be computed.
    """
    own = getattr(tasks, "stream", None)
    if own is not None:
        yield from own(function, arguments)
        return
    # a plain function computes one after another anyway
    portion = 1 if inspect.isfunction(tasks) else PORTION
    rest = iter(arguments)
    while some := list(itertools.islice(rest, portion)):
        yield from tasks(function, some)


def stream_threads(
    n_thread: int, function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]
) -> Generator[Any]:
    """Yield results as `stream`, from threads of this process: for compiled work without the interpreter's lock."""
    if n_thread <= 1:
        for argument in arguments:
            yield function(*argument)
        return
    waiting: deque[Future[Any]] = deque()
    with ThreadPoolExecutor(n_thread) as pool:
        try:
            for argument in arguments:
                waiting.append(pool.submit(function, *argument))
                if len(waiting) > n_thread:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()
