"""Prediction of several runs: training and held-out runs, extrapolation, residuals, servos."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from oracles.slide import STEP, exact_run, record, slide

from robid_core import (
    Channel,
    Context,
    DataRejected,
    DenseRun,
    Diagnosis,
    ExcitedRange,
    Fit,
    FloatArray,
    Record,
    Robot,
    simulate_record,
)
from robid_core.residual import excited_range
from robid_core.stage import map_in_process
from robid_diagnosis.extrapolation import extrapolation_doubt
from robid_diagnosis.prediction import Prediction
from robid_diagnosis.prediction_curves import ORDERS, PredictedRun, prediction_curves
from robid_fit.rigid import RigidBodyFit
from robid_fit.time_domain import TimeDomainFit
from robid_report.html import HtmlReport

N_SAMPLE = 8000
SQUARE = 160.0  # N s^2/m^2: what the model lacks grows with the square of the speed


def context() -> Context:
    return Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))


def lane(size: float, frequency: float, square: float = SQUARE) -> tuple[FloatArray, FloatArray]:
    wanted = 0.1 + size * (1 - np.cos(2 * np.pi * frequency * STEP * np.arange(N_SAMPLE)))
    position, force = exact_run(wanted, 0.1)
    speed = np.gradient(position, STEP)
    return position, force + square * speed * np.abs(speed)


def with_test(whole: Record, *held: bool) -> Record:
    test = np.array(held).reshape(1, -1, 1)
    return whole.replace(runs=(whole.run.replace(test=test),))


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return slide(tmp_path_factory.mktemp("slide"), viscous=50.0)


def diagnosed(robot: Robot, whole: Record) -> tuple[Fit, Diagnosis]:
    fit = RigidBodyFit(cutoff_hz=50.0).run((whole.training(),), robot)
    return fit, Prediction(closed_loop=False).run((whole,), robot, context(), fit)


def test_a_plant_trained_slowly_and_tested_fast_is_said_to_be_extrapolated(robot: Robot) -> None:
    """Sines of 50 mm at 0.7 Hz, then of 100 mm at 1.2 Hz: 3.4 times the speed, less what the loop lags."""
    whole = with_test(record(robot, lane(0.05, 0.5), lane(0.05, 0.7), lane(0.1, 1.2)), False, False, True)
    _, found = diagnosed(robot, whole)
    (doubt,) = found.doubts
    assert doubt.kind == "extrapolation"
    ratio = float(doubt.sentence.partition("x speed ")[2].partition(" times")[0])
    assert ratio == pytest.approx(0.1 * 1.2 / (0.05 * 0.7), rel=0.05)
    (runs,) = found.runs
    assert runs.tested.tolist() == [False, False, True]
    assert runs.relative[2, 0] > 3 * runs.relative[:2, 0].max()
    of_limit = found.errors[-1].of_limit
    assert of_limit is not None
    assert of_limit[0] == pytest.approx(found.errors[-1].rms[0] / 4000.0)


def test_a_plant_tested_within_what_it_was_trained_by_is_not(robot: Robot) -> None:
    whole = with_test(record(robot, lane(0.1, 1.2), lane(0.05, 0.7)), False, True)
    fit, found = diagnosed(robot, whole)
    assert found.doubts == ()
    alone = whole.part(np.array([False, True]).reshape(1, 2, 1))
    assert Prediction(closed_loop=False).run((alone,), robot, context(), fit).doubts == ()


def test_a_fit_tells_how_far_it_went_to_a_prediction_of_another_record(robot: Robot) -> None:
    fit = RigidBodyFit(cutoff_hz=50.0).run((record(robot, lane(0.05, 0.7)),), robot)
    other = record(robot, lane(0.1, 1.2))
    found = Prediction(closed_loop=False).run((other,), robot, context(), fit)
    assert [doubt.kind for doubt in found.doubts] == ["extrapolation"]


def test_ranges_are_those_of_a_sine(robot: Robot) -> None:
    """Of a sine with noise of an encoder: largest speed and acceleration are a w and a w^2."""
    time, omega = STEP * np.arange(N_SAMPLE), 2 * np.pi * 1.5
    noise = 1e-6 * np.random.default_rng(1).standard_normal(N_SAMPLE)
    found = excited_range([record(robot, (0.2 * np.sin(omega * time) + noise, 3.0 * np.cos(omega * time)))])
    assert found is not None
    assert found.highest_position[0] == pytest.approx(0.2, rel=0.01)
    assert found.lowest_position[0] == pytest.approx(-0.2, rel=0.01)
    assert found.speed[0] == pytest.approx(0.2 * omega, rel=0.01)
    assert found.acceleration[0] == pytest.approx(0.2 * omega**2, rel=0.02)
    assert found.torque[0] == pytest.approx(3.0, rel=0.01)


def test_a_tenth_beyond_is_told_and_less_is_not() -> None:
    def at(factor: float, shift: float) -> ExcitedRange:
        one = np.array([1.0])
        return ExcitedRange(("a",), one - 1.0 + shift, one + shift, factor * one, one, np.array([np.nan]))

    assert not list(extrapolation_doubt(at(1.0, 0.0), at(1.09, 0.09)))
    (doubt,) = extrapolation_doubt(at(1.0, 0.0), at(1.2, -0.3))
    assert "a speed 1.2 times, a position by 0.3 of its range" in doubt.sentence


def test_curves_show_the_square_of_the_speed_and_an_order_of_the_motor(robot: Robot) -> None:
    """Left over speed: 160 v |v| less what the viscous term of the fit took of it; of a wave its amplitude."""
    whole = with_test(record(robot, lane(0.1, 0.5), lane(0.1, 1.2)), False, True)
    _, found = diagnosed(robot, whole)
    over = {curve.variable.partition(",")[0]: curve for curve in found.curves}
    assert set(over) == {"motor speed", "position", "predicted force", "time in the run"}
    speed = over["motor speed"]
    fast = np.abs(speed.abscissa) > 0.9 * np.abs(speed.abscissa).max()
    assert np.isnan(speed.trained[fast]).all()
    taken = np.polyfit(speed.abscissa, speed.tested - SQUARE * speed.abscissa * np.abs(speed.abscissa), 1)
    left = SQUARE * speed.abscissa * np.abs(speed.abscissa) + np.polyval(taken, speed.abscissa)
    np.testing.assert_allclose(speed.tested, left, atol=1.5)  # N, of 60
    turning = Robot.load("one_axis")
    angle = 2 * np.pi * 8 * (1 - np.cos(2 * np.pi * 0.25 * STEP * np.arange(N_SAMPLE)))
    wave = 0.3 * np.sin(3 * angle + 0.4)
    run = PredictedRun("test 1", True, STEP, angle[:, None], wave[:, None], np.zeros((N_SAMPLE, 1)))
    (order,) = [one for one in prediction_curves([run], turning, "torque", "N m") if "order" in one.variable]
    assert order.tested[ORDERS == 3.0][0] == pytest.approx(0.3, rel=0.02)
    assert order.tested[np.abs(ORDERS - 3.0) >= 1].max() < 0.05
    assert np.isnan(order.trained).all()


def test_the_page_begins_with_the_table_and_has_runs_in_two_colours(robot: Robot) -> None:
    whole = with_test(record(robot, lane(0.05, 0.7), lane(0.1, 1.2)), False, True)
    fit, found = diagnosed(robot, whole)
    page = HtmlReport().run(robot, fit=fit, record=whole, diagnosis=found).html
    table, runs = page.index("Prediction errors: "), page.index("Run by run")
    assert table < runs < page.index("Residuals of the prediction") < page.index("<h2>Parameters")
    assert "of the limit" in page
    assert not np.isfinite(found.errors[0].low).any()  # of seconds
    assert "No intervals: they are drawn from experiments, or from blocks" in page
    longer = tuple(one.replace(low=0.9 * one.relative, high=1.1 * one.relative) for one in found.errors)
    page = HtmlReport().run(robot, fit=fit, record=whole, diagnosis=found.replace(errors=longer)).html
    assert "No intervals" not in page
    assert "in which range that share lies" in page
    assert page.count('<tr class="trained">') == page.count('<tr class="tested">') == 1
    assert page.count('class="dots trained"') == page.count('class="dots tested"') == 4


# Servos: no torque

ARM = """
robid_robot: 1
name: servo
gravity: [0.0, 0.0, -9.81]
sample_time_s: 0.002
step_s: 0.001
bodies:
  - {joint: shoulder, axis: [0.0, 1.0, 0.0], mass: 0.4, centre_of_mass: [0.0, 0.0, -0.1],
     inertia: [[0, 0, 0], [0, 0, 0], [0, 0, 0]]}
axes:
  shoulder:
    rotor_inertia: 0.001
    torque_constant: 0.354
    torque_limit: 10
    speed_limit: 20
    friction: {viscous: 0.02}
    servo: {duty_gain: 1.0, supply_voltage: 7.4, resistance: 3.4}
"""


def of_servo(robot: Robot, gains: tuple[float, ...], phase: float) -> Record:
    """One configuration for each gain, angle and reference only; the gain is a constant of the run."""
    time = robot.sample_time_s * np.arange(1500)
    wanted = 0.8 * np.sin(2 * np.pi * 0.8 * time + phase) - 0.8 * np.sin(phase)
    n = len(gains)
    valid = np.ones((n, 1, 1, 1, len(time)), dtype=bool)
    channels = {
        name: Channel("motor", "rad", np.tile(wanted[:, None], (n, 1, 1, 1, 1, 1)))
        for name in ("motor_position", "position_reference")
    }
    run = DenseRun(
        robot.sample_time_s, channels, time, valid, None, ("gain",), np.array(gains).reshape(n, 1, 1, 1)
    )
    variants = tuple(f"gain_{gain:g}" for gain in gains)
    empty = Record(
        robot.axis_names, "computed", "zero_order_hold", (run,), np.zeros((n, 1)), variants=variants
    )
    parts = []
    for c, gain in enumerate(gains):
        one = empty.part((np.arange(n) == c).reshape(n, 1, 1))
        true = robot.with_parameters({"servo.shoulder.duty_gain": gain, "friction.shoulder.viscous": 0.05})
        parts.append(simulate_record(true, one, "rest").run.values("motor_position"))
    channels["motor_position"] = Channel("motor", "rad", np.concatenate(parts))
    return empty.replace(runs=(run.replace(channels=channels),))


def test_runs_of_a_servo_without_torque_are_predicted_by_their_angle(tmp_path: Path) -> None:
    """Fitted under two gains that are constants of the runs, predicted under a third: the angle comes out."""
    (tmp_path / "servo.yaml").write_text(ARM)
    robot, told = Robot.load("servo.yaml", tmp_path), {"gain": "servo.shoulder.duty_gain"}
    settings = TimeDomainFit(free=("friction.*.viscous",), outputs=("motor_position",), constants=told)
    fit = settings.run((of_servo(robot, (0.5, 2.0), 0.3),), robot, context())
    assert fit.parameters.value("friction.shoulder.viscous") == pytest.approx(0.05, rel=1e-3)
    other = of_servo(robot, (1.0, 3.0), 1.2)
    found = Prediction(start="rest", constants=told, skip_s=0.1).run((other,), robot, context(), fit)
    before, after = found.errors
    assert (after.quantity, after.unit_symbol) == ("angle in closed loop", "rad")
    assert after.rms[0] < 1e-4
    assert before.relative[0] > 100 * after.relative[0]
    assert found.runs[0].runs == ("gain_1, test 1", "gain_3, test 1")
    assert found.time[0].channel == "motor_position"
    with pytest.raises(DataRejected, match="only the closed loop can be predicted"):
        Prediction(constants=told, closed_loop=False).run((other,), robot, context(), fit)
    (tmp_path / "strong.yaml").write_text(
        "robid_robot: 1\nname: strong\nbase: servo.yaml\nparameters: {servo.shoulder.duty_gain: 3.0}\n"
    )
    files = {"gain_3": str(tmp_path / "strong.yaml")}
    nominal = fit.replace(model=robot.model({"friction.shoulder.viscous": 0.05}))
    by_file = Prediction(start="rest", robots=files, skip_s=0.1).run((other,), robot, context(), nominal)
    assert by_file.errors[1].rms[0] < 1e-4
    np.testing.assert_allclose(by_file.errors[0].rms, before.rms, rtol=1e-6)
