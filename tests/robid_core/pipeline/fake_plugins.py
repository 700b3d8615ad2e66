"""A small world of plugins for the tests of pipeline files: every kind, none of them does anything."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt, model_validator

from robid_core import (
    Acquisition,
    CandidateDesign,
    ConfigurationError,
    Configurations,
    DataPath,
    DataRejected,
    Design,
    DiagnosisStage,
    Drives,
    Estimator,
    Excitation,
    ExcitationDesign,
    ExperimentDesign,
    Fit,
    Frf,
    FrfEstimator,
    OpenDrives,
    Preprocessing,
    ProjectPath,
    Record,
    Report,
    ReportStage,
    Robot,
    Session,
    Settings,
    StageRef,
)


class Candidates(CandidateDesign):
    """Some configurations."""

    count: PositiveInt
    """How many."""

    def run(self, robot: Robot) -> Configurations:
        raise NotImplementedError


class Multisine(ExcitationDesign):
    """A multisine."""

    band_hz: tuple[PositiveFloat, PositiveFloat]
    """Lowest and highest frequency."""
    lines: PositiveInt = 100
    """How many."""
    odd: bool = True
    """Odd bins only."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.band_hz[0] >= self.band_hz[1]:
            raise ValueError(f"band_hz: {self.band_hz[0]:g} Hz is not below {self.band_hz[1]:g} Hz")
        return self

    def run(self, robot: Robot, configurations: Configurations) -> Excitation:
        raise NotImplementedError


class DriveAcquisition(Acquisition):
    """Measures."""

    periods: Annotated[int, Field(gt=0)] = 2
    """Periods that are kept."""
    settle_periods: NonNegativeInt = 1
    """Periods dropped before."""

    def run(self, drives: Drives, configurations: Configurations, excitation: Excitation) -> Record:
        raise NotImplementedError


class Filter(Settings):
    """A filter."""

    order: PositiveInt = 4
    cutoff_hz: PositiveFloat


class Recorded(Acquisition):
    """Reads."""

    origin: str = ""
    path: DataPath
    """The recording."""
    channels: ProjectPath | None = None
    filters: tuple[Filter, ...] = ()
    reader: str = ""

    def external_files(self, data_root: Path) -> list[Path]:
        if self.origin == "nowhere":
            raise DataRejected("the second half\nis not there")
        if self.origin == "broken":
            raise KeyError("half")
        return []

    def uses(self) -> list[tuple[str, str]]:
        return [("robid.records", self.reader)] if self.reader else []

    def run(self) -> Record:
        raise NotImplementedError


class Clean(Preprocessing):
    """A better record."""

    def run(self, record: Record) -> Record:
        raise NotImplementedError


class LogMean(FrfEstimator):
    """Logarithmic mean."""

    discard: NonNegativeInt = 0
    """Leading periods dropped."""

    def run(self, record: Record) -> Frf:
        raise NotImplementedError


class LogFit(Estimator):
    """Fits."""

    starts: PositiveInt = 20
    """Random starts."""
    tolerance: PositiveFloat = 1e-8
    criterion: Literal["response", "log_response"] = "log_response"
    estimator: StageRef = StageRef(use="frf.log")

    def run(self, robot: Robot, frf: Frf) -> Fit:
        raise NotImplementedError


class Choosy(Estimator):
    """Fits some axes."""

    axes: tuple[str, ...] = ("axis_1",)
    weights: dict[str, PositiveFloat] = {}
    fault: str = ""

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        if self.fault == "refuses":
            raise ConfigurationError("not with this one")
        if self.fault == "fails":
            raise ZeroDivisionError("a stranger's mistake")
        if self.fault == "whole":
            return {(): "these settings do not go together"}
        listed = {("axes", i): name for i, name in enumerate(self.axes)}
        listed |= {("weights", name): name for name in self.weights}
        return {p: f"no axis '{name}'" for p, name in listed.items() if name not in robot.axis_names}

    def run(self, robot: Robot, frf: Frf) -> Fit:
        raise NotImplementedError


class JointFit(Estimator):
    """Fits all responses together, with what records there are."""

    def run(self, robot: Robot, frfs: tuple[Frf, ...], records: tuple[Record, ...] = ()) -> Fit:
        raise NotImplementedError


class Optimal(ExperimentDesign):
    """Chooses."""

    def run(self, robot: Robot, fit: Fit, frf: Frf) -> Design:
        raise NotImplementedError


class Page(ReportStage):
    """Shows."""

    def run(self, fit: Fit | None = None, design: Design | None = None, frf: Frf | None = None) -> Report:
        raise NotImplementedError


class Explain(DiagnosisStage):
    """A stage whose run breaks the contract."""

    def run(self, record: int) -> None:  # not an artifact
        raise NotImplementedError


class NoDrives(Drives):
    """Stands in for drives."""

    plant: str = "six_axis_true"
    bitrate: PositiveInt = 1_000_000

    def open(self, session: Session) -> OpenDrives:
        raise NotImplementedError


def pool(workers: int = 2, *, address: str | None = None) -> None:
    """An executor that is a function."""


not_a_stage = 3
