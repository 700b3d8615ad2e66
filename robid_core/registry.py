"""Plugins by group and name: lazy, with the distribution and version each comes from.

The registry maps (group, name) to an object and knows no class of ours. Nothing is imported until it is
asked for; a plugin that cannot be imported is reported when it is wanted, by the name of its distribution,
and disturbs no other.
"""

from __future__ import annotations

import difflib
import functools
import inspect
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from robid_core.errors import ConfigurationError, ExtraMissing, PluginError, said_by
from robid_core.interruption import may_be_requested

STAGES = "robid.stages"
EFFECTS = "robid.effects"
DRIVES = "robid.drives"
DYNAMICS = "robid.dynamics"
MODELS = "robid.models"
MESHES = "robid.meshes"
RECORDS = "robid.records"
EXECUTORS = "robid.executors"
TASKS = "robid.tasks"
GROUPS = (STAGES, EFFECTS, DRIVES, DYNAMICS, MODELS, MESHES, RECORDS, EXECUTORS, TASKS)

NOUNS = {
    STAGES: "stage",
    EFFECTS: "effect",
    DRIVES: "drives",
    DYNAMICS: "dynamics",
    MODELS: "reader of robot models",
    MESHES: "reader of meshes",
    RECORDS: "reader of recordings",
    EXECUTORS: "executor",
    TASKS: "task",
}

UNKNOWN = "unknown"  # distribution of an entry point that no package brings

# What an extra brings, for the hint when its packages are missing.
EXTRAS = {
    "torch": "torch",
    "pytorch_kinematics": "torch",
    "distributed": "dask",
    "dask": "dask",
    "pyarrow": "formats",
    "rosbags": "formats",
}

# Suffix of a recording -> its reader's name, where that is another one; a plugin's reader is called like its suffix.
READERS = {
    "tsv": "csv",
    "txt": "csv",
    "dat": "csv",
    "h5": "hdf5",
    "pq": "parquet",
    "bag": "rosbag",
    "db3": "rosbag",
}


OWN = "robid"  # the distribution whose plugins are no third party's


@dataclass(frozen=True)
class Plugin:
    """One registered object: where it comes from, and how to load it."""

    group: str
    name: str
    target: str
    distribution: str
    version: str
    entry_point: metadata.EntryPoint

    def load(self) -> Any:
        """Import the object; PluginError says which distribution failed and why."""
        if metadata.EntryPoint.pattern.match(self.target) is None:
            raise PluginError(
                f"{self} is registered as '{self.target}', which is no 'module:object'; tell the author of the plugin"
            )
        try:
            return self.entry_point.load()
        except ModuleNotFoundError as error:
            extra = EXTRAS.get((error.name or "").partition(".")[0])
            missing = f"{self} needs the module {error.name}, which is not installed"
            if extra:
                raise ExtraMissing(f'{missing}; run: pip install "robid[{extra}]"') from error
            if self.distribution != UNKNOWN:
                missing += (
                    f"; install that module, or {self.distribution} anew from where it came, with what it "
                )
                missing += "requires (pip install FOLDER, where it is a folder of yours)"
            raise PluginError(missing) from error
        except BaseException as error:  # a module may end in sys.exit()
            if isinstance(error, KeyboardInterrupt) and may_be_requested():
                raise
            raise PluginError(
                f"{self} cannot be imported: {type(error).__name__}: {said_by(error)}"
            ) from error

    @property
    def is_foreign(self) -> bool:
        """Whether another distribution than robid itself brings it."""
        return self.distribution != OWN

    def __str__(self) -> str:
        return f"'{self.name}' ({self.distribution} {self.version})"


class Registry:
    """All plugins of a set of entry points; `registry()` gives the one of this environment."""

    def __init__(self, entry_points: Iterable[metadata.EntryPoint]) -> None:
        found: dict[tuple[str, str], list[Plugin]] = {}
        origins: dict[metadata.Distribution | None, tuple[str, str]] = {}
        for point in entry_points:
            if point.group in GROUPS:
                if point.dist not in origins:  # its metadata are a long text, parsed at every access
                    origins[point.dist] = _name_and_version(point.dist)
                plugin = Plugin(point.group, point.name, point.value, *origins[point.dist], point)
                same = found.setdefault((point.group, point.name), [])
                if all((p.target, p.distribution) != (plugin.target, plugin.distribution) for p in same):
                    same.append(plugin)
        self._found: Mapping[tuple[str, str], list[Plugin]] = found

    def names(self, group: str) -> list[str]:
        """Return the names registered in a group, sorted."""
        return sorted(name for g, name in self._found if g == group)

    def plugins(self, group: str) -> list[Plugin]:
        """Return every plugin of a group, duplicates included, sorted by name."""
        return [plugin for name in self.names(group) for plugin in self._found[group, name]]

    def find(self, group: str, name: str) -> Plugin:
        """Return the plugin called `name`, or pinned as `distribution:name`.

        Raises ConfigurationError where there is none (with what comes near) or where two distributions
        claim the name.
        """
        distribution, _, short = name.rpartition(":")
        candidates = self._found.get((group, short), [])
        if distribution:
            candidates = [p for p in candidates if p.distribution == distribution]
        noun = NOUNS[group]
        if not candidates:
            near = difflib.get_close_matches(name, self.names(group), n=1, cutoff=0.6)
            known = (
                f"; there are: {', '.join(self.names(group))}; is the package that brings it installed here?"
            )
            hint = f"; did you mean '{near[0]}'?" if near else known
            raise ConfigurationError(f"no {noun} '{name}'{hint}")
        if len(candidates) > 1:
            owners = " and ".join(f"{p.distribution} {p.version}" for p in candidates)
            raise ConfigurationError(
                f"{noun} '{name}' is claimed by {owners}; write '{candidates[0].distribution}:{name}' to choose"
            )
        return candidates[0]

    def load(self, group: str, name: str) -> Any:
        """Find a plugin and import it."""
        return self.find(group, name).load()


def _name_and_version(distribution: metadata.Distribution | None) -> tuple[str, str]:
    if distribution is None:
        return UNKNOWN, "0"
    try:
        found = distribution.metadata
        return found["Name"] or UNKNOWN, found["Version"] or "0"
    except (KeyError, FileNotFoundError, UnicodeDecodeError):  # an installation or a removal was interrupted
        return UNKNOWN, "0"


@functools.cache
def registry() -> Registry:
    """Return the registry of everything installed in this environment."""
    try:
        found = metadata.entry_points()  # once: each call reads every distribution
    except Exception as error:  # whatever Python's parser meets in a damaged list
        damaged = ", ".join(_without_a_list()) or UNKNOWN
        raise PluginError(
            f"the list of plugins (entry_points.txt) of a package cannot be read: {damaged}; install it again"
        ) from error
    return Registry(point for group in GROUPS for point in found.select(group=group))


def _without_a_list() -> Iterator[str]:
    """Yield the distributions whose list of entry points cannot be read."""
    for distribution in metadata.distributions():
        try:
            _ = distribution.entry_points
        except Exception:  # as above
            yield _name_and_version(distribution)[0]


def record_readers() -> dict[str, str]:
    """Return the readers of recordings by the suffixes of their files, without the dot.

    >>> import robid_core as robid
    >>> robid.record_readers()["csv"]
    'csv'
    """
    names = registry().names(RECORDS)
    return {name: name for name in names} | {s: name for s, name in READERS.items() if name in names}


def call_fault(loaded: Any, *arguments: str) -> str:
    """Say why an object cannot be called with so many arguments; empty where it can."""
    if not callable(loaded):
        return "is no function"
    try:
        inspect.signature(loaded).bind(*arguments)
    except TypeError:
        return f"cannot be called with ({', '.join(arguments)})"
    except ValueError:  # a function of C that does not say what it takes
        return ""
    return ""
