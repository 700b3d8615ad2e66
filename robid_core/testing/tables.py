"""What an effect says of itself: theory, source, table of parameters, places, test values."""

from __future__ import annotations

import inspect
import keyword
import math
from collections.abc import Sequence
from typing import get_args

from robid_core.effect import Effect, ForceEffect, Parameter, Side, SignalChannel, SignalEffect
from robid_core.robot.structure_effect import StructureEffect
from robid_core.testing.broken import ContractBroken
from robid_core.testing.laws import FORCE_INPUTS, OUTPUTS, SIGNAL_INPUTS
from robid_core.testing.places import PLACE_NUMBERS, SPOTS

LawEffect = type[ForceEffect] | type[SignalEffect]


def check_table(effect: type[Effect]) -> None:
    """Check what an effect says of itself: theory, source, parameters, places, test values."""
    name = getattr(effect, "__name__", repr(effect))
    kinds = (ForceEffect, SignalEffect, StructureEffect)
    if not (isinstance(effect, type) and issubclass(effect, kinds)):
        raise ContractBroken(
            f"{name} is no effect; derive it from ForceEffect, SignalEffect or StructureEffect"
        )
    if inspect.isabstract(effect):
        raise ContractBroken(f"{name} leaves out {', '.join(sorted(effect.__abstractmethods__))}")
    if not (vars(effect).get("__doc__") or "").strip():
        raise ContractBroken(f"{name} has no docstring; `robid stages` shows it to the user")
    if not str(getattr(effect, "source", "")).strip():
        raise ContractBroken(f"{name} has no source; name the paper or book of its law, or 'Definition'")
    word, known, reserved = _vocabulary(effect)
    where = getattr(effect, word, ())
    if not where or len(set(where)) < len(where) or not set(where) <= set(known):
        raise ContractBroken(
            f"{name}: {word} is {where!r}; give at least one of {', '.join(known)}, none twice"
        )
    rows = getattr(effect, "parameters", None)
    if not isinstance(rows, tuple) or not all(isinstance(row, Parameter) for row in rows):
        raise ContractBroken(f"{name}: parameters is {rows!r}; give a tuple of Parameter, () for none")
    _check_rows(name, rows, {*reserved, "step", "state"})
    bounds = {row.name: (row.lower, row.upper) for row in rows}
    for parameter, value in effect.smoothest.items():
        lower, upper = bounds.get(parameter, (math.inf, -math.inf))
        if not lower < value < upper:
            raise ContractBroken(
                f"{name}: smoothest has {parameter} = {value:g}; give a parameter of the table, within its bounds"
            )
    if issubclass(effect, ForceEffect | SignalEffect):
        _check_declared_law(effect, name)


def _vocabulary(effect: type[Effect]) -> tuple[str, Sequence[str], Sequence[str]]:
    """What an effect calls the places where it may sit, which there are, and the arguments of its law."""
    if issubclass(effect, ForceEffect):
        return "sides", get_args(Side), FORCE_INPUTS
    if issubclass(effect, SignalEffect):
        return "channels", get_args(SignalChannel), SIGNAL_INPUTS
    return "places", SPOTS, ()


def _check_rows(name: str, rows: tuple[Parameter, ...], reserved: set[str]) -> None:
    seen: set[str] = set()
    for row in rows:
        where = f"{name}: parameter '{row.name}'"
        if not row.name.isidentifier() or keyword.iskeyword(row.name):
            raise ContractBroken(f"{where} is no name; robots call it effect.<label>.<name>")
        if row.name in reserved:
            raise ContractBroken(
                f"{where} has the name of an argument of the law; test values take both by name"
            )
        if row.name in seen:
            raise ContractBroken(f"{where} stands in the table twice")
        seen.add(row.name)
        if not row.unit.strip() or not row.description.strip():
            raise ContractBroken(f"{where} lacks a unit or a description; a number has the unit '1'")
        numbers = (row.lower, row.default, row.upper)
        if not all(map(math.isfinite, numbers)) or not row.lower <= row.default <= row.upper:
            raise ContractBroken(
                f"{where}: default {row.default:g} is not within its bounds {row.lower:g} to {row.upper:g}"
            )
        if row.lower == row.upper:
            raise ContractBroken(f"{where} can only be {row.lower:g}; make it a constant of the law")


def _check_declared_law(effect: LawEffect, name: str) -> None:
    if not callable(getattr(effect, "law", None)):
        raise ContractBroken(f"{name} has no law; write law = staticmethod(<compiled function>)")
    if inspect.ismethod(effect.law) or not isinstance(inspect.getattr_static(effect, "law"), staticmethod):
        raise ContractBroken(
            f"{name}: law is called with itself; write law = staticmethod(<compiled function>)"
        )
    draws = issubclass(effect, SignalEffect) and overrides(effect, "draw")
    if not effect.test_values and not draws:  # what is drawn beforehand is no law
        raise ContractBroken(f"{name} has no test_values; give one TestValue with where it is known from")
    own = {row.name for row in effect.parameters}
    inputs = FORCE_INPUTS if issubclass(effect, ForceEffect) else SIGNAL_INPUTS
    results = OUTPUTS if issubclass(effect, ForceEffect) else ("signal",)
    for value in effect.test_values:
        wrong = set(value.arguments) - own - {*inputs, "step", "state", *PLACE_NUMBERS}
        wrong |= set(value.expected) - {*results, "next_state"}
        if wrong:
            raise ContractBroken(
                f"{name}: a test value speaks of {', '.join(sorted(wrong))}; arguments are {', '.join(inputs)}, step, "
                f"state, parameters and numbers of the place, expected are {', '.join(results)}, next_state"
            )
        if not value.expected or not value.origin.strip():
            raise ContractBroken(
                f"{name}: a test value expects nothing, or does not say where it is known from"
            )


def overrides(effect: LawEffect, method: str) -> bool:
    """Whether an effect has a method of its own in place of its kind's."""
    kind = ForceEffect if issubclass(effect, ForceEffect) else SignalEffect
    return getattr(effect, method).__func__ is not getattr(kind, method).__func__
