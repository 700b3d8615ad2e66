"""Spectra of the torque residual: laws as held torques, noise between periods, weights that whiten."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import DataRejected
from robid_core.estimation.torque.periodic import drift_of, friction_deviation, periodic_motion_of
from robid_core.estimation.torque.spectra import (
    FINER,
    friction_spectra,
    speed_between_samples,
    speed_without_noise,
)
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.weights import (
    HALF_WINDOW,
    covariance_apart,
    covariance_of,
    running_mean,
    whitener,
)
from robid_core.estimation.torque.windowed import windowed_motion_of

T, N = 1e-3, 1000
LINES = np.array([5, 21])


def motion_of(position: np.ndarray, torque: np.ndarray):
    return periodic_motion_of(position, torque, T, LINES, 100.0)


def swings(n_period: int = 2) -> np.ndarray:
    """Two axes in one configuration, block and experiment."""
    time = T * np.arange(N)
    angle = np.stack(
        [0.1 * np.sin(2 * np.pi * 5 * time), 0.02 * np.cos(2 * np.pi * 21 * time) + 1.0], axis=-1
    )
    return np.tile(angle, (1, 1, 1, n_period, 1, 1))


def test_acceleration_of_a_line_is_exact_and_the_mean_stays() -> None:
    motion = motion_of(swings(), swings())
    assert motion.frequency_hz[[0, 5, -1]] == pytest.approx([0.0, 5.0, 100.0])
    found = motion.acceleration_spectrum[0, 0]
    np.testing.assert_allclose(found[5, 0], -((2 * np.pi * 5) ** 2) * 0.05 * -1j, rtol=1e-10)
    np.testing.assert_allclose(found[21, 1], -((2 * np.pi * 21) ** 2) * 0.01, rtol=1e-9)
    assert motion.angle_spectrum[0, 0, 0, 1] == 0.0
    assert motion.excited.sum() == 2


@pytest.mark.parametrize("repeats", [True, False])
def test_what_acts_of_a_torque_held_for_a_part_of_a_sample_is_its_mean(repeats: bool) -> None:
    """Of a sine sin(x) / x of it, x = w h / 2, half a hold later; a held torque is held for a sample already."""
    time, hold = T * np.arange(N), 0.4 * T
    omega = 2 * np.pi * np.array([5.0, 80.0])
    torque = np.tile(np.sin(time[:, None] * omega), (1, 1, 1, 2, 1, 1))
    if repeats:
        motion = periodic_motion_of(swings(), torque, T, LINES, 100.0, torque_hold="continuous")
    else:
        motion = windowed_motion_of(swings(1)[0, 0], torque[0, 0, :, 0][None], T, 100.0, "continuous")
    acting = np.sinc(omega * hold / (2 * np.pi)) * np.sin((time[:, None] - hold / 2) * omega)
    found = motion.held_for(hold)
    inner = (
        slice(None) if repeats else slice(N // 10, -N // 10)
    )  # beyond its ends a cut goes on as its mirror image
    np.testing.assert_allclose(found.torque[0, 0, inner], acting[inner], atol=1e-10 if repeats else 1e-3)
    expected = motion.with_signals(motion.angle, found.torque).torque_spectrum
    np.testing.assert_array_equal(found.torque_spectrum, expected)
    held = motion_of(swings(), torque)
    assert held.held_for(hold) is held


def test_a_viscous_law_is_the_speed_over_the_hold_factor() -> None:
    motion = motion_of(swings(), swings())
    held = motion.held_spectrum(motion.fine_speed())
    expected = 1j * motion.omega[:, None] * motion.angle_spectrum[0, 0] / motion.hold[:, None]
    np.testing.assert_allclose(held[0, 0], expected, atol=1e-12)


def test_a_sharp_law_is_what_a_grid_a_hundred_times_finer_says() -> None:
    motion = motion_of(swings(), swings())
    rubbing = next(SpeedFunctions.of_widths((0.5,), 1).along(motion.fine_speed()))
    found = motion.held_spectrum(rubbing)[0, 0, :, 0] * motion.hold
    time = T / 100 * np.arange(100 * N)
    fine = np.fft.rfft(np.tanh(0.1 * 2 * np.pi * 5 * np.cos(2 * np.pi * 5 * time) / 0.5))[:101] / len(time)
    # Harmonics above half the grid's 4 kHz fold back: those of tanh fall by exp(-pi w / 2 per unit of phase).
    np.testing.assert_allclose(found, fine, atol=1e-9)


def test_a_held_torque_moves_a_free_motor_between_the_samples_as_by_hand() -> None:
    """Speeds are straight lines between samples. Waves above 4 kHz, half the finer rate, are folded back or left out.

    The n-th alias of a speed falls with 1/n^2; those beyond the fourth, twice, are sqrt(2 sum n^-4) = 0.12 of all.
    """
    generator, time = np.random.default_rng(2), T * np.arange(N)
    torque = sum(
        np.sin(2 * np.pi * f * time + generator.uniform(0, 6)) for f in generator.uniform(20, 400, 30).round()
    )
    start = np.concatenate(([0.0], T * np.cumsum(torque)[:-1]))
    speed = (start[:, None] + torque[:, None] * T / FINER * np.arange(FINER)).ravel()
    mean_of_pieces = (start + 0.5 * T * torque).mean()
    angle = np.concatenate(([0.0], np.cumsum(T * start + 0.5 * T**2 * torque)[:-1])) - mean_of_pieces * time
    motion = motion_of(*(np.tile(one[:, None], (1, 1, 1, 2, 1, 1)) for one in (angle, torque)))
    smooth = motion.fine_speed()
    found = speed_between_samples(smooth, motion.fine_torque(), np.zeros(1), T)
    exact = speed - mean_of_pieces
    left, before = (np.std(exact - one[0, 0, :, 0]) for one in (found, smooth))
    assert left < 0.15 * before


def test_what_drifts_has_the_acceleration_of_what_does_not() -> None:
    """A line has none; its speed is told. Three periods that go on by 0.02, 0.03 and 0.03 rad."""
    still, line = swings(3), np.arange(N) / N
    drifting = still.copy()
    drifting[0, 0, 0, :, :, 1] += np.array([0.0, 0.02, 0.05])[:, None] + np.multiply.outer(
        [0.02, 0.03, 0.03], line
    )
    found, expected = (motion_of(one, np.zeros_like(one)) for one in (drifting, still))
    np.testing.assert_allclose(
        drift_of(drifting)[0, 0, 0, :, 0], [[0, 0.02], [0, 0.03], [0, 0.03]], atol=2e-4
    )
    # A hundredth of a period tells the change: of the second and third period it is told by half of that too early.
    large = np.abs(expected.acceleration_spectrum).max()
    np.testing.assert_allclose(found.acceleration_spectrum, expected.acceleration_spectrum, atol=1e-4 * large)
    np.testing.assert_allclose(
        found.rate(1)[..., 10:-10, :] - expected.rate(1)[..., 10:-10, :],
        np.full((1, 1, N - 20, 2), [0, 0.08 / 3]),
        atol=2e-3,
    )


def test_the_sum_of_functions_and_its_slope() -> None:
    laws = SpeedFunctions.about(np.array([0.5, 0.3]), np.array([3.0, 2.0]))
    generator = np.random.default_rng(6)
    speed, size = generator.normal(size=(50, 2)), generator.normal(size=laws.odd.shape)

    def by_hand(speed: np.ndarray) -> np.ndarray:
        return sum(own * np.tanh(speed / width) for own, width in zip(size, laws.odd, strict=True))

    torque, slope = laws.total_and_slope(speed, size)
    np.testing.assert_allclose(torque, by_hand(speed), rtol=1e-13)
    step = (
        1e-5  # errs by step^2 times a third derivative of 50 / 0.15^3 at most, and by rounding over the step
    )
    np.testing.assert_allclose(slope, (by_hand(speed + step) - by_hand(speed - step)) / (2 * step), atol=1e-5)


def test_what_brakes_is_the_friction_itself_or_what_is_nearest_to_it() -> None:
    """Friction that turns between two widths is met to a hundredth; functions against one another lose their slopes."""
    laws, speed = SpeedFunctions.near(np.array([0.5])), np.random.default_rng(1).normal(size=(400, 1)) * 2
    plain = np.array([[0.1], [0.0], [0.3], [0.0], [0.0]])
    np.testing.assert_array_equal(laws.braking(plain, speed), plain)
    fitted = np.linalg.lstsq(np.tanh(speed / laws.odd[:, 0]), np.tanh(speed[:, 0] / 0.6))[0][:, None]
    assert fitted.min() < 0
    found = laws.braking(fitted, speed)
    assert found.min() >= 0
    assert abs(laws.total(speed, found) - np.tanh(speed / 0.6)).max() < 0.01
    wild = 1000 * np.array([[1.467], [-3.916], [4.42], [-2.644], [0.691]])  # of a recording of a ball screw
    slope = [laws.total_and_slope(speed, sizes)[1] for sizes in (wild, laws.braking(wild, speed))]
    assert abs(slope[1]).max() < 0.1 * abs(slope[0]).max()


def test_functions_in_single_precision_are_those_of_double_precision() -> None:
    """They have level 1 and 24 bits: a function errs by 2^-24 or two, and its spectrum, a mean, by less."""
    motion = motion_of(swings(), swings() + 1e-3 * np.random.default_rng(3).standard_normal(swings().shape))
    laws = SpeedFunctions.about(np.array([0.5, 0.3]), np.array([3.0, 2.0]))
    speed = motion.fine_speed()
    exact = np.stack([motion.held_spectrum(law) for law in laws.along(speed)])
    found = friction_spectra(motion, laws, speed)
    assert next(laws.along(speed)).dtype == np.float64
    np.testing.assert_allclose(found[:-1], exact, rtol=0, atol=3 * 2**-24)
    exact_periods = np.stack(
        [[motion.held_spectrum(law) for law in laws.along(motion.speed_of_period(p))] for p in range(2)]
    )
    exact_periods = np.moveaxis(exact_periods, 0, 3)
    deviation = friction_deviation(motion, laws)
    np.testing.assert_allclose(
        deviation, exact_periods - exact_periods.mean(axis=3, keepdims=True), rtol=0, atol=3 * 2**-24
    )


@pytest.mark.parametrize(
    ("told", "asymmetry", "median", "most"),
    [(0.5, 0.0, 2e-4, 1.5e-3), (0.5, 0.1, 4e-3, 9e-3), (0.05, 0.0, 4e-4, 1e-2), (0.05, 0.1, 5e-3, 1.5e-2)],
)
def test_functions_of_speed_leave_next_to_nothing_of_friction_of_any_shape(
    told: float, asymmetry: float, median: float, most: float
) -> None:
    """It turns at up to twice the told speed or half of it, falls with speed, differs by direction.

    Over the speeds of forty waves on a slow sine; shares of the Coulomb level, of twenty draws.
    """
    found = []
    generator, time = np.random.default_rng(4), np.arange(8000) / 1000
    for _ in range(20):
        waves = [np.sin(2 * np.pi * f * time + generator.uniform(0, 6)) for f in generator.uniform(4, 80, 40)]
        speed = 9 * np.sin(2 * np.pi * time / 8) + generator.uniform(2, 6) * np.sum(waves, axis=0) / np.sqrt(
            20
        )
        turning = told * 2 ** generator.uniform(-1, 1)
        fall = (np.abs(speed) / generator.uniform(2, 20)) ** generator.uniform(1, 2)
        torque = (1 + generator.uniform(0, 0.8) * np.exp(-fall)) * np.tanh(speed / turning)
        torque *= 1 + asymmetry * np.sign(speed)
        laws = SpeedFunctions.about(np.array([told]), np.array([np.sqrt((speed**2).mean())]))
        columns = np.stack(
            [*(law[:, 0] for law in laws.along(speed[:, None])), np.ones_like(speed), speed], axis=1
        )
        rest = torque - columns @ np.linalg.lstsq(columns, torque)[0]
        found.append(np.sqrt((rest**2).mean()))
    assert np.median(found) < median
    assert max(found) < most


def test_functions_have_a_width_for_each_axis_odd_ones_before_even_ones() -> None:
    laws, speed = SpeedFunctions.about(np.array([0.5, 2.0]), np.array([8.0, 1.0])), np.array([[-3.0, 0.7]])
    there, back = (np.stack(list(laws.along(way * speed))) for way in (1, -1))
    n_odd = len(laws.odd)
    np.testing.assert_allclose(back[:n_odd], -there[:n_odd])
    np.testing.assert_allclose(back[n_odd:], there[n_odd:])
    assert len(laws.names) == len(there) + 1
    np.testing.assert_allclose(
        laws.odd[-1], [16.0, 12.0]
    )  # twice the rms; six times where motions turn slowly
    alone = np.stack(list(laws.of_axis(1).along(speed[:, 1:])))
    np.testing.assert_array_equal(alone[:, :, 0], there[:, :, 1])


def test_weights_whiten_correlated_noise_of_any_colour() -> None:
    generator = np.random.default_rng(5)
    mix = np.array([[1.0, 0.0], [0.7, 0.2]])
    colour = 1.0 + np.arange(101) / 20
    raw = generator.standard_normal((400, 101, 2)) + 1j * generator.standard_normal((400, 101, 2))
    noise = colour[:, None] * (raw @ mix.T)
    white = np.einsum("fab,xfb->xfa", whitener(covariance_of(noise)), noise)
    share = np.einsum("xfa,xfb->fab", white, white.conj()) / len(white)
    # 400 x 17 complex values a bin tell a variance to 1.2 %; colour changes by 8 % over a window, its square by 0.3 %.
    np.testing.assert_allclose(share[12:-12].mean(axis=0), np.eye(2), atol=0.02)


def test_lines_and_other_bins_keep_variances_of_their_own() -> None:
    """Every tenth bin is a line with a hundred times the power: neither smears into the other."""
    generator = np.random.default_rng(6)
    excited = np.arange(101) % 10 == 5
    level = np.where(excited, 10.0, 1.0)[:, None]
    residual = level * (
        generator.standard_normal((300, 101, 2)) + 1j * generator.standard_normal((300, 101, 2))
    )
    found = np.einsum("faa->fa", covariance_apart(residual, excited)).real
    # Mean over 300 experiments and at least 6 lines or 9 bins: 2.4 % of a variance of 2, or of 200, is one deviation.
    np.testing.assert_allclose(found / (2 * level**2), 1.0, atol=0.1)


def test_what_cannot_be_transformed_is_refused() -> None:
    broken = swings()
    broken[0, 0, 0, 1, 7, 0] = np.nan
    with pytest.raises(DataRejected, match="A05"):
        motion_of(swings(), broken)
    with pytest.raises(DataRejected, match="a band up to 600 Hz"):
        periodic_motion_of(swings(), swings(), T, LINES, 600.0)


def test_friction_of_any_width_nearby_is_a_sum_of_near_functions() -> None:
    """Half to twice the told width, Gaussian speeds of five widths: 1 % of the level is left; the width is found."""
    speed = 2.5 * np.random.default_rng(1).standard_normal((4000, 1))
    laws = SpeedFunctions.near(np.array([0.5]))
    functions = np.stack([torque[:, 0] for torque in laws.along(speed)], axis=1)
    for width in (0.25, 0.33, 0.5, 0.8, 1.0):
        friction = np.tanh(speed[:, 0] / width)
        size, *_ = np.linalg.lstsq(functions, friction, rcond=None)
        assert np.abs(functions @ size - friction).std() < 0.01
        assert laws.width_of(size[:, None], speed.T)[0] == pytest.approx(width, rel=0.02)


def test_each_function_of_speed_has_a_name_of_its_own() -> None:
    names = SpeedFunctions.about(np.ones(2), np.full(2, 3.0)).names
    assert len(set(names)) == len(names)
    assert [name for name in names if name.startswith("even")] == ["even_1", "even_2", "even_3"]
    assert names[0] == "odd_1"
    assert names[-1] == "constant"


@pytest.mark.parametrize("n", [1, 3, 8, 200])
def test_a_running_mean_keeps_its_digits_behind_values_that_are_very_much_larger(n: int) -> None:
    """Powers of a motion fall by twenty decades and more; noise is held against the smallest of them."""
    values = np.logspace(4, -20, n)[:, None] * np.array([1.0, 3.0])
    parts = [values[max(0, k - HALF_WINDOW) : k + HALF_WINDOW + 1].mean(axis=0) for k in range(n)]
    np.testing.assert_allclose(running_mean(values), parts, rtol=1e-13)


def test_next_to_no_noise_of_angles_changes_next_to_nothing_of_a_speed() -> None:
    """A large slow motion, and an acceleration that is wrong: where samples are exact they are believed.

    What they differ by falls by 22 decades of power over the band.
    """
    n, time = 4000, np.arange(4000 * FINER) / (4000 * FINER) * 4.0
    phase = 2 * np.pi * time / 4.0
    waves = [(30.0 * 0.9**k, k) for k in range(1, 250)]
    speed = np.sum([size * np.cos(k * phase + k) for size, k in waves], axis=0)
    acceleration = 1.05 * np.sum(
        [-size * k * 2 * np.pi / 4 * np.sin(k * phase + k) for size, k in waves], axis=0
    )
    both = [
        speed_between_samples(
            speed[None, None, :, None], acceleration[None, None, :, None], np.array([noise]), 4.0 / n
        )
        for noise in (0.0, 1e-18)
    ]
    # The smallest wave moves the angle by 4e-12 rad, the noise in a bin is 1e-9 / sqrt(4000).
    assert np.abs(both[0] - both[1]).max() < 1e-6


@pytest.mark.parametrize(("sigma", "share"), [(1e-4, 0.25), (1e-6, 0.75)])
def test_a_speed_without_the_noise_of_its_samples_is_as_noisy_as_the_bins_that_show_motion(
    sigma: float, share: float
) -> None:
    """A move up to 8 Hz from rest to rest elsewhere, sampled at 500 Hz: what is left is the noise of few bins.

    Noise of speed up to a frequency f has the variance ``(2 pi)^2 sigma^2 2 h f^3 / 3``; Hann's window hides what is
    60 dB below the largest wave, so that more bins than those up to 8 Hz are kept where noise is small.
    """
    h, n = 0.002, 6000
    fine = h / FINER * np.arange(n * FINER)
    sizes = [(40.0, 0.037), (3.0, 1.3), (0.5, 4.1), (0.1, 8.0)]
    swelling = np.sin(np.pi * fine / (n * h)) ** 2
    exact = swelling * sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * fine + f) for a, f in sizes)
    noise = sigma * np.random.default_rng(3).normal(size=n)
    above = 2j * np.pi * np.fft.rfftfreq(n, h)
    above[np.fft.rfftfreq(n, h) > 0.48 / h] = 0.0
    spectrum = np.zeros(n * FINER // 2 + 1, dtype=np.complex128)
    spectrum[: n // 2 + 1] = FINER * above * np.fft.rfft(noise)
    noisy = exact + np.fft.irfft(spectrum, n * FINER)
    found = speed_without_noise(noisy[None, None, :, None], np.array([sigma**2]), h)[0, 0, :, 0]
    inner = slice(n * FINER // 10, -n * FINER // 10)
    left, before = (np.std((one - exact)[inner]) for one in (found, noisy))
    all_bins = np.sqrt((2 * np.pi) ** 2 * sigma**2 * 2 * h * (0.48 / h) ** 3 / 3)
    assert before == pytest.approx(all_bins, rel=0.05)
    assert left < share * before


def test_what_differs_between_periods_is_held_with_them() -> None:
    """As where each period is held before it is transformed."""
    generator, hold = np.random.default_rng(7), 0.4 * T
    torque = generator.standard_normal((1, 1, 2, 3, N, 2))
    omega = 2 * np.pi * np.fft.rfftfreq(N, T)[:, None]
    share = np.sinc(omega * hold / (2 * np.pi)) * np.exp(-0.5j * omega * hold)
    held = np.fft.irfft(np.fft.rfft(torque, axis=4) * share, N, axis=4)
    angle = np.tile(swings(3), (1, 1, 2, 1, 1, 1))
    found, expected = (
        periodic_motion_of(angle, one, T, LINES, 100.0, torque_hold="continuous") for one in (torque, held)
    )
    np.testing.assert_allclose(found.held_for(hold).torque_deviation, expected.torque_deviation, atol=1e-12)
