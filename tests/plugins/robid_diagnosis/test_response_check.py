"""Stiffnesses told twice: responses agree where nothing is wrong, disagree where only they see it, or say why not."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
import pytest

from robid_core import (
    Channel,
    ConfigurationError,
    Context,
    DenseRun,
    Diagnosis,
    FloatArray,
    Record,
    ResponseCheck,
    Robot,
    Timing,
)
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects
from robid_diagnosis.response_check import nonlinear_springs, on_time, periodic_record

Plants = Callable[[Robot, int], Robot]
Measured = Callable[..., Record]
SPRING = "gear_stiffness.axis_1"
SLOW_HZ = 10.0


def diagnosed(record: Record, robot: Robot, **settings: object) -> Diagnosis:
    """Values refitted, one law searched, nothing simulated."""
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    few = {"only": ("friction.stribeck",), "most": 0, "closed_loop": False}
    return Effects.model_validate(few | settings).run((record,), robot, context)


def check_in(diagnosis: Diagnosis) -> ResponseCheck:
    assert diagnosis.response_check is not None
    return diagnosis.response_check


def with_torque(record: Record, torque: FloatArray) -> Record:
    channels = {**record.run.channels, "motor_torque": Channel("motor", "N m", torque)}
    return record.replace(runs=(record.run.replace(channels=channels),))


def stiffer_above(record: Record, plant: Robot, factor: float, frequency_hz: float) -> Record:
    """As if the gear were stiffer for fast motion, as rubber is: the torque that the same motion then takes."""
    run = record.run
    torque, n_sample = run.values("motor_torque"), len(run.time_s)
    bins_hz = np.fft.rfftfreq(n_sample, run.sample_time_s)
    fast = bins_hz > frequency_hz
    stiff = plant.with_parameters({SPRING: factor * plant.parameter(SPRING)})
    own, other = (robot.response(record.angle, bins_hz[fast])[..., 0] for robot in (plant, stiff))
    spectrum = np.fft.rfft(torque, axis=4)
    spectrum[..., fast, :] *= (own / other)[:, None, None, None]
    return with_torque(record, np.fft.irfft(spectrum, n_sample, axis=4))


def test_responses_agree_where_nothing_is_wrong(told: Robot, plant_of: Plants, measured: Measured) -> None:
    """Within a percent where friction's distortion was taken off; without a reference the errors are those of it."""
    plant = plant_of(told, 3)
    record = measured(plant, 4, with_reference=True)
    channels = {name: one for name, one in record.run.channels.items() if name != "speed_reference"}
    bare = record.replace(runs=(record.run.replace(channels=channels),))
    seen, unaided = (check_in(diagnosed(one, told)) for one in (record, bare))
    assert seen.method == "compensate.friction, frf.lrm, fit.log_response"
    assert unaided.method == "frf.lrm, fit.log_response"
    for one in (seen, unaided):
        off = one.by_responses - plant.parameter(SPRING)
        assert (one.names, one.units) == ((SPRING,), ("N m/rad",))
        assert abs(off[0]) < 3 * one.responses_error[0]
        assert abs(one.z[0]) < 3 < one.limit
    assert seen.responses_error[0] < 0.01 * plant.parameter(SPRING) < unaided.responses_error[0]


def test_a_gear_that_is_stiffer_for_fast_motion_is_told(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """Torques are looked at up to 10 Hz and see the slow spring, responses reach the resonance at 24 Hz."""
    plant = plant_of(told, 3)
    record = stiffer_above(measured(plant, 4, with_reference=True), plant, 1.1, SLOW_HZ)
    diagnosis = diagnosed(record, told, highest_hz=SLOW_HZ)
    response_check = check_in(diagnosis)
    slow = plant.parameter(SPRING)
    assert abs(response_check.by_torques[0] - slow) < 3 * response_check.torques_error[0]
    assert abs(response_check.by_responses[0] - 1.1 * slow) < 3 * response_check.responses_error[0]
    (finding,) = diagnosis.findings
    assert (finding.kind, finding.on) == ("unknown", "axis_1")
    assert finding.effect == f"responses and torques disagree about {SPRING}"
    assert finding.p_value < 1e-3
    assert "Check by frequency responses, fitted separately: they disagree about 1 of 1" in diagnosis.verdict
    assert "Nothing significant" not in diagnosis.verdict


def test_nothing_else_changes_by_asking(told: Robot, plant_of: Plants, measured: Measured) -> None:
    """Intervals are drawn; with and without a check they are the same to the last digit."""
    record = measured(plant_of(told, 3), 4)
    asked, not_asked = diagnosed(record, told), diagnosed(record, told, response_check=())
    assert not_asked.response_check is None
    assert set(asked.verdict.split("\n")) - set(not_asked.verdict.split("\n")) == {
        line for line in asked.verdict.split("\n") if line.startswith("Check by frequency responses")
    }
    for one, other in zip(asked.errors, not_asked.errors, strict=True):
        assert (one.low.tobytes(), one.high.tobytes()) == (other.low.tobytes(), other.high.tobytes())


def test_where_there_is_none_the_verdict_says_why(told: Robot, plant_of: Plants, measured: Measured) -> None:
    """Motions that do not repeat, and an estimator that cannot do with the record: the diagnosis goes on."""
    record = measured(plant_of(told, 3), 4).part(np.arange(4)[:, None, None] < np.full((4, 1, 2), 2))
    moves = record.replace(line=None)
    for diagnosis, why in (
        (diagnosed(moves, told), "the record has periods, but no excited frequencies"),
        (
            diagnosed(
                record, told, response_check=({"use": "frf.lrm", "with": {"discard": 2}}, "fit.log_response")
            ),
            "2 periods were measured and 2 are to be dropped",
        ),
    ):
        assert why in check_in(diagnosis).reason
        assert f"No check by frequency responses: {why}" in diagnosis.verdict
        assert diagnosis.findings == ()


def test_a_response_takes_as_many_experiments_as_axes(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """Of several records the one of most experiments is taken; of two experiments six axes get none."""
    many = measured(plant_of(told, 3), 4)
    few = many.part(np.arange(4)[:, None, None] < np.full((4, 1, 2), 2))
    moves = many.replace(line=None)
    assert periodic_record((moves, few, many), 1) == (many, "")
    once = Record.from_arrays(
        motor_position=many.run.values("motor_position")[0, 0, 0, 0],
        motor_torque=many.run.values("motor_torque")[0, 0, 0, 0],
        sample_time_s=many.run.sample_time_s,
        robot=told,
    )
    assert periodic_record((once,), 1) == (None, "the record does not repeat")
    assert periodic_record((few, many), 6) == (
        None,
        "a response of 6 axes takes as many experiments a block, and there are 2",
    )


def test_torques_come_as_early_as_they_were_late() -> None:
    """A wave whose period the record holds three times, late by 0.3 samples; of two periods the first is dropped."""
    time = np.arange(100) / 1000
    late = np.cos(2 * np.pi * 30 * (time - 0.3e-3) + 0.4)
    values = np.broadcast_to(late[:, None], (1, 1, 1, 2, 100, 1))
    channels = {
        "motor_position": Channel("motor", "rad", values),
        "motor_torque": Channel("motor", "N m", values),
    }
    run = DenseRun(1e-3, channels, time, np.ones(values.shape[:5], dtype=bool))
    record = Record(("axis_1",), "by hand", "zero_order_hold", (run,), np.zeros((1, 1)), line=np.array([3]))
    timing = Timing(("axis_1",), 1e-3, np.array([0.3]), np.array([0.01]))
    moved = on_time(record, timing, 1).run
    assert moved.n_period == 1
    on = np.cos(2 * np.pi * 30 * time + 0.4)
    assert moved.values("motor_torque")[0, 0, 0, 0, :, 0] == pytest.approx(on, abs=1e-12)
    assert moved.values("motor_position")[0, 0, 0, 0, :, 0] == pytest.approx(late)


def test_springs_beside_a_law_have_no_one_slope_in_responses(told: Robot) -> None:
    """That of the gear with a gap; friction at the motor leaves them alone."""
    rubbing = told.with_effect("grease", "friction.stribeck", "axis_1")
    assert nonlinear_springs(rubbing) == set()
    gap = rubbing.with_effect("play", "transmission.backlash", "axis_1", values={"gap": 1e-4})
    assert nonlinear_springs(gap) == {"gear_stiffness.axis_1"}


@pytest.mark.parametrize(
    ("stages", "wrong"),
    [
        (("frf.lrm",), "frf.lrm"),
        (("fit.log_response",), "fit.log_response"),
        (("frf.lrm", "diagnosis.effects", "fit.log_response"), "diagnosis.effects"),
    ],
)
def test_stages_that_lead_elsewhere_are_refused(
    told: Robot, plant_of: Plants, measured: Measured, stages: tuple[str, ...], wrong: str
) -> None:
    """No fit at the end, no responses for it, another kind of stage: told before anything is fitted."""
    record = measured(plant_of(told, 3), 4)
    with pytest.raises(
        ConfigurationError, match=f"'{wrong}' has no place there: response_check is a list of st"
    ):
        diagnosed(record, told, response_check=stages)
