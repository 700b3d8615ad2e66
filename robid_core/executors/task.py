"""Tasks that travel: a function by its name, or a registered unit of work by group, name and code, over plain arrays.

Nothing that is executed ever crosses a border, only names. A unit of work (group `robid.tasks`) says with which
code it was asked for - distribution, version and a digest of the sources, of its own and of every plugin that its
arguments name - and a place that has other code refuses, instead of giving other numbers.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import importlib.util
import pickle
import platform
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from robid_core.errors import ConfigurationError, PluginError, RobidError, class_of, said_by
from robid_core.registry import Plugin, registry

Code = tuple[str, str, str, str, str]  # group, name, distribution, version, digest of the sources


def task_name(function: Callable[..., Any]) -> str:
    """Return module and name of a function, for messages."""
    return f"{getattr(function, '__module__', '?')}.{getattr(function, '__qualname__', repr(function))}"


def check_task(function: Callable[..., Any]) -> None:
    """Raise PluginError for what another process could not find by name, also where no other process is asked."""
    found: Any = None
    with contextlib.suppress(ImportError, AttributeError):
        found = importlib.import_module(function.__module__)
        for part in function.__qualname__.split("."):
            found = getattr(found, part)
    if found is not function:
        raise PluginError(
            f"{task_name(function)} cannot be a parallel task: it must be a function at the top of an importable module"
        )


class StandIn(PluginError):
    """What stands for an exception of a plugin that does not reach another process; its text begins with the class."""


def surviving(error: BaseException) -> BaseException:
    """Return an exception that reaches another process: some can be packed and not unpacked."""
    try:
        pickle.loads(pickle.dumps(error, protocol=pickle.HIGHEST_PROTOCOL))
    except BaseException:  # whatever its own code raises then
        own = next((kind for kind in type(error).__mro__ if kind.__module__ == RobidError.__module__), None)
        return StandIn(f"{class_of(error)}: {said_by(error)}") if own is None else own(said_by(error))
    return error


def unit(group: str, name: str, uses: Iterable[tuple[str, str]] = ()) -> tuple[Code, ...]:
    """Return the code of a registered unit of work and of the plugins (group, name) that its arguments name.

    Raises ConfigurationError where one is not registered.
    """
    return tuple(_code_of(registry().find(*place)) for place in [(group, name), *sorted(set(uses))])


def perform(codes: tuple[Code, ...], argument: tuple[Any, ...]) -> Any:
    """Call the registered unit `codes[0]` with plain arguments: what a map is given as its function.

    Raises
    ------
    PluginError
        Where this place lacks the code or has another version of it.
    """
    for code in codes:
        group, name, distribution, version, digest = code
        try:
            here = _code_of(registry().find(group, name))
        except ConfigurationError as error:
            raise PluginError(
                f"'{name}' is not installed on {platform.node()}, where it was to be computed; install "
                f"{distribution} {version} there"
            ) from error
        if here != code:
            differs = "other sources" if here[:4] == code[:4] else f"{here[2]} {here[3]}"
            raise PluginError(
                f"'{name}' was to be computed on {platform.node()} with {distribution} {version} (sources "
                f"{digest[:12]}); it has {differs} (sources {here[4][:12]}) there: install the same"
            )
    return registry().load(*codes[0][:2])(*argument)


def _code_of(plugin: Plugin) -> Code:
    package = plugin.target.partition(":")[0].partition(".")[0]
    return plugin.group, plugin.name, plugin.distribution, plugin.version, sources_digest(package)


@functools.cache
def sources_digest(package: str) -> str:
    """Hash the modules of a package as they lie here, by name and content; empty where it has none to read."""
    spec = importlib.util.find_spec(package)
    places = [Path(place) for place in (spec.submodule_search_locations or ())] if spec is not None else []
    files = [(path.relative_to(place).as_posix(), path) for place in places for path in place.rglob("*.py")]
    if spec is not None and not places and spec.has_location and spec.origin is not None:
        files = [(Path(spec.origin).name, Path(spec.origin))]
    digest = hashlib.sha256()
    for name, path in sorted(files):
        digest.update(f"{name}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest() if files else ""
