"""Whether what a package registers is what its group asks for."""

from __future__ import annotations

from typing import Any

from robid_core.errors import PluginError
from robid_core.registry import DRIVES, EFFECTS, RECORDS, STAGES, Plugin

READS = ("describe", "read")  # what a reader of recordings has


def check_registered(plugin: Plugin, loaded: Any) -> None:
    """Raise PluginError where a stage, an effect, drives or a reader is none: it fails only when it is used."""
    if fault := _fault(plugin.group, loaded):
        raise PluginError(f"{plugin} {fault}")


def _fault(group: str, loaded: Any) -> str:
    from robid_core.drives import Drives
    from robid_core.robot.file.effect_class import effect_fault
    from robid_core.stage import stage_fault

    if group == STAGES:
        return stage_fault(loaded)
    if group == EFFECTS:
        return effect_fault(loaded)
    if group == DRIVES and not (isinstance(loaded, type) and issubclass(loaded, Drives)):
        return "is no subclass of robid_core.Drives"
    if group == RECORDS and (
        missing := [name for name in READS if not callable(getattr(loaded, name, None))]
    ):
        return f"is no reader of recordings: it lacks {' and '.join(missing)}"
    return ""
