"""The advice as text: what is printed of an excitation, and when a person is warned."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core import Excitation
from robid_core.commands.excitation_screen import advice_lines
from robid_core.commands.show import artifact_lines

N_FREQ = 10


def excitation(**changes: Any) -> Excitation:
    """Return one of two axes and two configurations about which there is nothing to warn."""
    flat = np.ones((2, 2))
    fields: dict[str, Any] = {
        "axis_names": ("base", "arm"),
        "sample_time_s": 0.01,
        "slow_sine_bin": 2,
        "line": np.arange(5, 25, 2, dtype=np.int64),
        "reference": np.zeros((2, 2, 3, 100, 2)),
        "slow_sine_speed": np.array([5.0, 5.0]),
        "predicted_torque": np.array([[3.0, 4.0], [2.0, 6.0]]),
        "predicted_speed": 30 * flat,
        "predicted_travel": 8 * flat,
        "predicted_torque_rms": np.array([[1.5, 2.0], [1.0, 3.0]]),
        "torque_limit": np.array([10.0, 12.0]),
        "friction_torque": 0.5 * flat,
        "predicted_gear_load": np.array([[100.0, 300.0], [200.0, 100.0]]),
        "motor_gear_load": np.array([1000.0, 600.0]),
        "quantile": np.array([0.5]),
        "predicted_speed_quantile": np.full((2, 1, 2), 7.5),
        "standstill_speed": np.array([0.5, 0.5]),
        "predicted_standstill": 0.03 * flat,
        "predicted_deviation": np.full((2, N_FREQ, 2), 0.02),
        "predicted_noise_deviation": np.full((2, N_FREQ, 2), 0.001),
        "simulated_experiments": 12,
    }
    return Excitation(**{**fields, **changes})


def warned(**changes: Any) -> list[str]:
    return [line for line in advice_lines(excitation(**changes)) if line.startswith("!")]


def test_the_worst_configuration_is_shown() -> None:
    lines = [line.split() for line in advice_lines(excitation())]
    (base, base_response) = [line for line in lines if line[0] == "base"]
    (arm, _) = [line for line in lines if line[0] == "arm"]
    # Peak, limit, smallest rms of the multisine, friction, load and its share, travel, peak and median speed,
    # standstill.
    assert base[1:] == ["3", "10", "1", "0.5", "200", "20%", "8", "30", "7.5", "3.0%"]
    assert arm[1:7] == ["6", "12", "2", "0.5", "300", "50%"]
    assert base_response[1:] == ["2.00%", "0.10%", "2.0%", "5", "0", "of", "10"]
    assert not warned()


def test_show_prints_the_same_lines() -> None:
    one = excitation()
    assert [line[2:] for line in artifact_lines(one)[1 : 1 + len(advice_lines(one))]] == advice_lines(one)


def test_torque_below_friction_is_warned_of_by_axis() -> None:
    (warning,) = warned(friction_torque=np.array([[0.5, 0.5], [0.5, 3.5]]))
    assert warning.startswith("! arm: the torque in the excited band is below the friction level")


def test_motors_that_stand_still_are_warned_of() -> None:
    (warning,) = warned(predicted_standstill=np.array([[0.3, 0.03], [0.3, 0.03]]))
    assert warning.startswith("! base: 30% of the time below 0.5 rad/s")
    assert "a faster slow sine" in warning
    (without,) = warned(predicted_standstill=np.array([[0.3, 0.03], [0.3, 0.03]]), slow_sine_bin=0)
    assert "; a slow sine keeps" in without


def test_weak_lines_are_warned_of_with_their_cause() -> None:
    total, noise = np.full((2, N_FREQ, 2), 0.02), np.full((2, N_FREQ, 2), 0.001)
    total[0, 3:5, 0] = 0.8
    (warning,) = warned(predicted_deviation=total, predicted_noise_deviation=noise)
    assert warning.startswith("! base: 2 lines from 11 to 13 Hz are weaker than twice the scatter")
    assert "distortion: more blocks" in warning
    noise[0, 3:5, 0] = 0.79
    (warning,) = warned(predicted_deviation=total, predicted_noise_deviation=noise)
    assert "noise: more periods" in warning


def test_configurations_without_a_deviation_are_left_out() -> None:
    total = np.full((2, N_FREQ, 2), 0.02)
    total[1] = np.nan
    lines = advice_lines(excitation(predicted_deviation=total, predicted_noise_deviation=total / 4))
    assert any(line.split()[:3] == ["base", "2.00%", "0.50%"] for line in lines)
    assert not any("nan" in line for line in lines)


def test_a_motion_without_lines_has_no_response_and_no_warning_about_one() -> None:
    changes = {
        "line": np.zeros(0, dtype=np.int64),
        "slow_sine_bin": 0,
        "predicted_deviation": None,
        "predicted_noise_deviation": None,
        "predicted_standstill": np.full((2, 2), 0.4),
        "friction_torque": np.full((2, 2), 9.0),
    }
    text = "\n".join(advice_lines(excitation(**changes)))
    assert "std" not in text
    assert "!" not in text
    assert "changing" in text


def test_experiments_too_few_for_averages_are_told() -> None:
    text = "\n".join(advice_lines(excitation(predicted_deviation=None, predicted_noise_deviation=None)))
    assert "no std of the response" in text


def test_experiment_time_counts_what_was_planned() -> None:
    (line,) = [line for line in advice_lines(excitation()) if line.startswith("experiment time")]
    assert "2 configurations x 2 blocks x 3 experiments x 1 s = 12 s with one period each" in line


def test_an_excitation_of_a_stranger_without_predictions_says_nothing() -> None:
    bare = Excitation(("a",), 1e-3, 0, np.array([3]), np.zeros((1, 1, 1, 10, 1)), np.zeros(1))
    assert advice_lines(bare) == []
