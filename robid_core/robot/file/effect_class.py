"""The class that is registered as an effect: found by name, and refused where it lacks what every effect has."""

from __future__ import annotations

from typing import Any

from robid_core import registry
from robid_core.effect import Effect, ForceEffect, SignalEffect
from robid_core.errors import ConfigurationError

OF_ALL = ("parameters", "source")
OF_KIND = {ForceEffect: ("law", "sides"), SignalEffect: ("law", "channels")}
ELSE = ("places",)  # of what changes the robot itself


def effect_class(name: str) -> type[Effect]:
    """Return the effect of this name.

    Raises
    ------
    ConfigurationError
        Where there is none, with what comes near, or what is registered is no effect.
    PluginError
        Where its plugin cannot be imported.
    """
    plugin = registry.registry().find(registry.EFFECTS, name)
    loaded: Any = plugin.load()
    if fault := effect_fault(loaded):
        raise ConfigurationError(f"effect {plugin} {fault}")
    found: type[Effect] = loaded
    return found


def effect_fault(loaded: Any) -> str:
    """Say why what is registered as an effect is none; empty where it has all that an effect needs."""
    if not (isinstance(loaded, type) and issubclass(loaded, Effect)):
        return "is no subclass of robid_core.ForceEffect, SignalEffect or StructureEffect"
    of_kind = next((names for kind, names in OF_KIND.items() if issubclass(loaded, kind)), ELSE)
    missing = [name for name in (*OF_ALL, *of_kind) if not hasattr(loaded, name)]
    missing += sorted(getattr(loaded, "__abstractmethods__", ()))
    if missing:
        return f"lacks {', '.join(missing)}; see `robid init --plugin effect`"
    if callable(loaded.parameters):
        return "has no table of parameters: it is a tuple of robid_core.Parameter, not a function"
    return ""
