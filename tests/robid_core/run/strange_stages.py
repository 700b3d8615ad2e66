"""A stranger's package of stages, small and quick, with switches for everything that can go wrong.

Each call of a stage leaves a line in the file that STRANGE_CALLS names, so that tests see what really ran.
"""

from __future__ import annotations

import dataclasses
import os
import time
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from robid_core import (
    Acquisition,
    CandidateDesign,
    Channel,
    Configurations,
    Context,
    DataPath,
    DenseRun,
    Design,
    Diagnosis,
    DiagnosisStage,
    Doubt,
    Drives,
    Estimator,
    ExperimentDesign,
    Fit,
    Frf,
    FrfEstimator,
    MotionRefused,
    NotTrustworthy,
    OpenDrives,
    ParameterTable,
    Record,
    Report,
    ReportStage,
    Robot,
    Session,
    Truth,
)

BIAS = 0.0  # tests edit this line


def called(name: str) -> None:
    """Leave a trace of a call."""
    path = os.environ.get("STRANGE_CALLS")
    if path:
        with Path(path).open("a", encoding="utf-8") as file:
            file.write(name + "\n")


def square(values: Any, power: int) -> Any:
    """A parallel task whose last digit depends on the order of its sum."""
    return np.sum(values[::3] ** power, axis=0)


class Where(CandidateDesign):
    """Random configurations."""

    count: int = 3
    """How many."""

    def run(self, robot: Robot, context: Context) -> Configurations:
        called("where")
        return Configurations(robot.axis_names, context.generator.normal(size=(self.count, robot.n_axis)))


class FromFile(CandidateDesign):
    """Configurations from a file of the data folder."""

    path: DataPath
    """The file."""

    def run(self, robot: Robot, context: Context) -> Configurations:
        called("where")
        values = np.loadtxt(context.data_root / self.path, ndmin=2)
        return Configurations(robot.axis_names, values)


class Measure(Acquisition):
    """Measures, or pretends to."""

    noise: float = 0.1
    """How much."""
    seconds: float = 0.0
    """How long it takes."""
    fault: str = ""
    """What goes wrong."""
    test: tuple[int, ...] = ()
    """Configurations that are held out."""
    variants: tuple[str, ...] = ()
    """Of each configuration."""

    def run(self, configurations: Configurations, drives: Drives, context: Context) -> Record:
        called("acquire")
        if self.fault == "refused":
            raise MotionRefused("D03: too fast; nothing was sent")
        n_config, n_axis = configurations.angle.shape
        for index in range(10):
            context.progress(index, 10, "measuring")
            time.sleep(self.seconds / 10)
        if self.fault == "killed":
            os._exit(9)
        if self.fault:
            raise RuntimeError(self.fault)
        shape = (n_config, 1, 1, 1, 64, n_axis)
        values = (
            context.generator.normal(size=shape) * self.noise
            + configurations.angle[:, None, None, None, None]
        )
        channel = Channel("motor", "rad", values)
        run = DenseRun(
            0.001,
            {"motor_position": channel},
            np.arange(64) * 0.001,
            np.ones(shape[:-1], dtype=bool),
            np.isin(np.arange(n_config), self.test).reshape(n_config, 1, 1),
        )
        return Record(
            configurations.axis_names,
            "strange",
            "zero_order_hold",
            (run,),
            configurations.angle,
            variants=self.variants,
        )


class Respond(FrfEstimator):
    """A response, computed with parallel work."""

    power: int = 2
    """Of what is summed."""
    digits: int | None = None
    """Rounding of the result."""

    def run(self, record: Record, context: Context) -> Frf:
        called("frf")
        blocks = record.run.values("motor_position").reshape(len(record.angle), 64, -1)
        sums = context.map(square, [(block[:, ::-1], self.power) for block in blocks])
        response = np.array(sums)[:, None, :, None] * np.eye(blocks.shape[2]) + 0j + BIAS
        if self.digits is not None:
            response = np.round(response, self.digits)
        return Frf(
            record.axis_names,
            "strange",
            "none",
            0.001,
            "zero_order_hold",
            record.angle,
            np.array([1.0]),
            response,
        )


class Estimate(Estimator):
    """A fit that does what its settings say."""

    outcome: str = "converged"
    """converged, not converged, doubted, refused, raises, exits, a list, nan, clock."""
    rows: int = 1
    """How many parameters."""
    hold: float = 0.0
    """Seconds that it takes."""

    def run(self, robot: Robot, frf: Frf, context: Context) -> Fit:
        called("fit")
        time.sleep(self.hold)
        context.log.info("fitting %s", self.outcome)
        if self.outcome == "refused":
            raise NotTrustworthy("the numbers would be wrong; measure longer")
        if self.outcome == "raises":
            raise ZeroDivisionError("a stranger's mistake\nwith a second line")
        if self.outcome == "exits":
            raise SystemExit(3)
        if self.outcome == "a list":
            return [1, 2]  # type: ignore[return-value]
        value = float(np.abs(frf.response).mean())
        if self.outcome == "nan":
            value = float("nan")
        if self.outcome == "clock":
            value = float(time.perf_counter_ns())
        if self.outcome == "memory":
            value = float(np.ones(10**9).sum())
        n = self.rows
        table = ParameterTable(
            tuple(f"gear_stiffness.axis_{index + 1}" for index in range(n)),
            ("N m/rad",) * n,
            ("stiffness",) * n,
            np.ones(n),
            np.full(n, value),
            np.full(n, 0.1),
            np.ones(n, dtype=bool),
            np.zeros(n, dtype=bool),
        )
        converged = self.outcome != "not converged"
        status = "converged" if converged else "the budget of 3 steps is spent"
        if self.outcome == "doubted":
            own = Doubt("weather", "it rained, and the cell was wet", "wait for the sun")
            return Fit("strange", status, True, 1.5, 8, 3, table, np.eye(1), stated_doubts=(own,))
        own = Doubt("weather", "it rained, and the errors count it", "wait for the sun", "remark")
        stated = (own,) if self.outcome == "remarked" else ()
        return Fit("strange", status, converged, 1.0, 1, 1, table, np.eye(1), stated_doubts=stated)


class Combine(Estimator):
    """A fit of all responses together, and of records where there are any."""

    def run(self, frfs: tuple[Frf, ...], records: tuple[Record, ...] = ()) -> Fit:
        called("combine")
        means = np.array([np.abs(frf.response).mean() for frf in frfs])
        n = len(means)
        table = ParameterTable(
            tuple(f"gear_stiffness.axis_{index + 1}" for index in range(n)),
            ("N m/rad",) * n,
            ("stiffness",) * n,
            np.ones(n),
            means,
            np.full(n, 0.1),
            np.ones(n, dtype=bool),
            np.zeros(n, dtype=bool),
        )
        return Fit("strange", f"of {len(records)} records", True, 1.0, 1, 1, table, np.eye(n))


class Identify(Estimator):
    """A fit that gives back a model."""

    stiffness: float = 6e4
    """What it finds."""
    converged: bool = True
    """Whether it may be used."""
    effect: str = ""
    """One that it adds."""
    named: bool = True
    """Whether it says so."""
    misfit: float = 1.0
    """How well it explains what was measured."""

    def uses(self) -> list[tuple[str, str]]:
        return [("robid.effects", self.effect)] if self.effect and self.named else []

    def run(self, robot: Robot) -> Fit:
        called("identify")
        if self.effect:
            entry = {"use": self.effect, "on": "axis_1"}
            whole = robot.description.model_dump() | {"effects": {"found": entry}}
            robot = dataclasses.replace(robot, description=type(robot.description).model_validate(whole))
        names = ("gear_stiffness.axis_1",)
        table = ParameterTable(
            names, ("N m/rad",), ("stiffness",), np.array([robot.parameter(names[0])]), np.array([self.stiffness]),
            np.array([100.0]), np.array([True]), np.array([False]),
        )  # fmt: skip
        model = robot.model({names[0]: self.stiffness}, names, np.array([[1e4]]))
        status = "converged" if self.converged else "too few data"
        return Fit("strange", status, self.converged, self.misfit, 1, 1, table, np.eye(1), names, model=model)


class Explain(DiagnosisStage):
    """A diagnosis that finds a ripple that the fit does not have."""

    def uses(self) -> list[tuple[str, str]]:
        return [("robid.effects", "drive.torque_ripple")]

    def run(self, robot: Robot, fit: Fit) -> Diagnosis:
        called("explain")
        fitted = robot.fitted(fit)
        entry = {"use": "drive.torque_ripple", "on": "axis_1", "with": {"amplitude": 0.1}}
        whole = fitted.description.model_dump() | {"effects": {"ripple": entry}}
        found = dataclasses.replace(fitted, description=type(fitted.description).model_validate(whole))
        return Diagnosis("strange", "The motor has a ripple.", model=found.model({}))


class Tell(CandidateDesign):
    """Configurations that tell the stiffness of the robot that it is lent, and how many effects act in it."""

    def run(self, robot: Robot) -> Configurations:
        called("tell")
        told = [[robot.parameter("gear_stiffness.axis_1")], [float(len(robot.effects))]]
        return Configurations(robot.axis_names, np.array(told))


class Choose(ExperimentDesign):
    """Chooses, from a converged fit only."""

    experiments: int = 4
    """How many."""

    def run(self, fit: Fit, configurations: Configurations) -> Design:
        called("choose")
        if not fit.converged:
            raise NotTrustworthy("the fit it stands on did not converge")
        one = np.ones(1)
        return Design(
            configurations.axis_names,
            configurations.angle[:1],
            criterion="D",
            parameter_names=("gear_stiffness.axis_1",),
            gap=0.0,
            efficiency=1.0,
            weight=one,
            experiments=np.array([self.experiments]),
            candidate_index=np.array([0]),
            information=np.eye(1),
            predicted_standard_error=one,
        )


class Page(ReportStage):
    """A page."""

    title: str = "strange"
    """On top."""

    def run(self, fit: Fit, design: Design | None = None, truth: Truth | None = None) -> Report:
        called("page")
        true = truth.value[0] if truth is not None else "?"
        chosen = "chosen" if design is not None else "no design"
        return Report(
            f"<h1>{self.title}</h1><p>{fit.parameters.estimate[0]!r} {true} {fit.status} {chosen}</p>"
        )


class Simulated(Drives):
    """Nothing moves."""

    moves_hardware: ClassVar[bool] = False

    stiffness: float = 2.0
    """Of the plant."""

    def open(self, session: Session) -> OpenDrives:
        raise NotImplementedError

    def truth(self, robot: Robot) -> Truth:
        return Truth("strange", ("gear_stiffness.axis_1",), np.array([self.stiffness]))


class Hardware(Drives):
    """Says that it moves a robot."""

    address: str = "here"
    """Where."""

    def open(self, session: Session) -> OpenDrives:
        raise NotImplementedError
