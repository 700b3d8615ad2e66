"""What each kind promises beside its shape: a stage that keeps it passes, a wrong one is told what it does wrong."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np
import pytest

from robid_core import (
    Acquisition,
    Channel,
    Configurations,
    Design,
    Diagnosis,
    DiagnosisStage,
    Estimator,
    Excitation,
    ExperimentDesign,
    Fit,
    Frf,
    ParameterTable,
    Record,
    Report,
    ReportStage,
    Robot,
    TimeComparison,
    simulate_record,
)
from robid_core.testing import (
    ContractBroken,
    check_stage,
    example_design,
    example_diagnosis,
    example_fit,
    example_record,
)

NAME = "gear_stiffness.axis_1"


class SpringFit(Estimator):
    """The spring of one axis from its response: a grid of stiffnesses, refined by a parabola; errors by curvature."""

    error_factor: ClassVar[float] = 1.0

    def found(self, frf: Frf, robot: Robot) -> tuple[float, float]:
        began = robot.parameter(NAME)
        deviation = np.sqrt(frf.variance()[..., 0, 0] / 2)
        damping = robot.equivalent_motor_damping(frf.speed_rms, frf.slow_sine_speed)  # type: ignore[arg-type]

        def misfit(scale: float) -> float:
            model = robot.with_parameters({NAME: scale * began}).response(
                frf.angle, frf.frequency_hz, damping
            )
            off = (frf.response - model)[..., 0, 0] / deviation
            return float((np.abs(off) ** 2).sum())

        best = min(np.linspace(0.7, 1.4, 36), key=misfit)
        for step in (0.003, 0.001):
            low, middle, high = (misfit(best + k * step) for k in (-1, 0, 1))
            curvature = (low - 2 * middle + high) / step**2
            best += step * (low - high) / (2 * (low - 2 * middle + high))
        return began * best, began * np.sqrt(2 / curvature)

    def run(self, frf: Frf, robot: Robot) -> Fit:
        estimate, error = self.found(frf, robot)
        table = ParameterTable(
            names=(NAME,),
            units=("N m/rad",),
            groups=("stiffness",),
            start=np.array([robot.parameter(NAME)]),
            estimate=np.array([estimate]),
            standard_error=np.array([self.error_factor * error]),
            reported=np.array([True]),
            at_bound=np.array([False]),
        )
        variance = np.full((1, 1), (self.error_factor * error) ** 2)
        model = robot.model({NAME: abs(estimate)}, (NAME,), variance)
        return Fit(
            "spring", "done", True, 1.0, 1, 1, table, variance, (NAME,), misfit_against="", model=model
        )


class Minus(SpringFit):
    """-1, whatever was measured."""

    def found(self, frf: Frf, robot: Robot) -> tuple[float, float]:
        return -1.0, 0.1


class Told(SpringFit):
    """What it was told, and an error that covers everything."""

    def found(self, frf: Frf, robot: Robot) -> tuple[float, float]:
        return robot.parameter(NAME), robot.parameter(NAME)


class Stubborn(SpringFit):
    """What it was told, surely."""

    def found(self, frf: Frf, robot: Robot) -> tuple[float, float]:
        return robot.parameter(NAME), 0.03 * robot.parameter(NAME)


class Overconfident(SpringFit):
    """A tenth of its standard error."""

    error_factor = 0.1


class Timid(SpringFit):
    """Twenty times its standard error."""

    error_factor = 20.0


class Halved(SpringFit):
    """Half of its standard error."""

    error_factor = 0.5


class Tenfold(SpringFit):
    """Ten times its standard error."""

    error_factor = 10.0


class Nameless(SpringFit):
    """Calls the spring otherwise."""

    def run(self, frf: Frf, robot: Robot) -> Fit:
        fit = super().run(frf, robot)
        return fit.replace(parameters=fit.parameters.replace(names=("k",)), free_names=("k",))


class Lost(SpringFit):
    """Never converges."""

    def run(self, frf: Frf, robot: Robot) -> Fit:
        return super().run(frf, robot).replace(converged=False, status="ran out of steps")


class Forgetful(SpringFit):
    """Right in its table, and a model of what it was told."""

    def run(self, frf: Frf, robot: Robot) -> Fit:
        fit = super().run(frf, robot)
        return fit.replace(model=robot.model({NAME: robot.parameter(NAME)}, (NAME,), fit.covariance))


def test_a_fit_that_finds_the_plant_passes() -> None:
    check_stage(SpringFit, for_axes=(1,))


@pytest.mark.parametrize(
    ("cls", "clause"),
    [
        (Minus, r"gear_stiffness.axis_1 is 96000 in the plant that was measured, and the fit says -1 ± 0.1"),
        (
            Stubborn,
            r"the fit says 80000 ± 2.4e\+03; that is hardly nearer than the 80000|more than 6 standard errors",
        ),
        (Told, "its data determine none"),
        (Overconfident, "the standard errors are too small, or the estimates biased"),
        (Timid, "the standard errors are too large"),
        (Halved, "the standard errors are too small, or the estimates biased"),
        (Tenfold, "the standard errors are too large"),
        (Nameless, r"estimates no parameter that one_axis has a value of \(it names k\)"),
        (
            Forgetful,
            r"table says that gear_stiffness.axis_1 is 9\d+(\.\d+)?, and the robot of its `model` has 80000",
        ),
        (Lost, "does not converge with data of a known plant: ran out of steps"),
    ],
)
def test_a_wrong_fit_is_told_what_it_does_wrong(cls: type[SpringFit], clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_stage(cls, for_axes=(1,))


class Chosen(ExperimentDesign):
    """The example's design."""

    changes: ClassVar[dict[str, Any]] = {}

    def run(self, robot: Robot) -> Design:
        return example_design(robot).replace(**self.changes)


@pytest.mark.parametrize(
    ("changes", "clause"),
    [
        ({"gap": float("nan")}, "the design has no certificate: its gap is nan"),
        ({"gap": 0.3}, "by its own certificate another choice may be 0.3 better"),
        ({"efficiency": 1.4}, "whole experiments cannot be 1.4 as good"),
        ({"weight": np.array([0.9, 0.9])}, "no more than 1 together"),
        ({"experiments": np.array([1, 0])}, "chosen for 0 experiments"),
        ({"information": -np.eye(1)}, "not positive definite"),
        ({"predicted_standard_error": np.array([np.nan])}, "must be positive numbers"),
    ],
)
def test_a_design_without_its_certificate_is_told(
    changes: dict[str, Any], clause: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_stage(Chosen, for_axes=(1,))
    monkeypatch.setattr(Chosen, "changes", changes)
    with pytest.raises(ContractBroken, match=clause):
        check_stage(Chosen, for_axes=(1,))


def test_promised_errors_must_follow_from_the_information(monkeypatch: pytest.MonkeyPatch) -> None:
    changes = {
        "parameter_names": ("a", "b"),
        "information": np.diag([1.0, 4.0]),
        "predicted_standard_error": np.array([1.0, 1.0]),
    }
    monkeypatch.setattr(Chosen, "changes", changes)
    with pytest.raises(ContractBroken, match="does not follow from the information matrix"):
        check_stage(Chosen, for_axes=(1,))


class Compared(DiagnosisStage):
    """Root mean square of the torque against that of the robot in the same motion: an error that grows with a cause."""

    def told(self, error: float, comparison: TimeComparison) -> Diagnosis:
        return Diagnosis("compared", "done", (comparison.replace(relative_error=error),))

    def run(self, record: Record, robot: Robot) -> Diagnosis:
        own = simulate_record(robot, record, "motion").run.values("motor_torque")
        rms = np.sqrt((record.run.values("motor_torque") ** 2).mean() / (own**2).mean())
        return self.told(abs(float(rms) - 1), example_diagnosis(robot).time[0])


class Blind(Compared):
    """The same error, whatever was measured."""

    def told(self, error: float, comparison: TimeComparison) -> Diagnosis:
        return super().told(0.5, comparison)


class Mute(Compared):
    """Words only."""

    def told(self, error: float, comparison: TimeComparison) -> Diagnosis:
        return Diagnosis("mute", "all is well")


class Alarmed(DiagnosisStage):
    """Finds something everywhere."""

    def run(self, record: Record, robot: Robot) -> Diagnosis:
        from robid_core import Finding

        none = np.zeros(0)
        found = Finding("cause", "friction.lugre", "axis_1", "motor", 99.0, 0.0, 1.0, (), (), none, none, none, none, none, none)  # fmt: skip  # noqa: E501
        return Diagnosis("alarmed", "friction!", findings=(found,))


def test_a_diagnosis_whose_error_grows_with_a_cause_passes() -> None:
    check_stage(Compared, for_axes=(1,))


@pytest.mark.parametrize(
    ("cls", "clause"),
    [
        (Alarmed, "with a record of the very robot that it is given it finds friction.lugre at axis_1"),
        (Blind, "is not found, and no error grows by it: they are 0.5 beside 0.5 without it"),
        (Mute, "is not found, and the diagnosis states no error either"),
    ],
)
def test_a_wrong_diagnosis_is_told_what_it_does_wrong(cls: type[DiagnosisStage], clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_stage(cls, for_axes=(1,))


class Measured(Acquisition):
    """The robot itself, under the example's references."""

    def changed(self, record: Record) -> Record:
        return record

    def run(self, configurations: Configurations, excitation: Excitation, robot: Robot) -> Record:
        return self.changed(example_record(robot))


def with_channel(record: Record, name: str, **changes: Any) -> Record:
    channel = dataclasses.replace(record.run.channel(name), **changes)
    return record.replace(runs=(record.run.replace(channels={**record.run.channels, name: channel}),))


class Turned(Measured):
    """Angles with the other sign."""

    def changed(self, record: Record) -> Record:
        return with_channel(record, "motor_position", values=-record.run.values("motor_position"))


class InDegrees(Measured):
    """Angles in degrees."""

    def changed(self, record: Record) -> Record:
        return with_channel(record, "motor_position", values=np.degrees(record.run.values("motor_position")))


class InAmperes(Measured):
    """Torques in A."""

    def changed(self, record: Record) -> Record:
        return with_channel(record, "motor_torque", unit_symbol="A")


class SomewhereElse(Measured):
    """Half a radian away."""

    def changed(self, record: Record) -> Record:
        values = record.run.values("motor_position")
        return with_channel(record, "motor_position", values=values + 50.0)


class Uneven(Measured):
    """Instants of another clock."""

    def changed(self, record: Record) -> Record:
        return record.replace(runs=(record.run.replace(time_s=1.1 * record.run.time_s),))


class Held(Measured):
    """A hold that nobody knows."""

    def changed(self, record: Record) -> Record:
        return record.replace(torque_hold="linear")


class Sideless(Measured):
    """No side of the gear."""

    def changed(self, record: Record) -> Record:
        extra = Channel("rotor", "K", record.run.values("motor_torque"))
        return record.replace(
            runs=(record.run.replace(channels={**record.run.channels, "temperature": extra}),)
        )


def test_a_measurement_of_the_robot_passes() -> None:
    check_stage(Measured, for_axes=(1,))


@pytest.mark.parametrize(
    ("cls", "clause"),
    [
        (Turned, "motor 1 moved -.*; is its sign turned"),
        (InDegrees, "is it in radians, on the motor's side of the gear"),
        (InAmperes, "motor_torque is in A; by its name it is in (N m|N m or N)"),
        (SomewhereElse, "configuration . asks for"),
        (Uneven, "are not one sample_time_s"),
        (Held, "torque_hold is 'linear'"),
        (Sideless, "the side of temperature is 'rotor'"),
    ],
)
def test_a_wrong_measurement_is_told_what_is_wrong(cls: type[Measured], clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_stage(cls, for_axes=(1,))


WHOLE = '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>fit</title></head><body>{}</body></html>'


class Page(ReportStage):
    """A fit in one line."""

    body: str = "<p>{}</p>"
    """The page's body; the fit's status stands in it."""
    whole: str = WHOLE
    """The page around it."""
    escaped: bool = True
    """Whether the status is text."""

    def run(self, fit: Fit) -> Report:
        from html import escape

        status = escape(fit.status) if self.escaped else fit.status
        return Report(html=self.whole.format(self.body.format(status)))


def test_a_page_without_script_passes() -> None:
    check_stage(Page, for_axes=(1,))
    link = '<p><a href="https://example.org/">{}</a><img src="data:image/png;base64,AA=="></p>'
    check_stage(Page, for_axes=(1,), body=link)


@pytest.mark.parametrize(
    ("settings", "clause"),
    [
        ({"body": "<script>alert({})</script>"}, "the page has a script"),
        ({"body": '<p onclick="x()">{}</p>'}, "<p onclick=...> is a script in an attribute"),
        ({"body": '<p><a href=" JavaScript:x()">{}</a></p>'}, "a link of <a> is a script"),
        ({"body": '<img src="https://example.org/x.png">{}'}, "loads from elsewhere; put it into the page"),
        (
            {"body": '<link rel="stylesheet" href="//example.org/x.css">{}'},
            "<link href=.* loads from elsewhere",
        ),
        ({"body": "<style>@import 'x.css';</style>{}"}, "the style loads from elsewhere"),
        ({"body": '<p style="background: url(x.png)">{}</p>'}, "the style loads from elsewhere"),
        ({"body": "<iframe></iframe>{}"}, "<iframe> brings in"),
        ({"body": "<div><p>{}</div></p>"}, "the page is not whole: </p> closes nothing"),
        ({"body": "<div>{}"}, "the page is not whole"),
        ({"body": '<p id="a">{}</p><p id="a"></p>'}, "two elements have the id 'a'"),
        ({"whole": "<p>{}</p>"}, "does not begin with <!doctype html>"),
        ({"whole": "<!doctype html><title>x</title>{}"}, "does not say <meta charset"),
        ({"whole": '<!doctype html><meta charset="utf-8">{}'}, "has no <title>"),
        ({"escaped": False}, "text of an artifact became an element"),
    ],
)
def test_a_wrong_page_is_told_what_is_wrong(settings: dict[str, Any], clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_stage(Page, for_axes=(1,), **settings)


def test_a_fit_that_cannot_be_fed_says_how() -> None:
    class OfDesigns(SpringFit):
        """Takes a design."""

        def run(self, design: Design, robot: Robot) -> Fit:  # type: ignore[override]
            return example_fit(robot)

    with pytest.raises(
        ContractBroken, match="takes Design, of which the kit can measure none; give `artifacts`"
    ):
        check_stage(OfDesigns, for_axes=(1,))


class Sized(DiagnosisStage):
    """Notes how many records, configurations and blocks it is given, by the number of axes."""

    given: ClassVar[dict[int, tuple[int, int, int]]] = {}

    def run(self, record: tuple[Record, ...], robot: Robot) -> Diagnosis:
        n_config, n_block = record[0].run.values("motor_torque").shape[:2]
        self.given[robot.n_axis] = (len(record), n_config, n_block)
        return Diagnosis("sized", "done", (example_diagnosis(robot).time[0],))


def test_many_records_poses_and_blocks_are_diagnosed_on_small_robots_and_large_ones_are_tried_once() -> None:
    check_stage(Sized, for_axes=(1, 2, 6), recovery=False)
    assert Sized.given == {1: (2, 2, 2), 2: (1, 2, 2), 6: (1, 1, 1)}
