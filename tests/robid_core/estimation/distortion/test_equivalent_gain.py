"""Equivalent gains: seen through the reference, with the variance they have, and closer with a control variate."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core.estimation.distortion.equivalent_gain import (
    EquivalentGain,
    GainPerLine,
    equivalent_gain,
    gain_per_line,
    smooth_gain,
)
from robid_core.estimation.excitation.multisine import logarithmic_odd_lines

N_SAMPLE = 2000
LINE = logarithmic_odd_lines((4.0, 80.0), 40, 4.0)
PLACE = np.log(LINE / np.sqrt(LINE[0] * LINE[-1]))


def white(chance: np.random.Generator, n_exp: int) -> Any:
    return chance.standard_normal((n_exp, len(LINE))) + 1j * chance.standard_normal((n_exp, len(LINE)))


def test_the_gain_is_seen_through_the_reference_with_the_variance_that_it_has() -> None:
    # S = kappa V + distortion, V and the reference share what the loop passes; kappa varies with frequency.
    chance, n_exp, runs = np.random.default_rng(7), 50, 60
    kappa = 0.3 - 0.02j + 0.05 * PLACE + 0.01j * PLACE**2
    squares, bias = [], []
    for _ in range(runs):
        reference, disturbance = white(chance, n_exp), 0.2 * white(chance, n_exp)
        speed = 0.9 * reference - 0.5 * disturbance
        signal = kappa * speed + disturbance
        found = equivalent_gain(gain_per_line(signal, speed, reference, LINE), LINE)
        squares.append(np.abs(found.at(LINE) - kappa) ** 2 / found.variance_at(LINE))
        through_speed = np.sum(signal * speed.conj(), axis=0) / np.sum(np.abs(speed) ** 2, axis=0)
        bias.append(np.mean(through_speed - kappa).real)
    # Three complex coefficients in each of 60 runs: the mean of 180 exponential variables, within four of their
    # standard errors 1 / sqrt(180).
    assert abs(np.mean(squares) - 1) < 4 / np.sqrt(3 * runs)
    assert np.mean(bias) < -0.01  # what the detour by the reference avoids


def rubbed(chance: np.random.Generator, n_exp: int, disturbed: float) -> tuple[Any, Any, Any, Any, Any]:
    """Reference, speed with a disturbance of its own and its Coulomb friction, the reference's alone and its."""
    spectrum = np.zeros((n_exp, N_SAMPLE // 2 + 1), dtype=complex)
    spectrum[:, LINE] = np.exp(2j * np.pi * chance.random((n_exp, len(LINE)))) / np.sqrt(len(LINE))
    linear = np.fft.irfft(spectrum * N_SAMPLE, n=N_SAMPLE, axis=1)
    speed = linear + disturbed * linear.std() * chance.standard_normal(linear.shape)

    def at_lines(signal: Any) -> Any:
        return np.fft.rfft(signal, axis=1)[:, LINE] / N_SAMPLE

    return (
        spectrum[:, LINE],
        at_lines(speed),
        at_lines(np.sign(speed)),
        spectrum[:, LINE],
        at_lines(np.sign(linear)),
    )


def test_a_linear_model_of_the_motion_makes_the_gain_more_precise_and_leaves_its_mean() -> None:
    chance, runs = np.random.default_rng(8), 40
    reference, speed, signal, *_ = rubbed(chance, 2000, 0.1)
    truth = equivalent_gain(gain_per_line(signal, speed, reference, LINE), LINE).at(LINE)
    reference, _, _, speed, signal = rubbed(chance, 500, 0.0)
    drawn = gain_per_line(signal, speed, reference, LINE)
    mean = smooth_gain(drawn.gain, drawn.weight, LINE)
    plain, controlled, stated = [], [], []
    for _ in range(runs):
        reference, speed, signal, model_speed, model_signal = rubbed(chance, 2, 0.1)
        measured = gain_per_line(signal, speed, reference, LINE)
        model = gain_per_line(model_signal, model_speed, reference, LINE)
        plain.append(equivalent_gain(measured, LINE).at(LINE))
        better = equivalent_gain(measured, LINE, model, mean)
        controlled.append(better.at(LINE))
        stated.append(better.variance_at(LINE))
    error = [np.mean(np.abs(np.array(some) - truth) ** 2) for some in (plain, controlled)]
    assert error[1] < 0.4 * error[0]
    assert abs(np.mean(np.abs(np.array(controlled) - truth) ** 2 / np.array(stated)) - 1) < 4 / np.sqrt(
        3 * runs
    )
    away = np.abs(np.mean(controlled, axis=0) - truth)
    assert np.sqrt(np.mean(away**2)) < 2.5 * np.sqrt(error[1] / runs)


def test_a_model_that_has_nothing_to_do_with_the_measurement_is_left_aside() -> None:
    chance = np.random.default_rng(9)
    measured = GainPerLine(1 + 0.1 * white(chance, 1)[0], np.ones(len(LINE)))
    other = GainPerLine(2 + 0.1 * white(chance, 1)[0], np.ones(len(LINE)))
    mean = EquivalentGain(np.array([1.0 + 0j, 0, 0]), np.zeros((3, 3)), 1.0)
    plain = equivalent_gain(measured, LINE).at(LINE)
    # Of 40 lines the share is within 0.3 of zero by chance, and what is taken off is share times 1.
    assert np.abs(equivalent_gain(measured, LINE, other, mean).at(LINE) - plain).max() < 0.4


def test_a_motor_that_stands_still_has_no_gain() -> None:
    nothing = np.zeros((3, len(LINE)), dtype=complex)
    found = equivalent_gain(gain_per_line(nothing, nothing, nothing, LINE), LINE)
    assert (found.at(LINE) == 0).all()
    assert (found.variance_at(LINE) == 0).all()
