"""A stage as a function: settings checked as in a pipeline file, inputs told by their type, everything else lent."""

from __future__ import annotations

import inspect
import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from robid_core.artifacts import Artifact, Truth
from robid_core.compiled.telling import compilation_told
from robid_core.drives import Drives
from robid_core.errors import ConfigurationError, PluginError
from robid_core.executors import one_thread
from robid_core.pipeline.places import find_places
from robid_core.pipeline.resolving import Declared, Resolver
from robid_core.pipeline.robot_check import check_against_robot
from robid_core.registry import registry
from robid_core.robot import Robot
from robid_core.run.arguments import arguments_of
from robid_core.run.identity import child_generator
from robid_core.run.lent_robot import robot_from
from robid_core.stage import MODELLED, Context, Stage, map_in_process
from robid_core.yaml_file.kind import PIPELINE_FILE
from robid_core.yaml_file.nodes import Node
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.plain_values import plain_value
from robid_core.yaml_file.problems import ProblemList

FILE = Path("notebook")  # paths in settings begin in the folder in which Python runs


def use(stage: str | type[Stage], **settings: Any) -> StageFunction:
    """Return a stage as a function: `use: frf.log, with: {...}` of a pipeline, in Python.

    Parameters
    ----------
    stage
        Name of a stage (`robid stages` lists them), or a class of your own.
    settings
        What stands under `with:`; lists, tuples and arrays of numbers alike.

    Raises
    ------
    ConfigurationError
        With every mistake, a line each, as `robid validate` reports them.

    Examples
    --------
    >>> import robid_core as robid
    >>> robot = robid.Robot.load("one_axis")
    >>> candidates = robid.use("design.candidates", count=3)
    >>> print(str(candidates).partition(";")[0])
    design.candidates(count=3): it takes robot: Robot and makes a Configurations
    >>> where = candidates(robot)
    >>> type(where).__name__, where.angle.shape
    ('Configurations', (3, 1))
    >>> robid.use("design.candidates", cuont=3)
    Traceback (most recent call last):
    robid_core.errors.ConfigurationError: design.candidates: cuont: unknown key 'cuont'; did you mean 'count'?
    """
    name = stage if isinstance(stage, str) else stage.__name__
    problems = ProblemList(name)
    text = json.dumps({"use": name, "with": settings}, default=plain_value)
    node = read_nodes(text, PIPELINE_FILE, problems)
    resolver = Resolver(registry(), find_places(FILE), problems)
    if node is None:
        declared = None
    elif isinstance(stage, str):
        declared = resolver.stage(name, node, node.mark)
    else:
        declared = _declared(resolver, stage, name, node)
    _raise_all(name, problems)
    if declared is None or declared.stage is None:
        raise ConfigurationError(f"'{name}' is not a stage")
    return StageFunction(name, declared)


@dataclass(frozen=True, repr=False)
class StageFunction:
    """A stage with its settings; called with artifacts and a robot, it gives the artifact that the stage makes.

    What is given finds its parameter by its type, or by name. A `Fit` or a `Diagnosis` in place of a robot is the robot
    that it found, as `inputs: {robot: fit}` says in a pipeline. Everything is computed in this process, with the seed
    as the only source of chance: equal calls give equal bytes.
    """

    name: str
    declared: Declared

    @property
    def stage(self) -> Stage:
        """The stage itself."""
        assert self.declared.stage is not None
        return self.declared.stage

    def __call__(self, *given: Any, seed: int = 0, context: Context | None = None, **named: Any) -> Any:
        """Run the stage.

        Parameters
        ----------
        given
            Artifacts, a robot, drives: each goes to the parameter of its type; of several fits each to the next that is
            free, a list to one that takes many.
        seed
            Of all chance.
        context
            What is lent in place of a default one: generator, map, progress, log, data root.
        named
            By the parameter's name: `stage(record, robot=fit)`.

        Raises
        ------
        ConfigurationError
            Where something is missing, or is not what the stage takes.
        RobidError
            As the stage says.
        """
        found = _placed(self, given, named)
        lends = self.stage.lends()
        artifacts = {
            entry.name: found.pop(entry.name) for entry in self.stage.inputs() if entry.name in found
        }
        missing = [
            f"{entry.name}: {entry.noun}"
            for entry in self.stage.inputs()
            if not entry.optional and not artifacts.get(entry.name)
        ]
        missing += [
            f"{name}: {kind.__name__}" for name, kind in lends.items() if name not in found and _needed(kind)
        ]
        if missing:
            raise ConfigurationError(f"{self.name} needs {' and '.join(missing)}; {self.signature}")
        log = logging.getLogger(f"robid.{self.name}")
        arguments: dict[str, Any] = {**arguments_of(self.stage, artifacts, log)}
        for name, kind in lends.items():
            arguments[name] = found.get(name)
            if kind is Context:
                arguments[name] = context or default_context(self.name, seed)
        robot = next((one for one in found.values() if isinstance(one, Robot)), None)
        if robot is not None:
            problems = ProblemList(self.name)
            check_against_robot([self.declared], lambda: robot, self.declared.mark, problems)
            _raise_all(self.name, problems)
        with one_thread(), compilation_told():
            result = self.stage.run(**arguments)
        if not isinstance(result, self.stage.output):
            wanted = self.stage.output.__name__
            raise PluginError(f"{self.name}: run gives a {type(result).__name__}, not a {wanted}")
        return result

    @property
    def signature(self) -> str:
        """Say what the stage takes and makes."""
        takes = [f"{entry.name}: {entry.noun}" for entry in self.stage.inputs()]
        takes += [f"{name}: {kind.__name__}" for name, kind in self.stage.lends().items() if _needed(kind)]
        return f"it takes {', '.join(takes) or 'nothing'} and makes a {self.stage.output.__name__}"

    def __repr__(self) -> str:
        """Return what it is set to beside the defaults, takes and makes, and where its settings are explained."""
        said = self.stage.model_dump(mode="json", by_alias=True, exclude_defaults=True)
        settings = ", ".join(f"{key}={value!r}" for key, value in said.items())
        return f"{self.name}({settings}): {self.signature}; its settings: robid stages {self.name}"

    def _repr_html_(self) -> str:
        """Return what a notebook shows of it: what it does, takes and is set to."""
        first = (inspect.getdoc(type(self.stage)) or "").partition("\n")[0]
        settings = json.dumps(self.stage.model_dump(mode="json", by_alias=True))
        parts = (self.name, first, self.signature, settings)
        name, doc, signature, shown = (escape(part) for part in parts)
        return f"<div><b>{name}</b> {doc}<p>{signature}</p><code>{shown}</code></div>"


def default_context(name: str, seed: int = 0) -> Context:
    """Return what a stage is lent outside of a pipeline: seeded chance, this process, silence, the data folder."""

    def progress(done: float, total: float, note: str = "") -> None:
        del done, total, note

    log = logging.getLogger(f"robid.{name}")
    return Context(child_generator(seed, name), map_in_process, progress, log, find_places(FILE).data_root)


def _declared(resolver: Resolver, cls: type[Stage], name: str, node: Node) -> Declared:
    """Return a class that is not registered as a stage with its settings."""
    checked = resolver.settings(cls, node, ("stages", name), node.mark)
    declared = Declared(name, node, node.mark)
    if checked is not None and isinstance(checked[0], Stage):
        declared.stage, declared.files = checked[0], checked[1]
    return declared


def _raise_all(name: str, problems: ProblemList) -> None:
    """Raise ConfigurationError with every problem, its place in the settings in place of a line in a file."""
    if problems.problems:
        lines = [
            f"{name}: " + ": ".join(filter(None, (_setting(problem.path, name), problem.message)))
            for problem in problems.problems
        ]
        raise ConfigurationError("\n".join(dict.fromkeys(lines)))


def _setting(path: str, name: str) -> str:
    """Return `band_hz[0]` of `stages.NAME.with.band_hz[0]`; nothing of the stage as a whole."""
    inner = path.removeprefix(f"stages.{name}").removeprefix(".")
    return "" if inner in ("with", "use") else inner.removeprefix("with.")


def _needed(kind: type) -> bool:
    return kind is not Context and kind is not Truth


def _placed(function: StageFunction, given: Sequence[Any], named: Mapping[str, Any]) -> dict[str, Any]:
    """Return the artifacts (as lists) and what is lent, by parameter."""
    stage = function.stage
    inputs = {entry.name: entry for entry in stage.inputs()}
    lends = stage.lends()
    found: dict[str, Any] = {}
    for name, value in named.items():
        if name in inputs:
            found[name] = list(value) if isinstance(value, list | tuple) else [value]
            wrong = [one for one in found[name] if not isinstance(one, inputs[name].artifact)]
            if wrong or (len(found[name]) > 1 and not inputs[name].many):
                told = type(wrong[0]).__name__ if wrong else "several"
                raise ConfigurationError(f"{function.name}: {name} is a {inputs[name].noun}, not {told}")
        elif name in lends:
            found[name] = _lent(lends[name], value)
        else:
            raise ConfigurationError(f"{function.name} has no parameter '{name}'; {function.signature}")
    for value in given:
        several = list(value) if isinstance(value, list | tuple) else [value]
        place = next((name for name, entry in inputs.items() if _takes(entry, name, several, found)), None)
        if place is not None:
            found.setdefault(place, []).extend(several)
            continue
        place = next((name for name, kind in lends.items() if name not in found and _fits(kind, value)), None)
        if place is None:
            raise ConfigurationError(
                f"{function.name} takes no {type(value).__name__} here; {function.signature}"
            )
        found[place] = _lent(lends[place], value)
    return found


def _takes(entry: Any, name: str, values: Sequence[Any], found: Mapping[str, Any]) -> bool:
    """Whether an input can take these values and is free."""
    free = entry.many or (name not in found and len(values) == 1)
    return free and bool(values) and all(isinstance(one, entry.artifact) for one in values)


def _fits(kind: type, value: Any) -> bool:
    return isinstance(value, kind) or (kind is Robot and isinstance(value, MODELLED))


def _lent(kind: type, value: Any) -> Any:
    """Return what a stage is lent: of a fit the robot that it found, of a name the robot of that name."""
    if kind is Robot and isinstance(value, Artifact):
        return robot_from(value, type(value).__name__, "kernel")
    if kind is Robot and isinstance(value, str):
        return Robot.load(value)
    if not isinstance(value, kind):
        hint = (
            ", as load_plugin('robid.drives', 'simulated')(plant='six_axis_true')" if kind is Drives else ""
        )
        raise ConfigurationError(f"a {kind.__name__} is wanted, not a {type(value).__name__}{hint}")
    return value
