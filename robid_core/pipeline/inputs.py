"""The inputs of stages as the file declares them: what `inputs:` says, and what wiring makes of the rest."""

from __future__ import annotations

from robid_core.artifacts import Artifact
from robid_core.pipeline.resolving import Declared
from robid_core.pipeline.wiring import Open, Source, StageSignature, Wires, cycles, each, in_order, wire
from robid_core.robot import Robot
from robid_core.stage import KINDS, MODELLED, Input
from robid_core.yaml_file.nodes import Node
from robid_core.yaml_file.problems import KeyPath, Mark, ProblemList, nearest, suggestion


def check_given(stage: Declared, declared: dict[str, Declared], problems: ProblemList) -> None:
    """Check the `inputs:` of a stage and fill `stage.given`; a wrong entry counts as given, to None."""
    table = stage.node.get("inputs")
    path: KeyPath = ("stages", stage.name, "inputs")
    if problems.spoils(*path):
        stage.given = {entry.name: None for entry in stage.inputs}
        return
    wanted = {entry.name: entry for entry in stage.inputs}
    wanted |= {name: Input(name, Artifact, True) for name in _robots(stage)}
    for parameter, node in (table.entries() if table is not None else {}).items():
        assert table is not None
        place, items = (*path, parameter), _items(node)
        if problems.spoils(*place) or any(problems.spoils(*place, index) for index in range(len(items))):
            stage.given[parameter] = None
            continue
        entry = wanted.get(parameter)
        if stage.known and entry is None:
            meant = nearest(parameter, list(wanted)) or next(iter(wanted), parameter)
            wrong = {place: _no_input(stage, parameter, list(wanted))}
            stage.given.setdefault(meant, None)
        else:
            wrong = _wrong_sources(stage, node, entry, place, declared)
        for where, message in wrong.items():
            problems.add(table.at(where[len(path) :])[1], where, message)
        names = tuple(str(item.value) for item in items)
        many = isinstance(node.value, list) or (entry is not None and entry.many)
        stage.given[parameter] = None if wrong else names if many else names[0]


def _robots(stage: Declared) -> list[str]:
    """Return the parameters that are lent a robot: the nominal one, or that of a stage that `inputs:` names."""
    return [name for name, kind in stage.lends.items() if kind is Robot]


def _no_input(stage: Declared, parameter: str, wanted: list[str]) -> str:
    if parameter in stage.lends:
        return f"'{parameter}' is handed in by robid and not wired"
    return f"{stage.plugin} has no input '{parameter}'; {suggestion(parameter, wanted, 'its inputs are')}"


def _items(node: Node) -> list[Node]:
    """Return the names that stand under an input: a list, or the one."""
    return node.value if isinstance(node.value, list) else [node]


def _wrong_sources(
    stage: Declared, node: Node, entry: Input | None, place: KeyPath, declared: dict[str, Declared]
) -> dict[KeyPath, str]:
    """Return what is wrong with what stands under an input, by its place; empty where nothing is."""
    names = [str(item.value) for item in _items(node)]
    if (
        entry is not None
        and isinstance(node.value, list)
        and not entry.many
        and (names or not entry.optional)
    ):
        what = "robot" if entry.name in _robots(stage) else entry.artifact.__name__
        return {place: f"{stage.plugin} takes one {what} here; write the name of one stage, no list"}
    if entry is not None and not names and not entry.optional:
        return {place: f"the list is empty; name the stages that make {_a(entry.artifact)}"}
    wrong: dict[KeyPath, str] = {}
    artifacts = () if entry is None else MODELLED if entry.name in _robots(stage) else (entry.artifact,)
    for index, name in enumerate(names):
        message = _wrong_source(stage, name, artifacts, declared)
        if name in names[:index]:
            message = f"stage '{name}' is listed already"
        if message:
            wrong[(*place, index) if isinstance(node.value, list) else place] = message
    return wrong


def _wrong_source(
    stage: Declared, source: str, wanted: tuple[type[Artifact], ...], declared: dict[str, Declared]
) -> str:
    """Return what is wrong with taking an input from `source`, empty where nothing is."""
    if source == stage.name:
        return f"stage '{source}' cannot feed itself"
    others = [name for name in declared if name != stage.name]
    if source not in declared:
        return f"no stage '{source}'; {suggestion(source, others, 'the other stages are')}"
    made = declared[source].output
    if not wanted or made is None or not declared[source].known or issubclass(made, wanted):
        return ""
    fitting = [name for name in others if (o := declared[name].output) and issubclass(o, wanted)]
    hint = f"; {_either(fitting)} makes one" if fitting else ""
    if wanted is MODELLED:
        hint += "; without this line the stage takes the nominal robot"
    return f"'{source}' makes {_a(made)}, not {_either([_a(artifact) for artifact in wanted])}{hint}"


def order_stages(declared: dict[str, Declared], problems: ProblemList) -> list[tuple[str, dict[str, Source]]]:
    """Return (stage, inputs) in the order in which they can run; what cannot be wired goes to `problems`."""
    nodes = [
        StageSignature(
            stage.name,
            stage.output,
            {entry.name: entry.artifact for entry in stage.inputs},
            frozenset(entry.name for entry in stage.inputs if entry.optional),
            stage.given,
            frozenset(entry.name for entry in stage.inputs if entry.many and not entry.named),
        )
        for stage in declared.values()
    ]
    wires, unsettled = wire(nodes)
    for name, stage in declared.items():
        for own in stage.inputs:
            if own.named and own.name in wires[name]:
                wires[name][own.name] = each(wires[name][own.name])
            if not own.many and wires[name].get(own.name) == ():  # an empty list: it stays away
                del wires[name][own.name]
    missing: dict[type[Artifact], list[Open]] = {}
    for entry in unsettled:
        if not declared[entry.stage].known:  # its plugin is a guess
            continue
        if entry.candidates:
            _tell_ambiguous(entry, declared[entry.stage], problems)
        else:
            missing.setdefault(entry.artifact, []).append(entry)
    # A stage that could not be understood may be the one that was meant to feed the others.
    riddle = any(stage.output is None for stage in declared.values())
    for artifact, entries in missing.items():
        if not riddle:
            _tell_missing(artifact, entries, declared, problems)
    certain = {
        name: {p: s for p, s in stage.given.items() if s is not None}
        if riddle or not stage.known
        else wires[name]
        for name, stage in declared.items()
    }
    for cycle in cycles(certain):
        _tell_cycle(cycle, certain, declared[cycle[0]], problems)
    return [] if problems.problems else [(name, wires[name]) for name in in_order(wires)]


def _tell_ambiguous(entry: Open, stage: Declared, problems: ProblemList) -> None:
    lines = _either([f"`inputs: {{{entry.parameter}: {name}}}`" for name in entry.candidates])
    makers = f"{', '.join(entry.candidates[:-1])} and {entry.candidates[-1]}"
    message = f"ambiguous: {makers} each make {_a(entry.artifact)}; write {lines}"
    asked = next(one for one in stage.inputs if one.name == entry.parameter)
    if asked.many:
        message += f", or of several a list, `inputs: {{{entry.parameter}: [{', '.join(entry.candidates)}]}}`"
    if asked.optional:
        message += f", or `inputs: {{{entry.parameter}: []}}` for none"
    problems.add(_mark(stage), ("stages", stage.name, "inputs", entry.parameter), message)


def _tell_missing(
    artifact: type[Artifact], entries: list[Open], declared: dict[str, Declared], problems: ProblemList
) -> None:
    """Report a type that nobody makes once, at the first stage that needs it."""
    stage = declared[entries[0].stage]
    others = [name for name in dict.fromkeys(entry.stage for entry in entries) if name != stage.name]
    needed = f" (so does {' and '.join(others)})" if others else ""
    kinds = _either([kind.kind for kind in KINDS if issubclass(kind.output, artifact)])
    message = (
        f"'{stage.name}' needs {_a(artifact)}{needed}, and no stage makes one; add a stage of kind {kinds}"
    )
    problems.add(_mark(stage), ("stages", stage.name, "inputs", entries[0].parameter), message)


def _tell_cycle(cycle: list[str], wires: Wires, stage: Declared, problems: ProblemList) -> None:
    parameter = next(p for p, source in wires[cycle[0]].items() if cycle[-2] in each(source))
    problems.add(
        _mark(stage),
        ("stages", stage.name, "inputs", parameter),
        f"cycle: {' -> '.join(cycle)}, each feeds the next; let '{stage.name}' take another stage than "
        f"'{cycle[-2]}', by `inputs: {{{parameter}: ...}}`",
    )


def _mark(stage: Declared) -> Mark:
    """Return where to point for the inputs of a stage: at `inputs`, else at the stage."""
    return stage.node.keys.get("inputs", stage.mark)


def _a(artifact: type[Artifact]) -> str:
    name = artifact.__name__
    if name.endswith("s"):
        return name
    return f"an {name}" if name[0] in "AEIOU" or name == "Frf" else f"a {name}"


def _either(texts: list[str]) -> str:
    return " or ".join(texts)
