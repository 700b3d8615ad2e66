"""Current loop: exact for held commands, whatever the step; gain against its sampled response."""

import numpy as np
import pytest
from scipy.signal import cont2discrete

from robid_core import Motion
from robid_effects.current_loop import CurrentLoop


def commands(n: int) -> np.ndarray:
    return 5 + np.random.default_rng(4).standard_normal(n)


def mean_by_fine_grid(
    command: np.ndarray, step: float, late: int, fine: int, time_constant: float
) -> np.ndarray:
    """Mean over each step of the lag after `late` fine samples: y' = (u - y) / T and its integral, discretised."""
    a, b = np.array([[-1 / time_constant, 0.0], [1.0, 0.0]]), np.array([[1 / time_constant], [0.0]])
    dt = step / fine
    transition, drive, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), dt)
    held = np.concatenate([np.full(late, command[0]), np.repeat(command, fine)])[: fine * len(command)]
    state, integral = np.array([command[0], 0.0]), [0.0]
    for u in held:
        state = transition @ state + drive[:, 0] * u
        integral.append(state[1])
    return np.diff(np.array(integral)[::fine]) / step


@pytest.mark.parametrize("late", [0, 7, 20, 53])
@pytest.mark.parametrize("time_constant", [2e-5, 5e-4, 1e-2])
def test_it_is_the_exact_mean_of_the_delayed_lag(at, through, late: int, time_constant: float) -> None:
    """Delay of 0, 0.35, 1 and 2.65 steps; the reference rounds in 800 products and integrates 40 steps."""
    step, fine, command = 2.5e-4, 20, commands(40)
    out = through(CurrentLoop, command, at("torque"), time_constant=time_constant, delay=late * step / fine)
    expected = mean_by_fine_grid(command, step, late, fine, time_constant)
    np.testing.assert_allclose(out, expected, rtol=1e-11)


def test_a_finer_step_gives_the_same_torque(at, through) -> None:
    command = commands(25)
    values = {"time_constant": 3e-4, "delay": 6.3e-4}
    coarse = through(CurrentLoop, command, at("torque"), **values)
    fine = through(CurrentLoop, np.repeat(command, 8), at("torque", step=2.5e-4 / 8), **values)
    np.testing.assert_allclose(fine.reshape(-1, 8).mean(axis=1), coarse, rtol=1e-12)


def test_without_lag_the_delayed_command_is_shared_between_steps(at, through) -> None:
    command = commands(9)
    out = through(CurrentLoop, command, at("torque"), time_constant=0.0, delay=2.5e-4 * 1.3)
    np.testing.assert_allclose(out[2:], 0.7 * command[1:-1] + 0.3 * command[:-2], rtol=1e-14)
    same = through(CurrentLoop, command, at("torque"), time_constant=0.0, delay=0.0)
    np.testing.assert_array_equal(same, command)


def test_a_tiny_time_constant_is_next_to_none(at, through) -> None:
    command = commands(9)
    none, tiny = (
        through(CurrentLoop, command, at("torque"), time_constant=t, delay=1e-4) for t in (0.0, 1e-9)
    )
    # each jump of at most 6 is late by 1e-9 s, a share of 4e-6 of the step
    np.testing.assert_allclose(tiny, none, atol=6 * 4e-6 * 2)


def test_a_constant_command_is_there_from_the_first_call(at, through) -> None:
    out = through(CurrentLoop, np.full(12, -7.5), at("torque"), time_constant=1e-3, delay=9e-4)
    np.testing.assert_allclose(out, -7.5, rtol=1e-14)


def test_the_line_of_a_sampled_sine_is_the_gain_and_its_images(at, through) -> None:
    """Held and averaged over steps: D(w) = sum_m G(w + 2 pi m / h) sinc^2(w h / 2 + pi m), exactly.

    Terms beyond |m| = 3000 fall as 1 / m^3: below 1e-8. From the squares adding to one, |D - G| is below
    (1 - sinc^2) (1 + |G|).
    """
    n, bin_, step = 200, 6, 2.5e-4
    parameters = np.array([4e-4, 3.7e-4])
    settled = 10 * n
    t = 2 * np.pi * bin_ * np.arange(settled + n) / n
    out = through(CurrentLoop, np.cos(t), at("torque"), time_constant=4e-4, delay=3.7e-4)[settled:]
    line = np.fft.rfft(out)[bin_] / np.fft.rfft(np.cos(t[settled:]))[bin_]
    omega = 2 * np.pi * bin_ / (n * step)
    m = np.arange(-3000, 3001)
    images = CurrentLoop.gain(parameters, at("torque"), omega + 2 * np.pi * m / step, Motion())
    weights = np.sinc(omega * step / (2 * np.pi) + m) ** 2
    assert line == pytest.approx((images * weights).sum(), abs=1e-7)
    gain = CurrentLoop.gain(parameters, at("torque"), np.array([omega]), Motion())[0]
    assert abs(line - gain) < (1 - weights[3000]) * (1 + abs(gain))
    assert np.angle(gain) == pytest.approx(-omega * 3.7e-4 - np.arctan(omega * 4e-4), abs=1e-12)


def test_the_state_holds_as_many_commands_as_the_delay_needs(at) -> None:
    for delay, length in ((0.0, 3), (2.4e-4, 3), (2.5e-4, 4), (3 * 2.5e-4, 6), (1.01e-3, 7)):
        (term,) = CurrentLoop.bind(np.array([1e-3, delay]), at("torque"))
        assert term.n_state == length
        assert 0 <= term.arguments[0] < 1
