"""Backlash: its dead zone, its energy, its describing function and its mean stiffness."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.stats import norm

from robid_core import ForceEffect, Motion
from robid_effects.backlash import RESIDUAL, ROUNDING, Backlash, describing_function, rounding_radius

GAP, SPRING, DAMPER = 3e-4, 9e4, 60.0
HALF, RADIUS = GAP / 2, ROUNDING * GAP / 2


@pytest.fixture
def place(at):
    return at("gear", stiffness=SPRING, damping=DAMPER)


def law(position: float, velocity: float, place, gap: float = GAP) -> tuple[float, float, float]:
    arguments = Backlash.arguments(np.array([gap]), place)
    return Backlash.law(position, velocity, 0.0, np.zeros(1), np.zeros(1), arguments, 2.5e-4)


def torque(position: float, velocity: float, place) -> float:
    """All that the gear passes: the robot file's spring and damper, and the effect."""
    return law(position, velocity, place)[0] + place.stiffness * position + place.damping * velocity


def test_inside_the_gap_next_to_nothing_is_passed(place) -> None:
    for x in np.linspace(-(HALF - RADIUS), HALF - RADIUS, 9):
        expected = RESIDUAL * (SPRING * x + DAMPER * 0.2)
        assert torque(x, 0.2, place) == pytest.approx(expected, abs=1e-12)


def test_on_a_flank_spring_and_damper_of_the_file_act(place) -> None:
    for x in (HALF + RADIUS, 2 * GAP, 5e-3):
        expected = SPRING * (x - (1 - RESIDUAL) * HALF) + DAMPER * 0.2
        assert torque(x, 0.2, place) == pytest.approx(expected, rel=1e-12)
        assert torque(-x, -0.2, place) == -torque(x, 0.2, place)
        assert law(x, 0.2, place)[1:] == pytest.approx((0.0, 0.0), abs=1e-9)


def test_the_equilibrium_is_never_singular(place) -> None:
    for x in np.linspace(-2 * GAP, 2 * GAP, 401):
        assert law(x, 0.0, place)[1] + SPRING >= RESIDUAL * SPRING * (1 - 1e-9)


def test_slopes_are_derivatives(place) -> None:
    rng, h = np.random.default_rng(3), 1e-10
    for x, v in zip(rng.uniform(-1.5 * HALF, 1.5 * HALF, 60), rng.normal(0, 0.1, 60), strict=True):
        _, in_position, in_velocity = law(x, v, place)
        by_position = (law(x + h, v, place)[0] - law(x - h, v, place)[0]) / (2 * h)
        by_velocity = (law(x, v + 1e-3, place)[0] - law(x, v - 1e-3, place)[0]) / 2e-3
        # Rounding: eps * 40 N m / h = 1e-4; curvature of the parabola times h / 2 at its end: 0.08.
        assert in_position == pytest.approx(by_position, abs=0.2)
        assert in_velocity == pytest.approx(by_velocity, abs=1e-9)


def test_a_mass_bounces_between_the_flanks_without_losing_energy(at) -> None:
    """Speed in the middle of the gap, at every passage over many bounces, is that of the start."""
    undamped, inertia, speed = at("gear", stiffness=SPRING), 8.0, 0.05
    passages = solve_ivp(
        lambda _, z: (z[1], -torque(z[0], z[1], undamped) / inertia),
        (0.0, 0.6),
        (0.0, speed),
        rtol=1e-9,
        atol=1e-13,
        max_step=2e-4,
        events=lambda _, z: z[0],
    ).y_events[0][:, 1]
    assert len(passages) > 15
    # Local error 1e-9 a step, 3000 steps; losing a step's worth at each corner would give 1e-3.
    np.testing.assert_allclose(np.abs(passages), speed, rtol=1e-5)


def test_the_damper_takes_energy_only(place) -> None:
    spring = {x: torque(x, 0.0, place) for x in np.linspace(-GAP, GAP, 61)}
    for x, at_rest in spring.items():
        for v in (-0.3, 0.01, 0.3):
            assert (torque(x, v, place) - at_rest) * v >= 0.99 * RESIDUAL * DAMPER * v * v


def test_without_a_gap_nothing_changes(place) -> None:
    for x in (-1e-3, 1e-7, 2e-4):
        assert law(x, 0.1, place, gap=0.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("ratio", [0.4, 0.9, 1.1, 1.5, 4.0, 40.0])
def test_the_describing_function_is_the_first_harmonic_of_the_law(at, ratio: float) -> None:
    undamped, amplitude, n = at("gear", stiffness=SPRING), ratio * HALF, 4000
    phase = 2 * np.pi * (np.arange(n) + 0.5) / n
    harmonic = np.array([torque(amplitude * np.sin(p), 0.0, undamped) for p in phase])
    in_phase = 2 * np.mean(harmonic * np.sin(phase)) / amplitude
    assert 2 * np.mean(harmonic * np.cos(phase)) / amplitude == pytest.approx(0.0, abs=1e-6 * SPRING)
    # Midpoint rule over slopes that bend at corners: error of the order n^-2 = 6e-8.
    assert float(describing_function(amplitude, GAP, SPRING)) == pytest.approx(in_phase, abs=1e-6 * SPRING)


def test_the_describing_function_has_the_textbooks_values() -> None:
    """Gelb and Vander Velde: N / k at an amplitude of twice the dead zone is 1 - (2/pi)(pi/6 + sqrt(3)/4) = 0.391."""
    values = describing_function(np.array([0.7, 2.0, 1e4]) * HALF, GAP, 1.0)
    # A corner that is rounded by r is a mean over corners: r^2 / 6 times N's curvature, 0.73 / (A c) here: 0.0025.
    np.testing.assert_allclose(values, [RESIDUAL, 0.391 + 0.609 * RESIDUAL, 1.0], atol=2.6e-3)


@pytest.mark.parametrize(("bias", "rms"), [(0.0, 1e-4), (0.0, 1e-3), (2e-4, 1e-4), (-1e-3, 1e-4)])
def test_the_equivalent_spring_is_the_share_of_the_time_on_the_flanks(place, bias: float, rms: float) -> None:
    motion = Motion(position_bias=bias, position_rms=rms, velocity_rms=0.02)
    got = Backlash.linearize(np.array([GAP]), place, motion)
    breaks = [s * (HALF + e) for s in (-1, 1) for e in (-s * RADIUS, s * RADIUS)]
    ends = [bias - 9 * rms, *(b for b in breaks if abs(b - bias) < 9 * rms), bias + 9 * rms]
    mean = sum(
        quad(lambda x: law(x, 0.0, place)[1] * norm.pdf(x, bias, rms), low, high)[0]
        for low, high in pairwise(ends)
    )
    assert float(got.stiffness) == pytest.approx(mean, abs=1e-4)
    assert float(got.damping) == pytest.approx(mean * DAMPER / SPRING, abs=1e-6)
    outside = norm.cdf((-HALF - bias) / rms) + norm.sf((HALF - bias) / rms)
    # Rounding of both corners: r^2 / 6 times the curvature of Phi, at most 0.25 / s^2.
    rounding = 2 * RADIUS**2 / 6 * 0.25 / rms**2
    assert float(got.stiffness) / SPRING == pytest.approx((1 - RESIDUAL) * (outside - 1), abs=rounding)


@pytest.mark.parametrize("sine", [{}, {"sine_speed": 6e-4, "sine_omega": 2.0}])
def test_the_linearisation_agrees_with_the_numerical_one(place, sine: dict[str, float]) -> None:
    motion = Motion(position_bias=1e-4, position_rms=1e-4, velocity_rms=0.02, **sine)
    got = Backlash.linearize(np.array([GAP]), place, motion)
    by_stein = ForceEffect.linearize.__func__(Backlash, np.array([GAP]), place, motion)
    assert float(got.stiffness) == pytest.approx(float(by_stein.stiffness), abs=1e-3 * SPRING)
    assert float(got.damping) == pytest.approx(float(by_stein.damping), abs=1e-3 * DAMPER)


def test_the_radius_is_a_tenth_of_the_gap() -> None:
    assert rounding_radius(GAP) == pytest.approx(GAP / 10, rel=1e-12)
