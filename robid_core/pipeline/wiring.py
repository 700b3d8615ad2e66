"""Who feeds whom: inputs found by type, in three steps that know nothing of files.

A parameter takes the stage whose output is exactly its type; where no stage makes exactly that, one that
makes a subclass (a Design is Configurations). Of several, those that depend on the asking stage cannot be
meant; if more than one is left, the wiring is ambiguous and `inputs:` must say. A parameter that takes many takes all
that are left, except those that could take what this stage makes in the same way. The order of the file plays
no part, except that stages without order between them run, and feed such a parameter, as they are written.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from graphlib import TopologicalSorter

from robid_core.artifacts import Artifact

Source = str | tuple[str, ...]  # the stage that feeds a parameter, or those that feed one that takes many
Wires = dict[str, dict[str, Source]]


def each(source: Source) -> tuple[str, ...]:
    """Return the stages that a source names."""
    return (source,) if isinstance(source, str) else source


def feeding(inputs: Mapping[str, Source]) -> tuple[str, ...]:
    """Return the stages that feed any of the parameters, each once."""
    return tuple(dict.fromkeys(name for source in inputs.values() for name in each(source)))


@dataclass(frozen=True)
class StageSignature:
    """What wiring needs to know of a stage.

    `wants` maps parameters to types, `optional` names those that may stay away, `many` those that take a tuple;
    `given` maps the parameters that the user wired to what feeds them, or to None where what the user wrote is
    wrong; `output` is None where it is unknown.
    """

    name: str
    output: type[Artifact] | None
    wants: Mapping[str, type[Artifact]]
    optional: frozenset[str] = frozenset()
    given: Mapping[str, Source | None] = field(default_factory=dict)
    many: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Open:
    """A parameter that could not be wired, with the stages that come into question (none: nobody makes it)."""

    stage: str
    parameter: str
    artifact: type[Artifact]
    candidates: tuple[str, ...]


def wire(nodes: Iterable[StageSignature]) -> tuple[Wires, list[Open]]:
    """Return the source of every parameter that has exactly one, and the parameters that stay open.

    Parameters that the user wired are taken as given, and a required one takes the only stage there is (one that
    takes many, all there are), even where that closes a cycle. An optional one never does, and stays away where
    nothing can feed it.
    """
    nodes = list(nodes)
    wires: Wires = {node.name: {p: s for p, s in node.given.items() if s is not None} for node in nodes}
    required: dict[tuple[str, str], tuple[str, ...]] = {}
    optional: dict[tuple[str, str], tuple[str, ...]] = {}
    many: dict[tuple[str, str], tuple[str, ...]] = {}
    for node in nodes:
        for parameter, artifact in node.wants.items():
            if parameter not in node.given:
                waiting = (
                    many if parameter in node.many else optional if parameter in node.optional else required
                )
                waiting[node.name, parameter] = candidates(node.name, artifact, nodes)
    may_stay_away = {(node.name, parameter) for node in nodes for parameter in node.optional}
    many = _one_way(many)
    while (
        _settle(required, wires, only=1)
        or _settle(optional, wires, only=0)
        or _settle_many(many, wires, may_stay_away)
    ):
        pass
    types = {node.name: node.wants for node in nodes}
    still = {
        **required,
        **{key: left for key, found in optional.items() if (left := _usable(key[0], found, wires))},
        **many,
    }
    return wires, [Open(stage, name, types[stage][name], found) for (stage, name), found in still.items()]


def _settle(waiting: dict[tuple[str, str], tuple[str, ...]], wires: Wires, only: int) -> bool:
    """Wire what has one source left and tell whether anything was; up to `only` candidates are taken unasked."""
    before = len(waiting)
    for (stage, parameter), found in list(waiting.items()):
        left = found if len(found) <= only else _usable(stage, found, wires)
        if len(left) == 1:
            wires[stage][parameter] = left[0]
            del waiting[stage, parameter]
    return len(waiting) < before


def _one_way(many: dict[tuple[str, str], tuple[str, ...]]) -> dict[tuple[str, str], tuple[str, ...]]:
    """Leave out the candidates that could take the output of the stage that asks just as well."""
    takers: dict[str, set[str]] = {}
    for (stage, _), found in many.items():
        takers.setdefault(stage, set()).update(found)
    return {
        (stage, parameter): tuple(name for name in found if stage not in takers.get(name, ()))
        for (stage, parameter), found in many.items()
    }


def _settle_many(
    waiting: dict[tuple[str, str], tuple[str, ...]], wires: Wires, may_stay_away: set[tuple[str, str]]
) -> bool:
    """Wire the next parameter that takes many to all that can feed it, and tell whether there was one.

    One that needs a source and has none keeps waiting.
    """
    for (stage, parameter), found in list(waiting.items()):
        optional = (stage, parameter) in may_stay_away
        sources = _usable(stage, found, wires) or (() if optional else found)
        if sources:
            wires[stage][parameter] = sources
        if sources or optional:
            del waiting[stage, parameter]
            return True
    return False


def _usable(stage: str, found: tuple[str, ...], wires: Wires) -> tuple[str, ...]:
    """Return the candidates that do not depend on the stage that asks."""
    behind = dependents(stage, wires) if found else set()
    return tuple(name for name in found if name not in behind)


def candidates(stage: str, artifact: type[Artifact], nodes: Iterable[StageSignature]) -> tuple[str, ...]:
    """Return the stages that make exactly `artifact`, or, where there are none, a subclass of it."""
    others = [node for node in nodes if node.name != stage and node.output is not None]
    exact = tuple(node.name for node in others if node.output is artifact)
    return exact or tuple(n.name for n in others if n.output is not None and issubclass(n.output, artifact))


def dependents(stage: str, wires: Wires) -> set[str]:
    """Return every stage that needs the output of `stage`, directly or through others."""
    takers: dict[str, set[str]] = {}
    for taker, inputs in wires.items():
        for source in feeding(inputs):
            takers.setdefault(source, set()).add(taker)
    found: set[str] = set()
    waiting = [stage]
    while waiting:
        for taker in takers.get(waiting.pop(), ()):
            if taker not in found:
                found.add(taker)
                waiting.append(taker)
    return found


def cycles(wires: Wires) -> list[list[str]]:
    """Return one shortest cycle of each knot of stages that need each other, first stage of the file first.

    A cycle [a, b, a] says that a feeds b and b feeds a.
    """
    found: list[list[str]] = []
    done: set[str] = set()
    for start in wires:
        if start in done or start not in dependents(start, wires):
            continue
        knot = {name for name in dependents(start, wires) if start in dependents(name, wires)}
        done |= knot
        found.append(_shortest_way_round(start, knot, wires))
    return found


def _shortest_way_round(start: str, knot: set[str], wires: Wires) -> list[str]:
    before: dict[str, str] = {}
    waiting = [start]
    for name in waiting:
        for taker in (t for t in wires if t in knot and name in feeding(wires[t])):
            if taker == start:
                way = [start, name]
                while way[-1] != start:
                    way.append(before[way[-1]])
                return way[::-1]
            if taker not in before:
                before[taker] = name
                waiting.append(taker)
    raise AssertionError(f"{start} is in no cycle")


def in_order(wires: Wires) -> list[str]:
    """Return the stages so that each comes after what feeds it; ties as in the file. There must be no cycle."""
    place = {name: index for index, name in enumerate(wires)}
    sorter = TopologicalSorter({name: feeding(inputs) for name, inputs in wires.items()})
    sorter.prepare()
    ready: list[tuple[int, str]] = []
    order: list[str] = []
    while sorter.is_active():
        for name in sorter.get_ready():
            heapq.heappush(ready, (place[name], name))
        _, name = heapq.heappop(ready)
        order.append(name)
        sorter.done(name)
    return order
