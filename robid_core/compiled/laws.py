"""From a law in Python to addresses of machine code: one entry for a single experiment, one for all lanes.

The simulator calls laws through addresses, so that it is compiled once and never again for another set of effects.
Each law gets a small module of entries in the cache folder, **named by the hash of everything the law
reaches**: its own
file, the files of every compiled function it calls, and the constants it names. Numba looks at the file of the
outermost function only; under a name of its own an edited law is always compiled anew.

A law that does not compile for lanes (it has branches, or calls a function that knows numbers only) gets an entry that
runs it lane after lane.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import os
import sys
import tempfile
from pathlib import Path
from typing import Any, Literal

import numba
from numba.core.caching import NullCache
from numba.core.errors import NumbaError
from numba.extending import is_jitted

from robid_core.compiled.content import content_hash, reached
from robid_core.compiled.lanes import LANES
from robid_core.compiled.machine_code import cache_folder
from robid_core.errors import PluginError

Law = Any
"""A function compiled by numba; its arguments stand in `effect.ForceEffect` and `effect.SignalEffect`."""

Kind = Literal["force", "signal"]
Way = Literal["single", "lanes", "lane_after_lane"]

N_INPUT = 3  # rows of what goes into a law: position, velocity, load, or signal, angle, speed
N_OUTPUT = 3  # rows of what comes out: force, slope in position, slope in velocity, or the signal

ENTRY = numba.types.void(*[numba.types.intp] * 4, numba.types.float64)


class Entries:
    """The compiled entries of a law: void entry(place, state, next_state, arguments, step), all addresses but the step.

    `place` has rows of inputs and outputs, `state` and `next_state` a row a state, each as wide as the lanes;
    `arguments` are numbers, or rows as wide as the lanes. Each is compiled, or found on disk, when it is asked for:
    most sessions take one of the two. Addresses are good as long as this object lives.

    Raises
    ------
    PluginError
        Of each attribute, in the name of `label`, where the law does not compile.
    """

    def __init__(self, law: Law, kind: Kind, n_state: int, label: str, n_argument: int | None) -> None:
        self.law = law if is_jitted(law) else numba.njit(law)
        self.label = label
        for function in reached(self.law):  # what numba keeps of these may be older than what they call
            if not function.py_func.__module__.startswith("robid_core."):
                function._cache = NullCache()
        self._name = _importable(self.law)
        self._digest = content_hash(self.law.py_func)
        ways: tuple[Way, ...] = ("single", "lanes", "lane_after_lane")
        self._sources = {
            way: _source(self._name, way, kind, n_state, None if way == "single" else n_argument)
            for way in ways
        }

    @functools.cached_property
    def single(self) -> int:
        """Address of the entry for one experiment."""
        return int(self._single.address)

    @functools.cached_property
    def lanes(self) -> int:
        """Address of the entry for all lanes; their arguments stand side by side where they were asked for so."""
        return int(self._all_lanes[0].address)

    @functools.cached_property
    def vectorized(self) -> bool:
        """Whether the law runs on all lanes at once."""
        return self._all_lanes[1]

    @functools.cached_property
    def _single(self) -> Any:
        return self._compiled("single")

    @functools.cached_property
    def _all_lanes(self) -> tuple[Any, bool]:
        """The entry for all lanes, and whether it is vectorized."""
        try:
            return self._entry("lanes"), True
        except NumbaError:
            return self._compiled("lane_after_lane"), False

    def _compiled(self, way: Way) -> Any:
        """Compile an entry whose errors are the law's own."""
        try:
            return self._entry(way)
        except NumbaError as error:
            reason = next((line for line in str(error).splitlines() if line.strip()), "")
            raise PluginError(
                f"effect '{self.label}': its law does not compile: {reason}; a law is one function of numbers, see "
                f"robid_core.effect\n{error}"
            ) from error

    def _entry(self, way: Way) -> Any:
        return _entry(self.law, self._name, self._sources[way], self._digest)


_known: dict[tuple[int, str, int, int | None], tuple[Law, Entries]] = {}


def entries_of(law: Law, kind: Kind, n_state: int, label: str, n_argument: int | None = None) -> Entries:
    """Return the entries of a law, the same ones for the same law.

    `n_argument` is the number of its arguments where each lane has its own; None: all lanes share them. `label` names
    the effect that asked last, where it does not compile.
    """
    key = (id(law), kind, n_state, n_argument)
    if key not in _known:
        _known[key] = (law, Entries(law, kind, n_state, label, n_argument))
    entries = _known[key][1]
    entries.label = label
    return entries


# Entries -------------------------------------------------------------------------------------------------------


def _importable(law: Law) -> tuple[str, str] | None:
    """Module and name from which another process gets the same law; None where it stands in none."""
    module, name = law.py_func.__module__, law.py_func.__qualname__
    found = sys.modules.get(module)
    return (module, name) if module != "__main__" and getattr(found, name, None) is law else None


def _source(name: tuple[str, str] | None, way: Way, kind: Kind, n_state: int, n_argument: int | None) -> str:
    """Text of the module that holds one entry; with `n_argument`, each lane has arguments of its own."""
    outputs = "io[3], io[4], io[5]" if kind == "force" else "io[3]"
    view = "lanes_at" if way == "lanes" else "numbers_at"
    lines = [
        "import numpy as np",
        "from robid_core.compiled.views import lanes_at, numbers_at",
        *([f"from {name[0]} import {name[1]} as law"] if name else []),
        "",
        "",
        "def entry(place, state, next_state, arguments, step):",
    ]
    if way != "lane_after_lane":
        given = "numbers_at" if n_argument is None else "lanes_at"
        lines += [
            f"    io = {view}(place)",
            f"    {outputs} = law(",
            f"        io[0], io[1], io[2], {view}(state), {view}(next_state), {given}(arguments), step",
            "    )",
        ]
    else:
        rows = ", ".join(f"io[{row} * {LANES} + lane]" for row in range(N_INPUT))
        outputs = ", ".join(
            f"io[{N_INPUT + row} * {LANES} + lane]" for row in range(N_OUTPUT if kind == "force" else 1)
        )
        gathered = [
            f"        for k in range({n_argument}):",
            f"            numbers[k] = given[k * {LANES} + lane]",
        ]
        lines += [
            "    io, before, after = numbers_at(place), numbers_at(state), numbers_at(next_state)",
            f"    own, following = np.empty({n_state}), np.empty({n_state})",
            *(
                []
                if n_argument is None
                else [f"    given, numbers = numbers_at(arguments), np.empty({n_argument})"]
            ),
            f"    for lane in range({LANES}):",
            f"        for k in range({n_state}):",
            f"            own[k] = following[k] = before[k * {LANES} + lane]",
            *([] if n_argument is None else gathered),
            f"        {outputs} = law(",
            f"            {rows}, own, following, {'numbers_at(arguments)' if n_argument is None else 'numbers'}, step",
            "        )",
            f"        for k in range({n_state}):",
            f"            after[k * {LANES} + lane] = following[k]",
        ]
    return "\n".join(lines) + "\n"


def _entry(law: Law, name: tuple[str, str] | None, source: str, digest: str) -> Any:
    options: dict[str, Any] = {"error_model": "numpy"}
    if name is None:  # nobody else can import it: compiled in every process
        scope: dict[str, Any] = {"law": law}
        exec(compile(source, "<entry of a law>", "exec"), scope)
        return numba.cfunc(ENTRY, **options)(scope["entry"])
    key = hashlib.sha256(f"{digest} {name} {source}".encode()).hexdigest()[:32]
    path = cache_folder("laws") / f"law_{key}.py"
    if not path.is_file():
        _write(path, source)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # where numba looks for it when it loads the machine code
    spec.loader.exec_module(module)
    return numba.cfunc(ENTRY, cache=True, **options)(module.entry)


def _write(path: Path, text: str) -> None:
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    with os.fdopen(handle, "w", encoding="utf-8") as stream:
        stream.write(text)
    Path(temporary).replace(path)
