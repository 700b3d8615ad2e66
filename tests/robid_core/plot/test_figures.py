"""Figures show the numbers of artifacts, whole where it matters, and what several share is written once."""

from __future__ import annotations

import json

import numpy as np
import pytest

from robid_core import ConfigurationError, Fit, Frf, FrictionCurve, Robot, TimeComparison, plot
from robid_core.plot.bode import bode, comparison_of
from robid_core.plot.pool import pooled
from robid_core.plot.rounding import compact, resolved, rounded_to
from robid_core.plot.traces import kept_samples
from robid_core.testing import example_diagnosis, example_fit, example_frf, example_robot


def test_holes_become_null_and_whole_numbers_lose_their_point() -> None:
    assert compact(np.array([[1.0, np.nan], [-0.001, 2.347]]), 2) == [[1, None], [0, 2.35]]
    assert rounded_to(np.array([123456.0, 0.123]), 3) == [123000, 0]
    assert rounded_to(np.array([0.000123456]), 3) == [0.000123]


def test_values_that_span_little_are_no_staircase() -> None:
    """From 73.78 to 73.87 dB: rounded to hundredths they fell on ten steps."""
    level = np.linspace(73.78, 73.87, 200)
    assert len(set(resolved(level, 2))) == 200
    assert len(set(rounded_to(level / 1000, 4))) == 200
    assert resolved(np.array([73.781, 73.781 + 1e-14, np.nan]), 2) == [73.78, 73.78, None]
    assert resolved(np.array([0.0, 123.456]), 2) == [0, 123.46]
    assert resolved(np.array([np.nan]), 2) == [None]


def test_a_single_spike_of_the_residual_is_always_drawn() -> None:
    draw = np.random.default_rng(0)
    for spike in (0, 1, 77_777, 99_998, 99_999):
        residual = draw.normal(size=100_000)
        residual[spike] = -40.0
        kept = kept_samples(residual)
        assert spike in kept
        assert {0, 99_999} <= set(kept.tolist())
        assert (np.diff(kept) > 0).all()
        assert len(kept) <= 1802


def test_short_recordings_are_drawn_whole() -> None:
    np.testing.assert_array_equal(kept_samples(np.zeros(1800)), np.arange(1800))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return example_robot(2)


@pytest.fixture(scope="module")
def frf(robot: Robot) -> Frf:
    return example_frf(robot)


def test_a_response_is_drawn_beside_the_robots_own(robot: Robot, frf: Frf) -> None:
    figure = plot.response(frf, robot, configuration=1, output="axis_2", input="axis_1")
    measured = next(trace for trace in figure.data if trace.name == "measured" and trace.yaxis == "y")
    np.testing.assert_allclose(measured.y, 20 * np.log10(np.abs(frf.response[1, :, 1, 0])), atol=0.0051)
    model = next(trace for trace in figure.data if trace.name == "robot file" and trace.yaxis == "y")
    assert frf.speed_rms is not None
    assert frf.slow_sine_speed is not None
    damping = robot.equivalent_motor_damping(frf.speed_rms, frf.slow_sine_speed)
    assert len(model.x) > 2 * len(frf.frequency_hz)  # between the lines, too
    own = robot.response(frf.angle, np.array(model.x), damping)
    np.testing.assert_allclose(model.y, 20 * np.log10(np.abs(own[1, :, 1, 0])), atol=0.0051)
    assert figure.layout.annotations[0].text == "acceleration of axis_2 over torque of axis_1"


def test_a_fit_of_responses_is_drawn_from_what_it_compared(robot: Robot) -> None:
    fit = example_fit(robot)
    assert fit.response is not None
    figure = plot.response(None, fit)
    names = {trace.name for trace in figure.data}
    assert {"measured", "start", "fitted model"} <= names
    drawn = [trace for trace in figure.data if trace.name == "fitted model" and trace.yaxis == "y2"]
    np.testing.assert_allclose(
        drawn[0].y, 20 * np.log10(np.abs(fit.response.modelled[0, :, 1, 1])), atol=0.0051
    )


def test_a_response_alone_has_no_model(frf: Frf) -> None:
    assert {trace.name for trace in plot.response(frf).data} == {"measured", "two standard deviations"}


def test_what_cannot_be_drawn_is_told(robot: Robot, frf: Frf) -> None:
    with pytest.raises(ConfigurationError, match="there is no axis 'axis_9'; there are: axis_1, axis_2"):
        plot.response(frf, output="axis_9")
    with pytest.raises(ConfigurationError, match="there is no configuration 2; they are 0 to 1"):
        plot.response(frf, configuration=2)
    with pytest.raises(ConfigurationError, match="there is no response to draw"):
        plot.response(None, robot)
    with pytest.raises(ConfigurationError, match="has no friction over speed"):
        plot.friction(example_fit(robot))
    with pytest.raises(ConfigurationError, match="has no residuals of any axis"):
        plot.residuals(example_diagnosis(robot))


def test_a_phase_that_passes_180_degrees_is_broken_there(frf: Frf) -> None:
    turning = np.exp(1j * np.radians([100.0, 170.0, 190.0, 250.0]))
    one = frf.replace(
        angle=frf.angle[:1],
        frequency_hz=np.array([1.0, 2.0, 3.0, 4.0]),
        response=np.broadcast_to(turning[None, :, None, None], (1, 4, 2, 2)),
        **dict.fromkeys(
            ("block_response", "input_gram_inverse", "output_covariance", "noise_covariance", "valid",
             "degrees_of_freedom", "speed_rms", "slow_sine_speed")
        ),
    )  # fmt: skip
    comparison = comparison_of(one, one.response)
    data = bode(comparison, 0, [(0, 0, "")], False, 1, 440)["data"]
    phase = next(trace for trace in data if trace["name"] == "robot file" and trace["yaxis"] != "y")
    assert phase["y"] == [100, 170, None, -170, -110]
    assert phase["x"] == [1, 2, 3, 3, 4]


def test_a_comparison_over_time_shows_what_is_left(robot: Robot) -> None:
    found = example_diagnosis(robot)
    figure = plot.time(found, axis="axis_2")
    comparison: TimeComparison = found.time[0]
    left = comparison.measured[:, 1] - comparison.modelled[:, 1]
    np.testing.assert_allclose(figure.data[2].y, left, atol=1e-3 * np.abs(left).max())
    with pytest.raises(ConfigurationError, match="has comparisons 0 to 0 over time, none of number 1"):
        plot.time(found, index=1)


def test_friction_is_drawn_over_speed(robot: Robot) -> None:
    speed = np.array([3.0, -1.0, 1.0])
    curve = FrictionCurve("axis_1", "coulomb", "rad/s", "N m", speed, np.sign(speed), 0.9 * np.sign(speed))
    fit: Fit = example_fit(robot).replace(friction=(curve, curve))
    figure = plot.friction(fit)
    assert list(figure.data[0].y) == [1, -1, 1]
    assert list(figure.data[1].x) == [-1, 1, 3]  # a line goes from left to right
    assert [note.text for note in figure.layout.annotations] == ["axis_1: coulomb"] * 2


def test_what_stands_twice_is_written_once_and_comes_back() -> None:
    numbers = list(range(100))
    value = {
        "a": [{"x": numbers, "y": numbers}, {"x": numbers, "name": "a text that is long enough"}],
        "b": None,
    }
    packed = json.loads(json.dumps(pooled(value)))
    assert len(json.dumps(packed)) < len(json.dumps(value)) / 2

    def whole(one: object) -> object:
        if isinstance(one, list):
            return [whole(entry) for entry in one]
        if isinstance(one, dict):
            return whole(packed["pool"][one["$"]]) if "$" in one else {k: whole(v) for k, v in one.items()}
        return one

    assert whole(packed["value"]) == value
