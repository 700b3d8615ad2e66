"""What a run would do and why: for each stage, kept from the store, or made because of what changed."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from robid_core.errors import ConfigurationError
from robid_core.pipeline import Pipeline, StageNode
from robid_core.pipeline.wiring import each
from robid_core.run.identity import InputHash, Surroundings, differences, ingredients_of, key_of
from robid_core.run.manifest import Manifest
from robid_core.store import Entry, State, Store


class Action(enum.Enum):
    """What is done with a stage: kept, made, made if its input changes, or not chosen."""

    KEEP = "cached"
    MAKE = "run"
    MAYBE = "run if its input changes"
    LEAVE = "not chosen"


@dataclass(frozen=True)
class Decision:
    """What is to be done with a stage, and why."""

    stage: str
    action: Action
    reasons: tuple[str, ...] = ()
    key: str = ""
    ingredients: Mapping[str, Any] = field(default_factory=dict)
    entry: Entry | None = None
    damaged: bool = False


def selection(pipeline: Pipeline, first: str | None, last: str | None) -> set[str]:
    """Return the stages between two: `first` and what depends on it, `last` and what it needs."""
    chosen = {node.name for node in pipeline.stages}
    feeds = {node.name: set(node.feeds) for node in pipeline.stages}
    if first is not None:
        after = {pipeline.stage(first).name}
        for node in pipeline.stages:  # in the order in which they run
            if feeds[node.name] & after:
                after.add(node.name)
        chosen &= after
    if last is not None:
        needed = {pipeline.stage(last).name}
        for node in reversed(pipeline.stages):
            if node.name in needed:
                needed |= feeds[node.name]
        chosen &= needed
    if not chosen:
        raise ConfigurationError(f"no stage lies between --from {first} and --until {last}; swap them?")
    return chosen


def input_hashes(node: StageNode, hashes: Mapping[str, str]) -> dict[str, InputHash]:
    """Return the sha256 of what feeds each parameter, from those of the stages; a stage without one stays away."""
    found: dict[str, InputHash] = {}
    for parameter, source in node.inputs.items():
        known = [hashes[name] for name in each(source) if name in hashes]
        if not isinstance(source, str):
            found[parameter] = known
        elif known:
            found[parameter] = known[0]
    return found


def decide(
    node: StageNode,
    inputs: Mapping[str, InputHash],
    shared: Surroundings,
    store: Store,
    previous: Manifest | None,
    forced: bool = False,
) -> Decision:
    """Decide on a stage whose inputs are known (`input_hashes`)."""
    ingredients = ingredients_of(node, inputs, shared)
    key = key_of(ingredients)
    found = store.lookup(key)
    reasons: tuple[str, ...]
    if found.state is State.PRESENT and not forced:
        reasons = (f"made by run '{found.owner}'",) if found.owner else ()
        return Decision(node.name, Action.KEEP, reasons, key, ingredients, found.entry)
    if found.state is State.DAMAGED:
        reasons = (f"damaged: {found.problem}",)
    elif forced:
        reasons = ("forced",)
    else:
        reasons = _changes(node, ingredients, previous)
    damaged = found.state is State.DAMAGED
    return Decision(node.name, Action.MAKE, reasons, key, ingredients, found.entry, damaged)


def _changes(node: StageNode, ingredients: Mapping[str, Any], previous: Manifest | None) -> tuple[str, ...]:
    record = previous.stages.get(node.name) if previous else None
    if record is None or not record.ingredients:
        return ("never made",)
    lines = differences(record.ingredients, ingredients)
    lines = [_with_source(line, node) for line in lines]
    return tuple(lines) or ("its result is no longer in the store",)


def _with_source(line: str, node: StageNode) -> str:
    """Say which stage an input comes from."""
    for parameter, source in node.inputs.items():
        if line == f"input {parameter} changed":
            return f"input {parameter} (from {' and '.join(each(source))}) changed"
    return line


def preview(
    pipeline: Pipeline,
    chosen: Iterable[str],
    forced: Iterable[str],
    shared: Surroundings,
    store: Store,
    previous: Manifest | None,
) -> list[Decision]:
    """Decide on every stage without running any.

    A stage whose input is yet to be made may turn out to be up to date: its input may come out as it was.
    """
    chosen, forced = set(chosen), set(forced)
    hashes: dict[str, str] = {}
    decisions = []
    for node in pipeline.stages:
        coming = [source for source in node.feeds if source not in hashes]
        if coming:
            decision = _waiting(node, coming, shared, previous, node.name in forced)
        else:
            inputs = input_hashes(node, hashes)
            decision = decide(node, inputs, shared, store, previous, node.name in forced & chosen)
        if decision.action is Action.KEEP and decision.entry is not None:
            hashes[node.name] = decision.entry.sha256
        if node.name not in chosen and decision.action is not Action.KEEP:
            decision = Decision(node.name, Action.LEAVE, decision.reasons)
        decisions.append(decision)
    return decisions


def _waiting(
    node: StageNode, coming: list[str], shared: Surroundings, previous: Manifest | None, forced: bool
) -> Decision:
    record = previous.stages.get(node.name) if previous else None
    reasons = []
    if forced:
        reasons.append("forced")
    elif record is None or not record.ingredients:
        reasons.append("never made")
    else:
        now = ingredients_of(node, {}, shared) | {"inputs": record.ingredients.get("inputs")}
        reasons += differences(record.ingredients, now)
    action = Action.MAKE if reasons else Action.MAYBE
    reasons.append(f"takes the output of {', '.join(dict.fromkeys(coming))}, to be made first")
    return Decision(node.name, action, tuple(reasons))


def refuse_unmade(
    chosen: set[str], pipeline: Pipeline, decisions: Iterable[Decision], refused: Iterable[str] = ()
) -> None:
    """Raise ConfigurationError where a chosen stage needs one that is not chosen and not in the store.

    `refused` names stages that refused to give a result in the run before: what can do without them, does.
    """
    left = {d.stage: d for d in decisions if d.action is Action.LEAVE}
    for node in pipeline.stages:
        optional = {item.name for item in node.stage.inputs() if item.optional}
        for parameter, source in ((p, name) for p, named in node.inputs.items() for name in each(named)):
            if (
                node.name not in chosen
                or source not in left
                or (parameter in optional and source in set(refused))
            ):
                continue
            why = "; ".join(left[source].reasons)
            raise ConfigurationError(
                f"stage {node.name} needs the output of '{source}', which is not up to date ({why}) and was "
                f"not chosen; begin with --from {source}, or run everything"
            )
