"""Whether what a package registers is what its group asks for, asked where it is loaded."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from robid_core import registry
from robid_core.errors import PluginError
from robid_core.registry import (
    DRIVES,
    DYNAMICS,
    EFFECTS,
    EXECUTORS,
    MESHES,
    MODELS,
    RECORDS,
    STAGES,
    TASKS,
    Plugin,
    call_fault,
)

READS = ("describe", "read")  # what a reader of recordings has


def load_plugin(group: str, name: str) -> Any:
    """Import what is registered as `name` in a group such as "robid.records"; the facade's way to the registry.

    Raises
    ------
    ConfigurationError
        Where there is none, with what comes near.
    PluginError
        Where it cannot be imported, or is not what its group asks for.

    Examples
    --------
    >>> import robid_core as robid
    >>> robid.load_plugin("robid.stages", "design.candidates").__name__
    'RandomCandidates'
    """
    plugin = registry.registry().find(group, name)
    loaded = plugin.load()
    check_registered(plugin, loaded)
    return loaded


def check_registered(plugin: Plugin, loaded: Any) -> None:
    """Raise PluginError where a plugin is not what its group asks for: it fails only when it is used."""
    if fault := FAULTS[plugin.group](loaded):
        raise PluginError(f"{plugin} {fault}")


def _stage(loaded: Any) -> str:
    from robid_core.stage import stage_fault

    return stage_fault(loaded)


def _effect(loaded: Any) -> str:
    from robid_core.robot.file.effect_class import effect_fault

    return effect_fault(loaded)


def _drives(loaded: Any) -> str:
    from robid_core.drives import Drives

    fits = isinstance(loaded, type) and issubclass(loaded, Drives)
    return "" if fits else "is no subclass of robid_core.Drives"


def _dynamics(loaded: Any) -> str:
    from robid_core.robot.batched_dynamics import BatchedDynamics

    asked = [name for name, value in vars(BatchedDynamics).items() if isinstance(value, property)]
    missing = [name for name in asked if not callable(getattr(loaded, name, None))]
    return f"computes no dynamics: it lacks {', '.join(missing)}" if missing else ""


def _records(loaded: Any) -> str:
    missing = [name for name in READS if not callable(getattr(loaded, name, None))]
    return f"is no reader of recordings: it lacks {' and '.join(missing)}" if missing else ""


def _executor(loaded: Any) -> str:
    enters = hasattr(loaded, "__enter__") if isinstance(loaded, type) else callable(loaded)
    if enters and not inspect.isgeneratorfunction(loaded):
        return ""
    return "is no executor: it must return a context manager (a generator under contextlib.contextmanager)"


FAULTS: dict[str, Callable[[Any], str]] = {
    STAGES: _stage,
    EFFECTS: _effect,
    DRIVES: _drives,
    DYNAMICS: _dynamics,
    MODELS: lambda loaded: call_fault(loaded, "file", "locked joints"),
    MESHES: lambda loaded: call_fault(loaded, "file"),
    RECORDS: _records,
    EXECUTORS: _executor,
    TASKS: lambda loaded: "" if callable(loaded) else "is no function",
}
