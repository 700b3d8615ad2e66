"""Figures for notebooks show the numbers of records, responses and fits, name axes and units, and refuse the rest."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import (
    ConfigurationError,
    Diagnosis,
    Fit,
    Frf,
    FrictionCurve,
    Record,
    ResidualCurve,
    Robot,
    TimeComparison,
    plot,
)
from robid_core.testing import example_diagnosis, example_fit, example_frf, example_record, example_robot


@pytest.fixture(scope="module")
def robot() -> Robot:
    return example_robot(2)


@pytest.fixture(scope="module")
def record(robot: Robot) -> Record:
    return example_record(robot)


@pytest.fixture(scope="module")
def fit(robot: Robot) -> Fit:
    return example_fit(robot)


@pytest.fixture(scope="module")
def frf(robot: Robot) -> Frf:
    return example_frf(robot)


def test_a_record_is_drawn_channel_by_channel_over_time(record: Record) -> None:
    figure = plot.record(record, configuration=1, block=1, experiment=1)
    names = [
        f"{channel} of {axis}" for axis in record.axis_names for channel in ("motor_position", "motor_torque")
    ]
    assert [trace.name for trace in figure.data] == names
    assert [note.text for note in figure.layout.annotations] == names
    position = record.run.values("motor_position")[1, 1, 1, :, :, 1].ravel()
    drawn = figure.data[2]
    np.testing.assert_allclose(drawn.y, position, atol=1e-5 * np.abs(position).max())
    np.testing.assert_allclose(drawn.x, record.run.sample_time_s * np.arange(1500), atol=1e-6)
    assert (drawn.xaxis, drawn.yaxis) == ("x3", "y3")
    assert figure.layout.yaxis3.title.text == "rad"
    assert figure.layout.yaxis4.title.text == "N m"
    assert figure.layout.xaxis3.title.text == "s"
    assert figure.layout.yaxis.domain[0] > figure.layout.yaxis3.domain[1]
    assert figure.layout.xaxis2.domain[0] > figure.layout.xaxis.domain[1]


def test_a_record_of_one_axis_and_of_channels_that_are_asked_for(record: Record) -> None:
    figure = plot.record(record, "axis_2", channels=["speed_reference"])
    assert [trace.name for trace in figure.data] == ["speed_reference of axis_2"]
    reference = record.run.values("speed_reference")[0, 0, 0, :, :, 1].ravel()
    np.testing.assert_allclose(figure.data[0].y, reference, atol=1e-5 * np.abs(reference).max())
    with pytest.raises(
        ConfigurationError, match="there is no channel 'current'; there are: motor_position, "
    ):
        plot.record(record, channels=["current"])
    with pytest.raises(ConfigurationError, match="there is no block 2; they are 0 to 1"):
        plot.record(record, block=2)
    with pytest.raises(ConfigurationError, match="there is no axis 'axis_9'"):
        plot.record(record, "axis_9")


def test_missing_samples_break_the_line_and_a_spike_of_a_long_record_is_drawn() -> None:
    angle = np.sin(1e-3 * np.arange(20_000))[:, None]
    angle[12_345] = 7.0
    angle[5_000:5_100] = np.nan
    long = Record.from_arrays(motor_position=angle, sample_time_s=1e-3, angle=[[0.0]])
    (trace,) = plot.record(long).data
    assert len(trace.x) < 2000
    assert max(value for value in trace.y if value is not None) == 7.0
    assert trace.x[trace.y.index(None)] == 5.0
    nothing = Record.from_arrays(motor_position=np.full((5, 1), np.nan), sample_time_s=1e-3, angle=[[0.0]])
    assert plot.record(nothing).data[0].y == (None,)


def test_distortion_is_drawn_beside_noise_and_the_level_of_the_response(frf: Frf, record: Record) -> None:
    odd = 0.1 + np.arange(frf.response[..., 0].size).reshape(frf.response.shape[:3])
    told: Frf = frf.replace(odd_distortion=odd)
    figure = plot.distortion(told, record, configuration=1)
    drawn = {trace.name: trace for trace in figure.data if trace.yaxis == "y2"}
    np.testing.assert_allclose(drawn["odd distortion"].y, odd[1, :, 1], atol=1e-4)
    _, acceleration = record.spectra()
    level = np.sqrt(np.mean(np.abs(acceleration[1, :, :, 1]) ** 2, axis=(0, 2)))
    np.testing.assert_allclose(drawn["response"].y, level, rtol=1e-4)
    assert figure.layout.yaxis.title.text == "rad/s²"
    assert figure.layout.yaxis.type == "log"
    assert [note.text for note in figure.layout.annotations] == ["axis_1", "axis_2"]
    with pytest.raises(ConfigurationError, match="example has no levels of distortion"):
        plot.distortion(frf)
    with pytest.raises(ConfigurationError, match="there is no configuration 2; they are 0 to 1"):
        plot.distortion(told, configuration=2)
    with pytest.raises(ConfigurationError, match="the record has other configurations, lines or axes"):
        plot.distortion(told, example_record(example_robot(1)))


def test_what_a_fit_of_responses_leaves_is_drawn_in_standard_errors(fit: Fit) -> None:
    comparison = fit.response
    assert comparison is not None
    figure = plot.residuals(fit, configuration=1)
    drawn = next(trace for trace in figure.data if trace.name == "residual" and trace.yaxis == "y2")
    left = np.abs(comparison.measured - comparison.modelled)[1, :, 1, 1] / comparison.deviation[1, :, 1, 1]
    np.testing.assert_allclose(drawn.y, left, rtol=1e-4, atol=1e-5)
    assert figure.layout.yaxis.title.text == "std. errors"
    assert figure.layout.xaxis.title.text == "Hz"
    one = plot.residuals(fit, "axis_2", configuration=1)
    assert [note.text for note in one.layout.annotations] == ["axis_2"]
    assert one.data[1].y == drawn.y
    with pytest.raises(ConfigurationError, match="there is no axis 'axis_9'; there are: axis_1, axis_2"):
        plot.residuals(fit, "axis_9")
    with pytest.raises(
        ConfigurationError, match="example has no residuals of responses with known deviations"
    ):
        plot.residuals(fit.replace(response=None))


def test_advice_is_of_figures_that_the_fit_has(fit: Fit) -> None:
    """plot.residuals sent to plot.time, which refused."""
    without = fit.replace(response=None, time=(), friction=())
    for draw in (plot.residuals, plot.time):
        with pytest.raises(ConfigurationError) as told:
            draw(without)
        assert "plot." not in str(told.value)
        assert "diagnosis.effects" in str(told.value)
    wave = np.zeros((4, 2))
    trace = TimeComparison(("axis_1", "axis_2"), "motor_torque", "N m", 0.0, np.arange(4.0), wave, wave)
    with pytest.raises(ConfigurationError, match="plot.time draws what it leaves over time"):
        plot.residuals(without.replace(time=(trace,)))
    curve = FrictionCurve("axis_1", "coulomb", "rad/s", "N m", np.ones(2), np.ones(2), np.ones(2))
    with pytest.raises(ConfigurationError, match="plot.friction draws"):
        plot.time(without.replace(friction=(curve,)))


def test_residuals_of_a_diagnosis_are_those_of_one_axis(robot: Robot) -> None:
    two = np.array([1.0, 2.0])
    curves = [
        ResidualCurve(axis, variable, "N m", two, two, two)
        for axis in robot.axis_names
        for variable in ("speed, rad/s", "angle, rad")
    ]
    diagnosis: Diagnosis = example_diagnosis(robot).replace(residuals=tuple(curves))
    for axis in (None, "axis_2"):
        shown = plot.residuals(diagnosis, axis).layout
        assert [note.text for note in shown.annotations] == [axis or "axis_1"] * 2
        assert (shown.xaxis.title.text, shown.xaxis2.title.text) == ("speed, rad/s", "angle, rad")
    with pytest.raises(ConfigurationError, match="there is no axis 'axis_3'; there are: axis_1, axis_2"):
        plot.residuals(diagnosis, "axis_3")


def test_estimates_are_drawn_relative_to_the_start_with_intervals(fit: Fit) -> None:
    start = np.array([2.0, -4.0, 0.0, 5.0])
    table = fit.parameters.replace(
        start=start,
        estimate=np.array([3.0, -3.0, 1.0, 5.0]),
        standard_error=np.array([0.1, 0.2, 0.1, np.nan]),
    )
    figure = plot.parameters(fit.replace(parameters=table), everything=True)
    (trace,) = figure.data
    kept = [0, 1, 3]  # nothing is relative to zero
    assert list(trace.y) == [table.names[i] for i in kept]
    assert list(trace.x) == [50, -25, 0]
    np.testing.assert_allclose(trace.error_x.array[:2], [1.959964 * 5, 1.959964 * 5], atol=1e-4)
    assert trace.error_x.array[2] is None  # held
    assert trace.text[0] == f"3 {table.units[0]}"
    assert figure.layout.xaxis.title.text == "estimate against start, %"
    reported = plot.parameters(fit)
    assert list(reported.data[0].y) == fit.table()["parameter"]
    with pytest.raises(ConfigurationError, match="example has no reported parameter that began"):
        plot.parameters(fit.replace(parameters=table.replace(start=np.zeros(4))))


def test_correlations_are_those_of_the_covariance(fit: Fit) -> None:
    deviation = np.array([2.0, 0.5, 3.0, 1.0])
    matrix = np.eye(4)
    springs = [i for i, name in enumerate(fit.free_names) if "stiffness" in name]
    first, second = springs
    matrix[first, second] = matrix[second, first] = -0.8
    told: Fit = fit.replace(covariance=matrix * np.outer(deviation, deviation))
    (heat,) = plot.correlation(told).data
    assert list(heat.x) == list(heat.y) == [fit.free_names[i] for i in springs]
    np.testing.assert_allclose(np.array(heat.z), [[1, -0.8], [-0.8, 1]], atol=1e-4)
    assert (heat.zmin, heat.zmax) == (-1, 1)
    assert len(plot.correlation(told, ("stiffness", "damping")).data[0].x) == 4
    with pytest.raises(
        ConfigurationError, match="no covariance of two parameters of friction; it estimated stiffness"
    ):
        plot.correlation(told, ("friction",))
    with pytest.raises(ConfigurationError, match="no covariance of two parameters of stiffness"):
        plot.correlation(told.replace(covariance=np.zeros((0, 0)), free_names=()))


def test_a_figure_says_what_it_takes(fit: Fit, frf: Frf, robot: Robot) -> None:
    diagnosis = example_diagnosis(robot)
    wrong: dict[str, Callable[[], object]] = {
        "response: frf has to be Frf or None, not Fit": lambda: plot.response(fit),  # type: ignore[arg-type]
        "response: model has to be Fit or Robot or None, not Frf": lambda: plot.response(frf, frf),  # type: ignore[arg-type]
        "time: result has to be Fit or Diagnosis, not Frf": lambda: plot.time(frf),  # type: ignore[arg-type]
        "friction: fit has to be Fit, not Diagnosis": lambda: plot.friction(diagnosis),  # type: ignore[arg-type]
        "residuals: result has to be Diagnosis or Fit, not Frf": lambda: plot.residuals(frf),  # type: ignore[arg-type]
        "distortion: frf has to be Frf, not Fit": lambda: plot.distortion(fit),  # type: ignore[arg-type]
        "distortion: record has to be Record or None, not Fit": lambda: plot.distortion(frf, fit),  # type: ignore[arg-type]
        "record: record has to be Record, not Frf": lambda: plot.record(frf),  # type: ignore[arg-type]
        "parameters: fit has to be Fit, not Frf": lambda: plot.parameters(frf),  # type: ignore[arg-type]
        "correlation: fit has to be Fit, not Diagnosis": lambda: plot.correlation(diagnosis),  # type: ignore[arg-type]
    }
    for message, call in wrong.items():
        with pytest.raises(ConfigurationError, match=f"^plot.{message}$"):
            call()
