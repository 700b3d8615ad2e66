"""The linear model's motion in its loop is that of a simulation without friction."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.estimation.distortion.linear_motion import linear_motion, loop_response, random_phases
from robid_core.estimation.excitation.multisine import logarithmic_odd_lines
from robid_core.estimation.response.controller import controller_response, feedback_from_acceleration
from robid_core.testing import example_robot


def test_the_motion_is_that_of_a_simulation_without_friction() -> None:
    robot = example_robot(2)
    robot = robot.with_parameters({n: 1e-12 for n in robot.parameters() if n.endswith("coulomb")})
    period_s = 4.0
    n_sample = round(period_s / robot.sample_time_s)
    line = logarithmic_odd_lines((4.0, 80.0), 30, period_s)
    chance = np.random.default_rng(1)
    spectrum = np.zeros((2, n_sample // 2 + 1, 2), dtype=complex)
    # Small enough that the arm keeps its inertia, large enough beside a step of the encoder.
    spectrum[:, line] = 0.2 * np.exp(2j * np.pi * chance.random((2, len(line), 2)))
    reference = np.fft.irfft(spectrum * n_sample, n=n_sample, axis=1)
    result = robot.simulate(np.tile(reference, (1, 4, 1)), np.zeros((2, 2)), None)
    last = int(line[-1]) + 1
    frequency_hz = np.arange(1, last) / period_s
    position = np.fft.rfft(result.position[:, -n_sample:], axis=1)[:, line] / n_sample
    simulated = 2j * np.pi * (line / period_s)[:, None] * position
    controller = controller_response(robot.drives, robot.sample_time_s, frequency_hz)
    response = robot.response(np.zeros((1, 2)), frequency_hz)[0]
    feedback = feedback_from_acceleration(controller, frequency_hz)
    loop = loop_response(response, controller.from_speed_alone, feedback, frequency_hz)
    motion = linear_motion(loop, spectrum[:, :last], line, 5, chance)
    # A step of the encoder is worth 1e-4 of it at the highest line.
    assert np.abs(motion.own[:, line] - simulated).max() < 1e-3 * np.abs(simulated).max()
    assert motion.drawn.shape == (5, last, 2)
    assert motion.drawn[:, line] == pytest.approx(
        (loop[line - 1] @ motion.drawn_reference[..., None])[..., 0]
    )


def test_random_phases_keep_amplitudes_and_take_experiments_in_turn() -> None:
    chance = np.random.default_rng(2)
    spectrum = chance.standard_normal((3, 10, 2)) + 1j
    drawn = random_phases(spectrum, 7, chance)
    assert np.abs(drawn[4, 1:]) == pytest.approx(np.abs(spectrum[1, 1:]))
    assert (drawn[:, 0] == 0).all()
    assert abs(np.mean(np.exp(1j * np.angle(random_phases(spectrum, 4000, chance)[:, 1:])))) < 4 / np.sqrt(
        4000 * 18
    )
