"""Stages: settings plus one method `run`.

A kind fixes the output type; inputs are the annotations of `run`. Artifacts are wired by their type, and
`Robot`, `Drives`, `Context` (and `Truth`, for reports only) are handed in. An input annotated
``Frf | None = None`` is optional. The robot is the nominal one, or, where `inputs:` names a stage that makes one of
`MODELLED`, what that stage found.
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


class Settings(BaseModel):
    """Base of everything that YAML sets: unknown keys forbidden, types strict as JSON, immutable."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class Progress(Protocol):
    """Tells a person how far a long piece of work is."""

    def __call__(self, done: float, total: float, note: str = "") -> None:
        """Report `done` of `total`; `note` says what is going on ("compiling kernels, once")."""


class MapTasks(Protocol):
    """The only parallel primitive: runs a registered function over plain arguments, results in order."""

    def __call__(self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Call a module-level `function` once per tuple of plain values and arrays."""


@dataclass(frozen=True)
class Context:
    """What a run lends to a stage: chance, parallel work, progress and log."""

    generator: np.random.Generator
    map: MapTasks
    progress: Progress
    log: logging.Logger
    data_root: Path = Path()
    """Where data outside the project are read from (ROBID_DATA)."""
    scratch: Path | None = None
    """A folder of the run for logs that are no artifacts; None: keep none."""

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
    """One wired parameter of `run`."""

    name: str
    artifact: type[Artifact]
    optional: bool


class Stage(Settings):
    """Base of all stages; subclass one of the kinds below."""

    kind: ClassVar[str] = ""
    output: ClassVar[type[Artifact]] = Artifact

    run: ClassVar[Callable[..., Any]]

    def plan_lines(self, upstream: Mapping[str, Stage]) -> list[str]:
        """Say for `robid plan` what the stage will ask of the robot; `upstream` holds the stages it takes from."""
        del upstream
        return []

    def external_files(self, data_root: Path) -> list[Path]:
        """Files outside the project that the stage reads: their hashes become part of its key."""
        del data_root
        return []

    @classmethod
    def inputs(cls) -> tuple[Input, ...]:
        """Return the artifacts that `run` takes, in order."""
        return tuple(
            Input(name, annotation, optional)
            for name, annotation, optional in _parameters(cls)
            if issubclass(annotation, Artifact) and annotation is not Truth
        )

    @classmethod
    def lends(cls) -> dict[str, type]:
        """Return the parameters of `run` that the framework hands in: Robot, Drives, Context, Truth."""
        lent = {
            name: annotation
            for name, annotation, _ in _parameters(cls)
            if not issubclass(annotation, Artifact) or annotation is Truth
        }
        for name, annotation in lent.items():
            if annotation is Truth and cls.kind != "report":
                raise PluginError(f"{cls.__name__}.run: only a report may see the truth ('{name}: Truth')")
        return lent


def _parameters(cls: type[Stage]) -> list[tuple[str, type, bool]]:
    """Return (name, class, optional) of each parameter of `run` after self."""
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
        known = (Artifact, Robot, Drives, Context)
        if not (isinstance(hint, type) and issubclass(hint, known)):
            raise PluginError(
                f"{cls.__name__}.run: parameter '{parameter.name}' is neither an artifact nor Robot, Drives, Context"
            )
        result.append((parameter.name, hint, optional))
    return result


class CandidateDesign(Stage):
    """Kind `configurations`: makes configurations out of nothing but the robot."""

    kind = "configurations"
    output = Configurations


class ExcitationDesign(Stage):
    """Kind `excitation`: decides how the motors are moved."""

    kind = "excitation"
    output = Excitation


class Acquisition(Stage):
    """Kind `acquisition`: measures, or reads what was measured."""

    kind = "acquisition"
    output = Record


class Preprocessing(Stage):
    """Kind `preprocess`: makes a better record out of a record."""

    kind = "preprocess"
    output = Record


class FrfEstimator(Stage):
    """Kind `frf`: estimates the frequency response matrix from a record."""

    kind = "frf"
    output = Frf


class Estimator(Stage):
    """Kind `fit`: estimates parameters."""

    kind = "fit"
    output = Fit


class ExperimentDesign(Stage):
    """Kind `design`: chooses the configurations that tell most."""

    kind = "design"
    output = Design


class DiagnosisStage(Stage):
    """Kind `diagnosis`: says what the simulation gets wrong."""

    kind = "diagnosis"
    output = Diagnosis


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
