"""Residuals, distortion, correlations and the steady state: what is drawn is what closed forms say."""

from __future__ import annotations

import re

import numpy as np
import pytest

from robid_core import Channel, DenseRun, Record, ResponseComparison, Robot
from robid_core.plot import distortion_panels, residual_panels
from robid_core.plot.panels import WITHIN
from robid_core.testing import example_fit, example_frf, example_robot
from robid_report.correlation import correlation_of
from robid_report.html import HtmlReport, response_section
from robid_report.steady_state import spectra_of, steady_state

STEP, N_SAMPLE = 1e-3, 500


def test_chance_alone_leaves_one_line_in_twenty_beyond_the_dashed_line() -> None:
    """Complex Gaussian errors of the stated variance; 4000 lines, five deviations of a binomial share."""
    draw, n_freq = np.random.default_rng(0), 4000
    frequency = np.linspace(1, 80, n_freq)
    model = np.ones((1, n_freq, 1, 1), dtype=complex)
    deviation = np.full((1, n_freq, 1, 1), 0.3)
    noise = (draw.normal(size=n_freq) + 1j * draw.normal(size=n_freq)) / np.sqrt(2)
    measured = model + deviation * noise[:, None, None]
    comparison = ResponseComparison(("axis_1",), frequency, measured, model, model, deviation)
    dots = next(one for one in residual_panels(comparison, 0) if one["name"] == "residual")
    np.testing.assert_allclose(dots["y"], np.abs(noise), atol=1e-5)
    share = float(np.mean(np.array(dots["y"]) > WITHIN))
    assert share == pytest.approx(0.05, abs=5 * np.sqrt(0.05 * 0.95 / n_freq))


def test_levels_of_distortion_are_drawn_axis_by_axis() -> None:
    frf = example_frf(example_robot(2))
    odd = np.random.default_rng(1).uniform(1, 2, frf.response.shape[:3])
    frf = frf.replace(odd_distortion=odd, even_distortion=None)
    found = [one for one in distortion_panels(frf, 1, response=10 * odd[1]) if one["yaxis"] == "y2"]
    assert [one["name"] for one in found if one["name"] != "noise"] == ["response", "odd distortion"]
    np.testing.assert_allclose(found[1]["y"], odd[1, :, 1], rtol=1e-4)
    np.testing.assert_allclose(found[0]["y"], 10 * odd[1, :, 1], rtol=1e-4)


def test_correlations_are_drawn_and_the_strong_pair_is_named() -> None:
    robot = Robot.load("six_axis")
    fit = example_fit(robot)
    n = len(fit.free_names)
    deviation = np.geomspace(1.0, 1e4, n)
    correlation = np.eye(n)
    correlation[0, 2] = correlation[2, 0] = -0.97
    correlation[1, 3] = correlation[3, 1] = 0.5
    found = correlation_of(fit.replace(covariance=correlation * np.outer(deviation, deviation)))
    assert found is not None
    assert found.strong == [f"{fit.free_names[0]} and {fit.free_names[2]} −0.97"]
    assert found.n == n
    cells = re.findall(
        r'<rect class="(\w+)" x="[\d.]+" y="[\d.]+"[^>]*fill-opacity="([\d.]+)"', str(found.picture)
    )
    assert len(cells) == n + 4
    assert cells.count(("negative", "0.97")) == 2
    assert cells.count(("positive", "0.50")) == 2


def test_parameters_that_are_reported_have_a_picture_of_their_own_and_pairs_without_them_are_not_named() -> (
    None
):
    fit = example_fit(Robot.load("six_axis"))
    n = len(fit.free_names)
    reported = np.array([name in fit.free_names[:3] for name in fit.parameters.names])
    correlation = np.eye(n)
    correlation[0, 5] = correlation[5, 0] = 0.95
    correlation[6, 7] = correlation[7, 6] = 0.99
    table = fit.parameters.replace(reported=reported)
    found = correlation_of(fit.replace(parameters=table, covariance=correlation))
    assert found is not None
    assert found.strong == [f"{fit.free_names[0]} and {fit.free_names[5]} +0.95"]
    assert str(found.reported).count("<rect") == 3
    assert str(found.picture).count("<rect") == n + 4
    everything = correlation_of(
        fit.replace(parameters=table.replace(reported=np.ones_like(reported)), covariance=correlation)
    )
    assert everything is not None
    assert everything.reported is None
    assert len(everything.strong) == 2


def test_one_parameter_has_no_correlation() -> None:
    fit = example_fit(Robot.load("one_axis"))
    assert correlation_of(fit.replace(free_names=fit.free_names[:1], covariance=np.eye(1))) is None
    assert correlation_of(None) is None


INERTIA = 2e-3


def turned_motor() -> tuple[Record, np.ndarray]:
    """A motor turned by three cosines of torque, and its speed: their integral, amplitude A / (J w)."""
    line = np.array([5, 9, 14])
    time = np.arange(N_SAMPLE) * STEP
    omega = 2 * np.pi * line / (N_SAMPLE * STEP)
    amplitude = np.array([0.5, 0.2, 0.4])
    torque = (amplitude * np.cos(np.outer(time, omega))).sum(axis=1)
    angle = (-amplitude / (INERTIA * omega**2) * np.cos(np.outer(time, omega))).sum(axis=1)
    speed = (amplitude / (INERTIA * omega) * np.sin(np.outer(time, omega))).sum(axis=1)

    def whole(values: np.ndarray) -> np.ndarray:
        return np.tile(values, 2).reshape(1, 1, 1, 2, N_SAMPLE, 1)

    channels = {
        "motor_torque": Channel("motor", "N m", whole(torque)),
        "motor_position": Channel("motor", "rad", whole(angle)),
    }
    run = DenseRun(STEP, channels, time, np.ones((1, 1, 1, 2, N_SAMPLE), dtype=bool))
    record = Record(("axis_1",), "closed form", "zero_order_hold", (run,), np.zeros((1, 1)), line)
    return record, speed


def test_the_steady_state_of_the_true_model_is_the_record_and_of_a_wrong_one_its_error() -> None:
    record, speed = turned_motor()
    spectra = spectra_of(record, record.frequency_hz)
    assert spectra is not None
    for scale in (1.0, 0.9):
        model = np.full((1, 3, 1, 1), scale / INERTIA + 0j)
        comparison = ResponseComparison(
            ("axis_1",), record.frequency_hz, model, model, model, np.full(model.shape, np.nan)
        )
        found = steady_state(record, spectra, comparison)
        assert found is not None
        worst, signals = found
        assert worst == 0
        np.testing.assert_allclose(signals.measured[:, 0], speed, atol=1e-9)
        np.testing.assert_allclose(signals.modelled[:, 0], scale * speed, atol=1e-9)
        assert signals.relative_error == pytest.approx(1 - scale, abs=1e-9)
    assert spectra_of(record, record.frequency_hz[:2]) is None
    assert spectra_of(None, record.frequency_hz) is None


def test_a_comparison_over_time_says_whose_model_was_simulated() -> None:
    record, _ = turned_motor()
    robot = example_robot(1)
    model = np.full((1, 3, 1, 1), 1 / INERTIA + 0j)
    comparison = ResponseComparison(
        ("axis_1",), record.frequency_hz, model, model, model, np.full(model.shape, np.nan)
    )
    fit = example_fit(robot).replace(method="log response, weights from covariance", response=comparison)
    _, ((title, _),) = response_section(robot, None, fit, record)
    assert title == "Excited lines, configuration 1, model of log response"


def test_the_map_says_how_many_parameters_follow_from_what_was_fitted() -> None:
    """A friction law that is nearest to functions of speed has errors, and no place in the covariance."""
    robot = Robot.load("six_axis")
    fit = example_fit(robot)
    found, without = correlation_of(fit), fit.free_names.index("gear_damping.axis_1")
    assert found is not None
    assert found.derived == 0
    names = tuple(name for place, name in enumerate(fit.free_names) if place != without)
    shorter = fit.replace(
        free_names=names, covariance=np.delete(np.delete(fit.covariance, without, 0), without, 1)
    )
    rest = correlation_of(shorter)
    assert rest is not None
    assert (rest.n, rest.derived) == (found.n - 1, 1)
    page = HtmlReport().run(robot, fit=shorter).html
    assert fit.parameters.unreported() == "12 more parameters of the robot (12 of damping)"
    assert f"<summary>{fit.parameters.unreported()}</summary>" in page
    assert f"{found.n - 1} fitted parameters of the robot; 1 more follow" in page
