"""Friction and the gain that replaces it, against closed forms, sampling and quadrature."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.mechanics import coulomb_viscous_law, equivalent_damping, friction_torque


def test_the_compiled_law_is_the_law_and_its_slope() -> None:
    for speed in (-3.0, -0.02, 0.0, 0.05, 7.0):
        none, parameters = np.zeros(0), np.array([1.2, 0.03, 0.07, 0.2])
        torque, _, slope = coulomb_viscous_law(0.0, speed, 0.0, none, none, parameters, 1e-3)
        assert torque == pytest.approx(
            float(friction_torque(speed, 1.2, 0.03, 0.07)) + 0.2, abs=1e-15, rel=1e-14
        )
        up, down = friction_torque(np.array([speed + 1e-6, speed - 1e-6]), 1.2, 0.03, 0.07)
        assert slope == pytest.approx((up - down) / 2e-6, rel=1e-6, abs=1e-8)


def test_closed_forms_of_the_sharp_sign() -> None:
    assert equivalent_damping(2.5, 0.0, 1.3, 0.01) == pytest.approx(
        np.sqrt(2 / np.pi) * 1.3 / 2.5 + 0.01, rel=1e-12
    )
    assert equivalent_damping(0.0, 3.0, 1.3, 0.01) == pytest.approx(2 * 1.3 / (np.pi * 3.0) + 0.01, rel=1e-12)
    assert equivalent_damping(0.0, 0.0, 0.0, 0.01) == 0.01
    assert equivalent_damping(0.0, 0.0, 1.0, 0.01) == np.inf


def test_at_rest_the_gain_is_the_slope_at_zero_speed() -> None:
    assert equivalent_damping(0.0, 0.0, 1.3, 0.01, 0.05) == pytest.approx(1.3 / 0.05 + 0.01, rel=1e-11)


@pytest.mark.parametrize(
    ("rms", "amplitude", "smoothing"),
    [
        (0.3, 0.5, 0.4),
        (0.05, 3.0, 0.07),
        (1.0, 0.0, 0.07),
        (0.0, 1.0, 0.1),
        (0.0, 0.05, 0.1),
        (0.7, 2.0, 0.0),
    ],
)
def test_the_gain_is_the_mean_slope_over_gaussian_and_sine(
    rms: float, amplitude: float, smoothing: float
) -> None:
    # Mean over the sine's phase (periodic: a plain mean converges fast) of the mean over the Gaussian, on a grid
    # that resolves the narrowest of the three widths; the sharp sign by the Gaussian's own density.
    phase = (np.arange(20000) + 0.5) * (2 * np.pi / 20000)
    slow = amplitude * np.sin(phase)
    if smoothing == 0.0:
        mean = np.mean(2 * np.exp(-(slow**2) / (2 * rms**2)) / (rms * np.sqrt(2 * np.pi)))
    else:
        g = np.linspace(-8, 8, 1201)
        weight = np.exp(-(g**2) / 2)
        weight /= weight.sum()
        mean = 0.0
        for node, share in zip(g, weight, strict=True) if rms else [(0.0, 1.0)]:
            mean += share * np.mean(1 - np.tanh((slow + rms * node) / smoothing) ** 2) / smoothing
    assert equivalent_damping(rms, amplitude, 1.0, 0.0, smoothing) == pytest.approx(mean, rel=1e-9)


def test_the_gain_is_the_regression_of_friction_on_a_small_signal() -> None:
    # What it means: f(v) = gain * v_gaussian + (uncorrelated), Price's theorem, for the Gaussian part of v.
    rng = np.random.default_rng(9)
    n, rms, amplitude = 400_000, 0.8, 2.0
    fast = rms * rng.normal(size=n)
    slow = amplitude * np.sin(2 * np.pi * np.arange(n) * 0.6180339887)
    torque = friction_torque(fast + slow, 1.0, 0.05, 0.1)
    gain = (torque @ fast) / (fast @ fast)
    deviation = np.std((torque - gain * fast) * fast) / np.sqrt(n) / rms**2
    assert abs(gain - equivalent_damping(rms, amplitude, 1.0, 0.05, 0.1)) < 4 * deviation
    # a Gaussian of the total rms overstates Coulomb's part by a third (at this ratio by a quarter and more)
    naive = equivalent_damping(np.hypot(rms, amplitude / np.sqrt(2)), 0.0, 1.0, 0.05, 0.1)
    assert naive - 0.05 > 1.15 * (gain - 0.05)


def test_arguments_broadcast() -> None:
    gain = equivalent_damping(np.ones((4, 1)), np.ones(3), np.ones(3), 0.0, 0.1)
    assert gain.shape == (4, 3)
    assert np.ptp(gain) == 0
