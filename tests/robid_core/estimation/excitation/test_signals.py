"""Sweeps, binary sequences and noise: their spectra and correlations, derived."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from robid_core import ConfigurationError
from robid_core.estimation.excitation.signals import (
    band_bins,
    binary_waveform,
    edge_taper,
    gaussian_lines,
    hadamard_factors,
    in_band,
    maximum_length_sequence,
    powerful_bins,
    reference_of_motor_speed,
    shift_factors,
    speed_of_motor_torque,
    spread,
    sweep,
    through_lines,
)


def test_bins_of_a_band_hold_both_ends_and_never_the_mean() -> None:
    assert band_bins((4.0, 6.0), 0.5).tolist() == [2, 3]
    assert band_bins((0.1, 4.0), 0.5).tolist() == [1, 2]
    with pytest.raises(ConfigurationError, match=r"no line between 4\.1 and 5\.9 Hz"):
        band_bins((4.1, 5.9), 0.5)


def test_a_taper_rises_from_zero_and_falls_to_it() -> None:
    window = edge_taper(100, 20, 10)
    assert window[0] == window[-1] == 0
    assert (window[20:90] == 1).all()
    assert (np.diff(window[:21]) > 0).all()
    assert (np.diff(window[89:]) < 0).all()
    assert window[10] == pytest.approx(0.5)
    assert (edge_taper(50, 0, 0) == 1).all()


@pytest.mark.parametrize("law", ["linear", "logarithmic"])
def test_a_sweep_has_the_power_its_law_gives_each_line(law: str) -> None:
    # A cosine of amplitude one that passes f at the rate f' has |X|^2 = 1 / (4 f') (stationary phase), X the Fourier
    # transform; the DFT scaled by 1 / n is X / T. Linear: f' = (f1 - f0) / T. Logarithmic: f' = f ln(f1 / f0) / T.
    # Fresnel ripple is +-10 % near the ends and below that inside; averages over 40 lines of the inner half are good
    # to 3 %.
    n_sample, step, band = 16000, 1e-3, (5.0, 100.0)
    period = n_sample * step
    power = np.abs(np.fft.rfft(sweep(band, n_sample, step, law)) / n_sample) ** 2
    bins = np.arange(400, 1200)
    rate = (band[1] - band[0]) / period
    if law == "logarithmic":
        rate = bins / period * np.log(band[1] / band[0]) / period
    ratio = power[bins] * 4 * rate * period**2
    np.testing.assert_allclose(ratio.reshape(-1, 40).mean(axis=1), 1.0, atol=0.03)
    outside = np.concatenate([power[1:40], power[2400:]]).sum()
    assert outside < 0.02 * power.sum()


def test_a_sweep_goes_once_from_one_end_of_the_band_to_the_other() -> None:
    n_sample, step = 20000, 1e-3
    for law in ("linear", "logarithmic"):
        turning = np.diff(np.flatnonzero(np.diff(np.sign(sweep((5.0, 50.0), n_sample, step, law)))))
        # Half turns of 100 ms at 5 Hz and 10 ms at 50 Hz, never longer than the one before but for rounding. The first
        # is over after 0.15 s, when a linear sweep is 5 % faster on average.
        assert turning[0] == pytest.approx(100, abs=5 + 1)
        assert turning[-1] == pytest.approx(10, abs=1)
        assert (np.diff(turning) <= 1).all()
    with pytest.raises(ConfigurationError, match="neither linear nor logarithmic"):
        sweep((5.0, 50.0), 100, step, "square")


@pytest.mark.parametrize("register", [3, 7, 10])
def test_a_maximum_length_sequence_correlates_with_nothing_but_itself(register: int) -> None:
    signs = maximum_length_sequence(register)
    n = 2**register - 1
    assert len(signs) == n
    assert set(signs) == {-1.0, 1.0}
    correlation = np.fft.ifft(np.abs(np.fft.fft(signs)) ** 2).real
    np.testing.assert_allclose(correlation, [n] + [-1] * (n - 1), atol=1e-8 * n)


def test_held_signs_have_a_flat_spectrum_under_a_sinc() -> None:
    # |DFT|^2 of the sequence is N + 1 at every line but the mean; holding h samples multiplies the DFT by
    # sin(pi k / N) / sin(pi k / (N h)).
    register, hold = 8, 4
    n = 2**register - 1
    waveform = binary_waveform(register, hold, inverse_repeat=False)
    k = np.arange(1, n * hold // 2)
    expected = np.sqrt(n + 1) * np.abs(np.sin(np.pi * k / n) / np.sin(np.pi * k / (n * hold)))
    np.testing.assert_allclose(np.abs(np.fft.rfft(waveform))[k], expected, atol=1e-9 * n * hold)


def test_an_inverse_repeat_sequence_has_odd_lines_only() -> None:
    waveform = binary_waveform(7, 3, inverse_repeat=True)
    half = len(waveform) // 2
    np.testing.assert_array_equal(waveform[half:], -waveform[:half])
    spectrum = np.abs(np.fft.rfft(waveform))
    assert spectrum[::2].max() < 1e-9 * len(waveform)
    # Turning every other sign moves the lines of the sequence by half the clock: 2 sqrt(N + 1) at odd lines, 2 at line
    # N where its mean went, under the sinc of the hold.
    k = np.arange(1, 2 * 127, 2)
    expected = 2 * np.where(k == 127, 1.0, np.sqrt(128)) * np.sin(np.pi * k / 254) / np.sin(np.pi * k / 762)
    np.testing.assert_allclose(spectrum[k], expected, atol=1e-9 * len(waveform))


@settings(max_examples=30, deadline=None)
@given(
    n_sample=st.integers(40, 81), n_exp=st.integers(1, 4), n_axis=st.integers(1, 3), seed=st.integers(0, 1000)
)
def test_signals_of_all_axes_have_the_spectrum_of_the_waveform(
    n_sample: int, n_exp: int, n_axis: int, seed: int
) -> None:
    generator = np.random.default_rng(seed)
    waveform, bins = generator.standard_normal(n_sample), np.arange(3, 17)
    turn = generator.uniform(0, 2 * np.pi, (n_exp, len(bins), n_axis))
    signals = spread(waveform, bins, np.exp(1j * turn))
    spectrum, own = np.fft.rfft(signals, axis=1), np.fft.rfft(waveform)
    np.testing.assert_allclose(spectrum[:, bins], own[bins][:, None] * np.exp(1j * turn), atol=1e-10)
    others = np.setdiff1d(np.arange(n_sample // 2 + 1), bins)
    assert np.abs(spectrum[:, others]).max() < 1e-10
    np.testing.assert_allclose(
        spread(waveform, bins, np.ones((1, 1, 1)))[0, :, 0], in_band(waveform, bins), atol=1e-12
    )


def test_factors_of_a_shift_delay_the_signal() -> None:
    waveform = in_band(np.random.default_rng(0).standard_normal(60), np.arange(1, 20))
    bins = np.arange(1, 20)
    shifted = spread(waveform, bins, shift_factors(np.array([[7]]), bins, 60).swapaxes(-1, -2))
    np.testing.assert_allclose(shifted[0, :, 0], np.roll(waveform, 7), atol=1e-12)


@pytest.mark.parametrize("n_axis, n_exp", [(1, 1), (2, 2), (3, 4), (6, 8)])
def test_hadamard_experiments_are_orthogonal_and_free_of_a_mean_where_they_can(
    n_axis: int, n_exp: int
) -> None:
    signs = hadamard_factors(n_axis)
    assert signs.shape == (n_exp, n_axis)
    np.testing.assert_array_equal(signs.T @ signs, n_exp * np.eye(n_axis))
    if n_exp > n_axis:
        np.testing.assert_array_equal(signs.sum(axis=0), 0)


def test_noise_is_normal_of_variance_one_at_its_lines() -> None:
    # 400 signals of 60 lines: the variance of all is within 4 / sqrt(400 * 60), of each line within 4 / sqrt(400), and
    # the fourth moment of a normal is 3 (its estimate from 24000 independent numbers +- 4 sqrt(96 / 24000)).
    bins = np.arange(10, 70)
    noise = gaussian_lines((400, 1), bins, 300, np.random.default_rng(2))[..., 0]
    assert noise.shape == (400, 300)
    assert noise.var() == pytest.approx(1.0, abs=4 / np.sqrt(24000))
    assert np.mean(noise**4) / noise.var() ** 2 == pytest.approx(3.0, abs=4 * np.sqrt(96 / 24000))
    power = np.mean(np.abs(np.fft.rfft(noise) / 300) ** 2, axis=0)
    np.testing.assert_allclose(power[bins] * 2 * len(bins), 1.0, atol=4 / np.sqrt(400))
    assert np.delete(power, bins).max() < 1e-25
    both = gaussian_lines((400, 2), bins, 300, np.random.default_rng(3))
    assert abs(np.mean(both[..., 0] * both[..., 1])) < 4 / np.sqrt(24000)


def test_a_free_motor_under_its_speed_loop_turns_a_torque_into_the_reference_that_causes_it() -> None:
    # J dv/dt = K (r - v) by Euler's backward rule is not it; the closed form is: torque cos(w t) moves the motor with
    # sin(w t) / (w J), and r = v + torque / K = v + (dv/dt) J / K with f_c = K / (2 pi J).
    n_sample, step, inertia, gain, k = 1000, 2e-3, np.array([0.5, 2.0]), 30.0, 12
    t = np.arange(n_sample) * step
    omega = 2 * np.pi * k / (n_sample * step)
    torque = np.repeat(np.cos(omega * t)[:, None], 2, axis=1)
    response = speed_of_motor_torque(n_sample, step, inertia)
    speed = through_lines(torque, response)
    np.testing.assert_allclose(speed, np.sin(omega * t)[:, None] / (omega * inertia), atol=1e-12)
    loop = reference_of_motor_speed(n_sample, step, gain / (2 * np.pi * inertia))
    np.testing.assert_allclose(through_lines(torque, response * loop), speed + torque / gain, atol=1e-12)


def test_only_lines_with_power_count() -> None:
    t = np.arange(100)
    waveform = np.cos(2 * np.pi * 5 * t / 100) + 0.01 * np.cos(2 * np.pi * 6 * t / 100)
    assert powerful_bins(waveform, np.array([4, 5, 6])).tolist() == [5]
