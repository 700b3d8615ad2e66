"""Whether what a package registers is what its group asks for."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

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
)

READS = ("describe", "read")  # what a reader of recordings has


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


def _called_with(*arguments: str) -> Callable[[Any], str]:
    """Return a check that an object can be called with so many arguments."""

    def fault(loaded: Any) -> str:
        if not callable(loaded):
            return "is no function"
        try:
            inspect.signature(loaded).bind(*arguments)
        except TypeError:
            return f"cannot be called with ({', '.join(arguments)})"
        except ValueError:  # a function of C that does not say what it takes
            return ""
        return ""

    return fault


FAULTS: dict[str, Callable[[Any], str]] = {
    STAGES: _stage,
    EFFECTS: _effect,
    DRIVES: _drives,
    DYNAMICS: _dynamics,
    MODELS: _called_with("file", "locked joints"),
    MESHES: _called_with("file"),
    RECORDS: _records,
    EXECUTORS: _executor,
    TASKS: lambda loaded: "" if callable(loaded) else "is no function",
}
