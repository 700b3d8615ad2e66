"""Iterations, prior poles and choices by the data: what each is good for, against what is derived."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core import ConfigurationError
from robid_core.estimation.response.local.choice import prediction_error
from robid_core.estimation.response.local.fit import local_rational
from robid_core.estimation.response.local.iteration import iterate
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.plain import plain_fit
from robid_core.estimation.response.local.prior import denominators, pole_frequencies
from robid_core.estimation.response.local.regressors import WindowData, window_data
from robid_core.estimation.response.local.window import windows_of_lines
from robid_core.testing.plants import MassSpringPlant


def gaussian(generator: np.random.Generator, *shape: int) -> Any:
    parts = generator.standard_normal((2, *shape))
    return (parts[0] + 1j * parts[1]) / np.sqrt(2)


@pytest.mark.parametrize("deviation", [0.2, 0.6])
def test_iterations_end_where_weighted_equations_do_if_that_is_better(deviation: float) -> None:
    # G = g / (1 + d t), |u| = 1, variance s^2 of v, many experiments: least squares of y (1 + d t) - n u tends to the
    # minimum of sum_r |G(t_r) (1 + d t_r) - n|^2 + s^2 |1 + d t_r|^2, a linear problem of two unknowns, and so it does
    # with weights.
    gain, slope, n_exp = 1.5 + 0.5j, 0.9 - 0.6j, 4000
    frequency = np.arange(20.0, 29.0)
    t = (frequency - 20) / 8  # the first line: its window leans inward, and D = 1 at the end of it
    truth = gain / (1 + slope * t)
    rows = np.concatenate(
        (np.stack((-truth * t, np.ones(9)), axis=1), deviation * np.stack((-t, np.zeros(9)), axis=1))
    )
    right = np.concatenate((truth, deviation * np.ones(9)))

    def limit(passes: int) -> Any:
        weight, found = np.ones(18), np.zeros(2)
        for _ in range(passes + 1):
            found = np.linalg.lstsq(rows * weight[:, None], right * weight, rcond=None)[0]
            weight = np.tile(1 / np.abs(1 + found[0] * t), 2)
        return found

    generator = np.random.default_rng(0)
    u = np.exp(2j * np.pi * generator.random((9, 1, n_exp)))
    y = truth[:, None, None] * u + deviation * gaussian(generator, 9, 1, n_exp)
    model, windows = LocalModel("miso", 0, 1), windows_of_lines(frequency, 9)
    data = window_data(u, y, windows, slice(0, 1))
    plain, _ = iterate(data, model, 0)
    better, kept = iterate(data, model, 15)
    # Noise among the regressors pulls the plain fit towards zero. Where it is strong, weighted passes run away from
    # there to D = 0 at the end of the window, and none is kept.
    strong = deviation > 0.5
    assert (kept[0] == 0) == strong
    for found, expected in ((plain, limit(0)), (better, limit(0 if strong else 15))):
        # Standard error of G: the deviation / sqrt(36000) times what the slope costs, less than 5; that of the slope
        # three times as much. Three of them.
        error = 3 * 5 * deviation / np.sqrt(9 * n_exp)
        assert found.solution.numerator[0, 0, 0, 0] == pytest.approx(expected[1], abs=error)
        assert found.solution.denominator[0, 1, 0, 0] == pytest.approx(expected[0], abs=3 * error)
    if not strong:
        assert better.output_error[0] < plain.output_error[0]
        assert abs(limit(15)[1] - gain) < 0.7 * abs(limit(0)[1] - gain)


@pytest.mark.parametrize("parametrization", ["scalar", "miso", "mimo"])
def test_no_line_gets_a_larger_output_error_by_iterating(parametrization: Any) -> None:
    generator = np.random.default_rng(1)
    frequency = np.linspace(21, 80, 50)
    u = gaussian(generator, 50, 2, 3)
    y = MassSpringPlant.of(2).response(frequency) @ u
    y = y + 0.3 * np.sqrt(np.mean(np.abs(y) ** 2)) * gaussian(generator, *y.shape)
    model = LocalModel(parametrization)
    data: WindowData = window_data(u, y, windows_of_lines(frequency, 9), slice(0, 50))
    first, none = iterate(data, model, 0)
    best, kept = iterate(data, model, 6)
    assert (none == 0).all()
    assert (best.output_error <= first.output_error).all()
    same = kept == 0
    assert (best.solution.numerator[same] == first.solution.numerator[same]).all()
    assert (best.output_error[~same] < first.output_error[~same]).all()


def test_without_noise_iterations_change_nothing_that_counts() -> None:
    frequency = np.linspace(21, 80, 40)
    truth = MassSpringPlant.of(2).response(frequency)
    u = gaussian(np.random.default_rng(2), 40, 2, 3)
    for reference in (None, u):
        fit = local_rational(u, truth @ u, frequency, LocalModel(), reference=reference, iterations=3)
        assert np.abs(fit.response - truth).max() < 1e-8 * np.abs(truth).max()


def test_poles_of_a_state_matrix_are_where_its_response_has_them() -> None:
    # s^2 + 2 z w s + w^2: the response over frequency has its pole at f (sqrt(1 - z^2) + i z).
    w, z = 2 * np.pi * 30, 0.05
    a = np.array([[0, 1], [-(w**2), -2 * z * w]])
    (pole,) = pole_frequencies(
        np.linalg.eigvals(np.block([[a, np.zeros((2, 2))], [np.zeros((2, 2)), -np.eye(2)]]))
    )
    assert pole == pytest.approx(30 * (np.sqrt(1 - z**2) + 1j * z))
    assert abs(w**2 - (2 * np.pi * pole) ** 2 + 2j * z * w * 2 * np.pi * pole) < 1e-6 * w**2


def test_known_poles_need_no_more_lines_than_a_polynomial() -> None:
    frequency = np.linspace(20, 70, 51)
    poles = np.array([33 + 0.4j, 52 + 0.8j])
    f = frequency[:, None, None]
    residue = gaussian(np.random.default_rng(3), 3, 2, 2)
    truth = residue[0] + 4 * residue[1] / (f - poles[0]) + 4 * residue[2] / (f - poles[1])
    u = np.exp(2j * np.pi * np.random.default_rng(4).random((51, 2, 1)))
    y = truth @ u

    def error(**settings: Any) -> float:
        fit = local_rational(u, y, frequency, LocalModel(settings.pop("kind", "scalar")), **settings)
        return float(np.abs(fit.response - truth).max() / np.abs(truth).max())

    # Six unknowns an output, as for the parabola; a fitted denominator takes seven or more, the full matrix ten.
    assert error(poles_hz=poles, window_lines=51) < 1e-10
    with pytest.raises(ConfigurationError, match="10 unknowns per output need 10"):
        error(kind="mimo", window_lines=9)
    # Nine lines: what lies outside the window is a parabola nearly; where both poles were needed they were taken.
    local = error(poles_hz=poles, window_lines=9)
    polynomial = local_rational(u, y, frequency, LocalModel("scalar", 2, 0), window_lines=9)
    assert local < 0.02
    assert np.abs(polynomial.response - truth).max() / np.abs(truth).max() > 20 * local
    # A pole that is off by 0.16 Hz leaves the factor 1 + 0.16 / (f - p), at its worst 0.16 / 0.4 away from one.
    assert error(poles_hz=poles + 0.16, window_lines=9) < 0.4


def test_known_denominators_are_one_at_the_line_and_zero_at_the_pole() -> None:
    windows = windows_of_lines(np.linspace(20, 70, 51), 9)
    poles = np.array([33 + 0.4j, 52 + 0.8j, 34 + 0.2j])
    d = denominators(poles, windows, 2)
    assert (d[:, 0] == 1).all()
    line = 13  # 33 Hz, between the two poles that count there
    t = (poles - 33) / windows.half_width_hz[line]
    values = d[line, 0] + d[line, 1] * t + d[line, 2] * t**2
    assert abs(values[0]) < 1e-12
    assert abs(values[2]) < 1e-12
    assert (denominators(poles, windows, 1)[:, 1:] != 0).sum() < (d[:, 1:] != 0).sum()
    assert (d[50, 1:] == 0).all()  # 70 Hz is far from any
    with pytest.raises(ConfigurationError, match="no oscillating pole"):
        denominators(np.empty(0, dtype=complex), windows, 2)
    with pytest.raises(ConfigurationError, match="undamped pole at 30 Hz"):
        denominators(np.array([30 + 0j]), windows, 2)


@pytest.mark.parametrize(
    "model", [LocalModel("mimo", 2, 2), LocalModel("miso", 1, 2), LocalModel("miso", 2, 0)], ids=str
)
def test_the_error_of_prediction_is_that_of_a_fit_without_the_line(model: LocalModel) -> None:
    generator = np.random.default_rng(5)
    frequency = np.linspace(21, 80, 30)
    u = gaussian(generator, 30, 2, 3)
    y = MassSpringPlant.of(2).response(frequency) @ u
    y = y + 0.05 * np.abs(y).std() * gaussian(generator, *y.shape)
    windows = windows_of_lines(frequency, 11)
    fit = plain_fit(u, y, windows, model)
    stated = prediction_error(u, y, fit.numerator[:, 0], fit.own_gram())
    for line in (0, 14, 29):
        index = np.arange(windows.first[line], windows.last[line] + 1)
        others = index[index != line]
        t = (frequency[others] - frequency[line]) / windows.half_width_hz[line]
        for i in range(2):
            columns = [
                t[:, None, None] ** s * u[others].swapaxes(1, 2) for s in range(model.numerator_order + 1)
            ]
            regressed = y[others] if model.parametrization == "mimo" else y[others][:, i : i + 1]
            columns += [
                -(t[:, None, None] ** s) * regressed.swapaxes(1, 2)
                for s in range(1, model.denominator_order + 1)
            ]
            k = np.concatenate(columns, axis=2)
            theta = np.linalg.lstsq(k.reshape(-1, k.shape[2]), y[others][:, i].reshape(-1), rcond=None)[0]
            missed = y[line, i] - theta[:2] @ u[line]
            assert stated[line, i] == pytest.approx(np.mean(np.abs(missed) ** 2), rel=1e-6)


def test_the_widest_window_is_chosen_where_nothing_changes_and_a_narrow_one_at_resonances() -> None:
    generator = np.random.default_rng(6)
    frequency = np.linspace(20, 80, 61)
    u = np.exp(2j * np.pi * generator.random((61, 1, 3)))
    noise = gaussian(generator, 61, 1, 3)
    constant = local_rational(u, 2 * u + 0.1 * noise, frequency, LocalModel("miso", 0, 0), choose="window")
    assert constant.windows.size[0] > 40
    assert f"{constant.windows.size[0]} lines and orders 0/0 predict" in constant.words[0]
    truth = sum(3 / (frequency - p - 1.0j) for p in range(20, 81, 10))[:, None, None]
    sharp = local_rational(u, truth * u + 1e-4 * noise, frequency, LocalModel("miso", 2, 0), choose="window")
    assert sharp.windows.size[0] <= 7
    # A resonance wants a denominator, a slope does not.
    fine = local_rational(u, truth * u + 1e-4 * noise, frequency, LocalModel("miso", 1, 1), choose="both")
    assert fine.denominator.shape[1] - 1 >= 2
    line = (1 + 0.02 * frequency)[:, None, None]
    straight = local_rational(u, line * u + 0.1 * noise, frequency, LocalModel("miso", 4, 0), choose="both")
    assert straight.numerator.shape[1] - 1 <= 2


def test_what_is_chosen_comes_near_the_best_that_could_have_been() -> None:
    frequency = np.linspace(21, 80, 60)
    truth = MassSpringPlant.of(2).response(frequency)
    generator = np.random.default_rng(7)
    u = gaussian(generator, 60, 2, 4)
    y = truth @ (u + 0.02 * gaussian(generator, 60, 2, 4))

    def error(**settings: Any) -> float:
        fit = local_rational(u, y, frequency, LocalModel("mimo"), **settings)
        return float(
            np.sqrt(
                np.mean(np.abs((fit.response - truth) / np.abs(truth).max(axis=(1, 2), keepdims=True)) ** 2)
            )
        )

    best = min(error(window_lines=size) for size in range(6, 60, 4))
    assert error(choose="window") < 1.25 * best
    assert error() > 1.5 * best  # the smallest window that can state a covariance is not the best
