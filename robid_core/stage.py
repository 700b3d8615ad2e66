"""Stages: settings plus one method `run`.

A kind fixes the output type; inputs are the annotations of `run`. Artifacts are wired by their type, and
`Robot`, `Drives`, `Context` (and `Truth`, for reports only) are handed in. An input annotated
``Frf | None = None`` is optional; ``tuple[Frf, ...]`` takes one or more, ``tuple[Frf, ...] = ()`` any number. The robot
is the nominal one, or, where `inputs:` names a stage that makes one of `MODELLED`, what that stage found.
"""

from __future__ import annotations

import inspect
import logging
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict

from robid_core.artifacts import (
    Artifact,
    Configurations,
    Design,
    Diagnosis,
    Excitation,
    Fit,
    Frf,
    Record,
    Report,
    Truth,
)
from robid_core.drives import Drives
from robid_core.errors import PluginError
from robid_core.robot import Robot
from robid_core.robot.file.left_out import AxisKey
from robid_core.yaml_file.problems import KeyPath

MILESTONE = logging.INFO + 5
"""Level of what long work has found so far: a diagnosis' causes. The command line shows it when it is logged."""
logging.addLevelName(MILESTONE, "FOUND")


class Settings(BaseModel):
    """Base of everything that YAML sets: unknown keys forbidden, types strict as JSON, immutable."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class Progress(Protocol):
    """Reports how far a long piece of work has come."""

    def __call__(self, done: float, total: float, note: str = "") -> None:
        """Report `done` of `total`; `note` says what is going on ("compiling kernels, once")."""


class MapTasks(Protocol):
    """The only parallel primitive: runs a registered function over plain arguments, results in order."""

    def __call__(self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Call a module-level `function` once per tuple of plain values and arrays."""


@dataclass(frozen=True)
class Context:
    """Services of a run for its stages: random numbers, parallel work, progress and log.

    >>> from robid_core.testing import example_context
    >>> context = example_context()
    >>> context.map(max, [(1, 2), (3, 4)]), list(context.track("ab", 2))
    ([2, 4], ['a', 'b'])
    """

    generator: np.random.Generator
    map: MapTasks
    progress: Progress
    log: logging.Logger
    data_root: Path = Path()
    """Where data outside the project are read from (ROBID_DATA)."""
    scratch: Path | None = None
    """A folder of the run for logs that are no artifacts; None: keep none."""
    run_name: str = ""
    """Of a report: the name of the run."""
    warnings: tuple[str, ...] = ()
    """Of a report: what the stages before it warned of, alike ones as one sentence."""

    def track(self, items: Iterable[Any], total: int, note: str = "") -> Iterator[Any]:
        """Yield the items, reporting progress before each and after the last."""
        for index, item in enumerate(items):
            self.progress(index, total, note)
            yield item
        self.progress(total, total, note)


def map_in_process(function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
    """Run tasks one after another in this process."""
    return [function(*argument) for argument in arguments]


@dataclass(frozen=True)
class Input:
    """One wired parameter of `run`; `many` where it takes a tuple of artifacts.

    `named`: of many it takes more than one only where the pipeline names them.
    """

    name: str
    artifact: type[Artifact]
    optional: bool
    many: bool = False
    named: bool = False

    @property
    def noun(self) -> str:
        """Say for people what it takes."""
        what = self.artifact.__name__
        if self.many:
            return f"{what} ({'any number' if self.optional else 'one or more'})"
        return f"{what} (optional)" if self.optional else what


class Stage(Settings):
    """Base of all stages; subclass one of the kinds below.

    Of a record a stage gets what it says it can use: where `sees_test` is false, the experiments that are held out
    for tests are left out; where `handles_variants` is false, a record of several variants (payloads, tools) is
    refused. Where `needs_lines` is true, `robid validate` refuses a record of an excitation, or of recordings,
    without lines. Where `names_several` is true, an input that takes many takes one, or those that the pipeline names:
    all that there are might be held-out data.
    """

    kind: ClassVar[str] = ""
    output: ClassVar[type[Artifact]] = Artifact
    sees_test: ClassVar[bool] = True
    handles_variants: ClassVar[bool] = True
    needs_lines: ClassVar[bool] = False
    names_several: ClassVar[bool] = False

    run: ClassVar[Callable[..., Any]]

    def plan_lines(self, upstream: Mapping[str, Stage]) -> list[str]:
        """Say for `robid plan` what the stage will ask of the robot.

        `upstream` holds the stages that it takes from, by input (of many: `records[0]`, `records[1]`, ...).
        """
        del upstream
        return []

    def external_files(self, data_root: Path) -> list[Path]:
        """Files outside the project that the stage reads: their hashes become part of its key.

        Asked when the pipeline is read, too: a RobidError that it raises is reported among the problems of the file.
        """
        del data_root
        return []

    def needs_of_axes(self) -> Sequence[AxisKey]:
        """Say which keys of the robot file's axes it cannot do without, of those that a file may leave out.

        `robid validate` and `robid run` refuse a robot file that lacks one, before anything runs.
        """
        return ()

    def problems_with(self, robot: Robot) -> Mapping[KeyPath, str]:
        """Say which settings this robot cannot have, before anything runs; empty where there are none.

        `robid validate` and `robid run` ask with the nominal robot and tell each message at its place in the file: a
        path inside the settings, as ``("free", 0)`` or ``("prior", "mass.*")``; the empty path is the stage as a whole.
        """
        del robot
        return {}

    def problems_with_files(self, robot: Robot, data_root: Path) -> Mapping[KeyPath, str]:
        """Say which settings do not go with the data files that they lead to, as `problems_with` does.

        Asked whenever a pipeline is read and `problems_with` says nothing: it has to be quick, whatever the files'
        size, and passes over what is damaged or takes long; the run reports that.
        """
        del robot, data_root
        return {}

    @classmethod
    def inputs(cls) -> tuple[Input, ...]:
        """Return the artifacts that `run` takes, in order."""
        return tuple(
            Input(name, annotation, optional, many, many and cls.names_several)
            for name, annotation, optional, many in _parameters(cls)
            if issubclass(annotation, Artifact) and annotation is not Truth
        )

    @classmethod
    def lends(cls) -> dict[str, type]:
        """Return the parameters of `run` that the framework hands in: Robot, Drives, Context, Truth."""
        lent = {
            name: annotation
            for name, annotation, _, _ in _parameters(cls)
            if not issubclass(annotation, Artifact) or annotation is Truth
        }
        for name, annotation in lent.items():
            if annotation is Truth and cls.kind != "report":
                raise PluginError(f"{cls.__name__}.run: only a report may see the truth ('{name}: Truth')")
        return lent


def _parameters(cls: type[Stage]) -> list[tuple[str, type, bool, bool]]:
    """Return (name, class, optional, many) of each parameter of `run` after self."""
    run = cls.__dict__.get("run") or getattr(cls, "run", None)
    if run is None:
        raise PluginError(f"stage {cls.__name__} has no method `run`")
    hints = typing.get_type_hints(run)
    result = []
    for parameter in list(inspect.signature(run).parameters.values())[1:]:
        if parameter.name not in hints:
            raise PluginError(f"{cls.__name__}.run: parameter '{parameter.name}' has no annotation")
        hint, optional = hints[parameter.name], False
        if typing.get_origin(hint) in (typing.Union, types.UnionType):
            members = [a for a in typing.get_args(hint) if a is not type(None)]
            optional = len(members) < len(typing.get_args(hint))
            hint = members[0] if len(members) == 1 else None
        many = typing.get_origin(hint) is tuple and typing.get_args(hint)[1:] == (Ellipsis,)
        if many:
            hint = None if optional else typing.get_args(hint)[0]
            optional = parameter.default == ()
        known = Artifact if many else (Artifact, Robot, Drives, Context)
        if not (isinstance(hint, type) and issubclass(hint, known) and not (many and hint is Truth)):
            raise PluginError(
                f"{cls.__name__}.run: parameter '{parameter.name}' is neither an artifact nor Robot, Drives, Context; "
                "many artifacts are a tuple[Frf, ...], with the default () where there may be none"
            )
        result.append((parameter.name, hint, optional, many))
    return result


class CandidateDesign(Stage):
    """Kind `configurations`: proposes configurations of the robot, from its file alone or from a diagnosis."""

    kind = "configurations"
    output = Configurations


class ExcitationDesign(Stage):
    """Kind `excitation`: designs the motions of the experiments, within limits that must be known."""

    kind = "excitation"
    output = Excitation

    @property
    def excites_lines(self) -> bool:
        """Whether the motion is periodic, with lines that a frequency response can be read at."""
        return True

    def needs_of_axes(self) -> Sequence[AxisKey]:
        """Limits, and the controller whose loop the references act on."""
        return ("torque_limit", "speed_limit", "controller")


class Acquisition(Stage):
    """Kind `acquisition`: measures a record, or reads recordings."""

    kind = "acquisition"
    output = Record

    @property
    def gives_lines(self) -> bool:
        """Whether its records may have excited lines, as far as it is for the settings to say."""
        return True


class Preprocessing(Stage):
    """Kind `preprocess`: removes disturbances from a record, and returns a record."""

    kind = "preprocess"
    output = Record


class FrfEstimator(Stage):
    """Kind `frf`: estimates the frequency response matrix from the training experiments of a record."""

    kind = "frf"
    output = Frf
    sees_test = False
    handles_variants = False


class Estimator(Stage):
    """Kind `fit`: estimates parameters from training experiments; one that takes several variants says so."""

    kind = "fit"
    output = Fit
    sees_test = False
    handles_variants = False


class ExperimentDesign(Stage):
    """Kind `design`: chooses the configurations that are most informative about a fit's parameters."""

    kind = "design"
    output = Design


class DiagnosisStage(Stage):
    """Kind `diagnosis`: compares a model with records, and finds what the model lacks."""

    kind = "diagnosis"
    output = Diagnosis
    handles_variants = False


class ReportStage(Stage):
    """Kind `report`: shows results to people; the only kind that may see the truth of a simulated plant."""

    kind = "report"
    output = Report


MODELLED: tuple[type[Artifact], ...] = (Fit, Diagnosis)
"""What may hold a model of the robot; a stage takes it by `inputs: {robot: <its stage>}`."""

KINDS: tuple[type[Stage], ...] = (
    CandidateDesign,
    ExcitationDesign,
    Acquisition,
    Preprocessing,
    FrfEstimator,
    Estimator,
    ExperimentDesign,
    DiagnosisStage,
    ReportStage,
)


def stage_fault(loaded: Any) -> str:
    """Say why what is registered as a stage is none; empty where it keeps to the contract of its kind."""
    if not (isinstance(loaded, type) and issubclass(loaded, Stage)):
        return "is not a stage: it is no subclass of a kind such as robid_core.FrfEstimator"
    if not loaded.kind:
        return "is of no kind; derive it from one such as robid_core.FrfEstimator"
    try:
        loaded.inputs(), loaded.lends()
    except Exception as error:  # a stranger's annotations
        return f"breaks the contract of stages: {error}"
    return ""
