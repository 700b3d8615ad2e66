"""Hash of everything that decides what a compiled function computes: by it machine code is kept and found again.

Numba looks at the file of the outermost function only. After an edit in another file, the machine code that it kept
would return the numbers of before, silently.
"""

from __future__ import annotations

import functools
import hashlib
import platform
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.extending import is_jitted

_COMPILER = f"numba {numba.__version__} {llvmlite.__version__} {np.__version__} {sys.version_info} {platform.machine()}"
_TYPES = ("lanes.py", "views.py", "functions.py", "content.py")
"""Files beside this one whose types and overloads kernels are compiled with: no function names them."""
_OTHERS = ("numpy", "math", "numba")

_known: dict[FunctionType, str] = {}


def keep_hash(function: FunctionType) -> str:
    """Hash of a function that stands as it is from now on; functions that call it take this one for its content."""
    _known[function] = content_hash(function)
    return _known[function]


def content_hash(function: FunctionType) -> str:
    """Hash of everything that decides what a function computes: sources, code, constants, compiler.

    Reaches through functions that are called, compiled or not, in other files too. The code as Python has it counts
    besides its source: a file may have been edited since it was imported, and what is compiled then is the code.
    """
    digest = hashlib.sha256(_COMPILER.encode())
    texts = {name: _file_hash(str(Path(__file__).with_name(name))) for name in _TYPES}
    constants: list[str] = []
    for python in _walk(function, through_known=False):
        name = python.__qualname__
        if python in _known and python is not function:
            constants.append(f"{name} {_known[python]}")
            continue
        texts.setdefault(*_text(python))
        constants.append(f"{name} {_code(python.__code__)}")
        constants += [f"{name}.{constant}" for constant in _constants(python)]
    digest.update("\n".join((*sorted(set(texts.values())), *sorted(constants))).encode())
    return digest.hexdigest()


def reached(law: Any) -> list[Any]:
    """Return a compiled function and every compiled function that it calls, directly or through others."""
    found = {law.py_func: law}
    for python in _walk(law.py_func, through_known=True):
        found |= {thing.py_func: thing for _, thing in _named(python) if is_jitted(thing)}
    return list(found.values())


def _walk(function: FunctionType, *, through_known: bool) -> Iterator[FunctionType]:
    """Go through a function and every compiled function that it calls, each once; Python's own only by name."""
    met, waiting = {function}, [function]
    while waiting:
        python = waiting.pop()
        yield python
        if python in _known and python is not function and not through_known:
            continue
        called = {thing.py_func for _, thing in _named(python) if is_jitted(thing)} - met
        met |= called
        waiting += called


def _constants(function: FunctionType) -> Iterator[str]:
    for name, thing in _named(function):
        if isinstance(thing, FunctionType):
            yield f"{name} {thing.__qualname__} {_text(thing)[1]} {_code(thing.__code__)}"
        elif isinstance(thing, np.ndarray):
            yield f"{name} {thing.dtype} {thing.shape} {thing.tobytes().hex()}"
        elif isinstance(thing, (bool, int, float, complex, str, tuple)):
            yield f"{name} {thing!r}"


def _text(function: FunctionType) -> tuple[str, str]:
    """File of a function, and the hash of its text; its code where it was typed at a prompt."""
    path = function.__code__.co_filename
    try:
        return path, _file_hash(path)
    except OSError:
        return f"{path} {function.__qualname__}", function.__code__.co_code.hex()


def _file_hash(path: str) -> str:
    stat = Path(path).stat()
    return _hash_of(path, stat.st_mtime_ns, stat.st_size)


@functools.cache
def _hash_of(path: str, *_stamp: int) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def _code(code: CodeType) -> str:
    """Instructions, names and constants of a function, those of functions inside it included."""
    inner = [_code(c) if isinstance(c, CodeType) else repr(c) for c in code.co_consts]
    return f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {inner}"


def _named(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Things that a function names: globals, what they hold where they are modules, and what it closes over."""
    names = set(_names(function.__code__))
    cells = (cell.cell_contents for cell in function.__closure__ or ())
    scope = dict(zip(function.__code__.co_freevars, cells, strict=True))
    scope |= {name: function.__globals__[name] for name in names if name in function.__globals__}
    for name, thing in scope.items():
        yield name, thing
        if isinstance(thing, ModuleType) and thing.__name__.partition(".")[0] not in _OTHERS:
            yield from ((f"{name}.{n}", getattr(thing, n)) for n in names if hasattr(thing, n))


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)
