"""Predictions of a record: errors that are known in closed form, what a fit gains, and what is told."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.rigid_arm import record_of, slide as rigid_slide, sticking
from oracles.slide import MASS, OFFSET, STEP, VISCOUS, exact_run, record, reference, slide

from robid_core import (
    Context,
    DataRejected,
    Diagnosis,
    Fit,
    NotTrustworthy,
    ParameterTable,
    Record,
    Robot,
    Timing,
)
from robid_core.residual import excited_range
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_diagnosis.prediction import Prediction

TRUE = {"mass.x": MASS - 1.0, "friction.x.viscous": VISCOUS, "friction.x.offset": OFFSET}
SECONDS = 16.0
CUT = slice(500, -500)


def long_record(robot: Robot) -> Record:
    return record(robot, exact_run(reference(round(SECONDS / STEP)), 0.1))


def fit_of(robot: Robot, values: dict[str, float], converged: bool = True) -> Fit:
    n = len(values)
    table = ParameterTable(
        tuple(values), ("",) * n, ("",) * n, np.zeros(n), np.array(list(values.values())), np.ones(n),
        np.ones(n, dtype=bool), np.zeros(n, dtype=bool),
    )  # fmt: skip
    found = Fit("test", "stopped early", converged, 1.0, 1, 1, table, np.eye(n), tuple(values))
    return found.replace(model=robot.model(values))


def predict(robot: Robot, measured: Record, values: dict[str, float] | None, **settings: Any) -> Diagnosis:
    context = Context(
        np.random.default_rng(0), map_in_process, lambda done, total, note="": None, logging.getLogger("test")
    )
    fit = fit_of(robot, values) if values is not None else None
    return Prediction(**settings).run((measured,), robot, context, fit)


def test_errors_of_a_wrong_model_are_what_they_are_by_hand(tmp_path: Path) -> None:
    """Told 150 N s/m and 3 N too little: in open loop the force misses just that; with the truth it is repeated."""
    told = slide(tmp_path, viscous=50.0, offset=0.0)
    measured = long_record(told)
    diagnosis = predict(told, measured, TRUE, start="rest")
    wrong, right, astray, along = diagnosis.errors
    assert [(one.model, one.quantity, one.unit_symbol) for one in diagnosis.errors] == [
        ("robot file", "torque in open loop", "N"),
        ("fit", "torque in open loop", "N"),
        ("robot file", "speed in closed loop", "m/s"),
        ("fit", "speed in closed loop", "m/s"),
    ]
    position = measured.run.values("motor_position").ravel()
    force = measured.run.values("motor_torque").ravel()
    missing = ((VISCOUS - 50.0) * np.gradient(position, STEP) + OFFSET)[CUT]
    # The low-pass rounds the one step of the motion.
    assert wrong.rms[0] == pytest.approx(np.sqrt((missing**2).mean()), rel=0.03)
    assert wrong.relative[0] == pytest.approx(wrong.rms[0] / np.sqrt((force[CUT] ** 2).mean()), rel=0.03)
    assert right.relative[0] < 1e-3
    assert along.relative[0] < 1e-6 < 1e-3 < astray.relative[0]
    assert wrong.low[0] < wrong.relative[0] < wrong.high[0]
    assert not wrong.still[0]
    assert "times better, 95 % interval" in diagnosis.verdict
    assert diagnosis.verdict.startswith("Torque in open loop, rms over the axes: ")
    assert diagnosis.time[0].relative_error == pytest.approx(right.relative[0], rel=1e-6)


def test_without_a_fit_and_a_reference_the_told_model_is_tried_in_open_loop(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    measured = record(robot, exact_run(reference(), 0.1), drop="position_reference")
    diagnosis = predict(robot, measured, None)
    (only,) = diagnosis.errors
    assert (only.model, only.quantity) == ("robot file", "torque in open loop")
    assert np.isnan(only.low).all()  # two seconds are no twelve blocks
    assert "interval" not in diagnosis.verdict
    with pytest.raises(DataRejected, match="neither position_reference nor speed_reference"):
        predict(robot, measured, None, closed_loop=True)


def test_experiments_that_were_held_out_are_what_is_predicted(tmp_path: Path) -> None:
    """The second of two experiments is another plant's: with the role test it alone counts."""
    robot = slide(tmp_path)
    both = record(robot, exact_run(reference(), 0.1), exact_run(reference(), 0.1, offset=4.0))
    assert "if the fit saw it, this is no prediction" in predict(robot, both, TRUE).verdict
    test = np.array([[[False]], [[True]]]).reshape(1, 2, 1)
    marked = both.replace(runs=(both.runs[0].replace(test=test),))
    diagnosis = predict(robot, marked, TRUE)
    assert "no prediction" not in diagnosis.verdict
    # 7 N is what the model has too little there, all the time.
    assert diagnosis.errors[1].rms[0] == pytest.approx(4.0 - OFFSET, rel=1e-3)


def test_a_record_with_masked_samples_is_predicted_piece_by_piece(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    robot = slide(tmp_path)
    whole = long_record(robot).run
    known = np.ones(len(whole.time_s), dtype=bool)
    known[9000:9300] = False
    known[9290] = True
    channels = {
        name: one.replace(values=np.where(known[:, None], one.values, np.nan))
        for name, one in whole.channels.items()
    }
    valid = known[None, None, None, None]
    masked = long_record(robot).replace(runs=(whole.replace(channels=channels, valid=valid),))
    found = predict(robot, masked, TRUE)
    assert (
        "diagnosis.prediction takes the pieces between the gaps: 2 of 6.7 s and more, 98.1 %" in caplog.text
    )
    assert found.runs[0].runs == ("test 1", "test 2")
    assert found.errors[1].relative[0] < 1e-3  # as of the whole record
    assert found.errors[3].relative[0] < 1e-3  # the closed loop begins with the motion of each piece
    again = masked.replace(runs=(masked.run.replace(valid=valid & (np.arange(len(known)) % 1500 != 0)),))
    with pytest.raises(
        DataRejected, match="no piece of .* between its gaps lasts 2 s; lower skip_s and block_s"
    ):
        predict(robot, again, TRUE)


def test_what_is_left_at_rest_is_told_apart(tmp_path: Path) -> None:
    """Friction holds the slide by any force up to 20 N in 40 % of the samples; sliding it leaves noise of 0.5 N."""
    robot = rigid_slide(tmp_path)
    measured = record_of(robot, *sticking(3))
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    found = Prediction(skip_s=0.2).run((measured,), robot, context)
    share, rest = re.findall(
        r"without these samples the robot file leaves x ([\d.]+) % \((\d+) % at rest\)", found.verdict
    )[0]
    assert 30 <= int(rest) <= 45
    (error,) = found.errors
    assert float(share) < 0.5 * 100 * error.relative[0]
    moving = predict(slide(tmp_path), long_record(slide(tmp_path)), None).verdict
    assert "at rest" not in moving


def test_a_fit_that_saw_the_record_predicts_nothing_and_another_record_needs_no_role(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    seen, other = long_record(robot), record(robot, exact_run(1.1 * reference(), 0.1))
    fit = fit_of(robot, TRUE).replace(excited=excited_range([seen]))
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    assert "The fit saw this record" in Prediction().run((seen,), robot, context, fit).verdict
    verdict = Prediction().run((other,), robot, context, fit).verdict
    assert "The fit did not see this record" in verdict
    assert "no prediction" not in verdict


def test_torques_are_as_late_as_a_diagnosis_found_them(tmp_path: Path) -> None:
    """Recorded three samples after the angle: a robot that is right leaves nothing where that is known, and much else.

    Friction that turns within a sample or two is what comes three samples early.
    """
    robot = slide(tmp_path)
    measured = long_record(robot)
    run = measured.runs[0]
    force = run.channel("motor_torque")
    late = np.concatenate(
        [np.repeat(force.values[..., :1, :], 3, axis=-2), force.values[..., :-3, :]], axis=-2
    )
    channels = {**run.channels, "motor_torque": force.replace(values=late)}
    recorded = measured.replace(runs=(run.replace(channels=channels),))
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    left = {}
    for lag in (0.0, 3.0):
        timing = Timing(robot.axis_names, STEP, np.array([lag]), np.array([0.01]))
        explained = Diagnosis(method="", verdict="", model=robot.model(TRUE), timing=timing)
        diagnosis = Prediction().run((recorded,), robot, context, explained=explained)
        left[lag] = diagnosis.errors[1].relative[0]
        assert ("as late as the diagnosis found it: x 3.000 samples" in diagnosis.verdict) == (lag > 0)
    assert left[3.0] < 1e-4 < 10 * left[3.0] < left[0.0]


def test_an_axis_that_hardly_moves_is_marked(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    moving, n = long_record(robot), round(SECONDS / STEP)
    run = moving.runs[0]
    resting = {name: one.replace(values=np.zeros((1, 1, 1, 1, n, 1))) for name, one in run.channels.items()}
    resting["motor_torque"] = run.channels["motor_torque"]
    diagnosis = predict(robot, moving.replace(runs=(run.replace(channels=resting),)), None)
    assert diagnosis.errors[0].still.all()
    assert diagnosis.verdict.endswith("x moved too little for percentages to mean much.")


def test_what_cannot_be_predicted_is_refused(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    measured = record(robot, exact_run(reference(), 0.1))
    with pytest.raises(DataRejected, match="of an experiment of 3 s nothing is left when skip_s = 1.5 s"):
        predict(robot, measured, None, skip_s=1.5)
    context = Context(
        np.random.default_rng(0), map_in_process, lambda done, total, note="": None, logging.getLogger("test")
    )
    with pytest.raises(NotTrustworthy, match="stopped early"):
        Prediction().run((measured,), robot, context, fit_of(robot, TRUE, converged=False))


@pytest.mark.parametrize("for_axes", [(1, 2), pytest.param((6,), marks=pytest.mark.full)])
def test_the_stage_keeps_the_contract(for_axes: tuple[int, ...]) -> None:
    check_stage(Prediction, for_axes=for_axes, skip_s=0.1)
