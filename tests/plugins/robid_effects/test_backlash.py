"""Backlash: its dead zone, its energy and its describing function."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robid_effects.backlash import RESIDUAL, Backlash

GAP, SPRING, DAMPER, ROUNDING = 3e-4, 9e4, 60.0, 0.2
HALF, RADIUS = GAP / 2, ROUNDING * GAP / 2


@pytest.fixture
def place(at):
    return at("gear", stiffness=SPRING, damping=DAMPER)


def law(
    position: float, velocity: float, place, gap: float = GAP, step: float = 0.0
) -> tuple[float, float, float]:
    arguments = Backlash.arguments(np.array([gap, ROUNDING]), place)
    return Backlash.law(position, velocity, 0.0, np.zeros(1), np.zeros(1), arguments, step)


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


@pytest.mark.parametrize("step", [0.0, 2.5e-4, 4e-3])
def test_slopes_are_derivatives(place, step: float) -> None:
    rng, h, dv = np.random.default_rng(3), 1e-10, 1e-6
    for x, v in zip(rng.uniform(-1.5 * HALF, 1.5 * HALF, 60), rng.normal(0, 0.1, 60), strict=True):
        _, in_position, in_velocity = law(x, v, place, step=step)
        by_position, by_velocity = (
            (law(x + dx, v + du, place, step=step)[0] - law(x - dx, v - du, place, step=step)[0])
            / (2 * (dx + du))
            for dx, du in ((h, 0.0), (0.0, dv))
        )
        # Rounding: eps * 40 N m / h = 1e-4; curvature of the parabola times h / 2 at its end: 0.08.
        assert in_position == pytest.approx(by_position, abs=0.2)
        # Rounding: 1e-8; the third derivative, k (step / 2)^2 / r^2 / v at most, times dv^2 / 6, is below.
        assert in_velocity == pytest.approx(by_velocity, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("travel", [0.02, 0.3, 1.0, 7.3])
def test_a_gap_that_is_passed_in_a_few_steps_leaves_the_impulse_of_its_law(place, travel: float) -> None:
    """Wherever samples fall, as much as the sharp law; `travel` is what the spring passes in a step, in gaps."""
    step, way = 2.5e-4, 20 * GAP
    velocity = travel * GAP / step
    n = int(2 * way / (travel * GAP))
    for phase in (0.0, 0.21, 0.5, 0.83):
        x = -way + (phase + np.arange(n)) * travel * GAP
        torque = np.array([law(one, velocity, place, step=step)[0] for one in x])
        first, last = x[0] - 0.5 * travel * GAP, x[-1] + 0.5 * travel * GAP
        # Integral over x of what the gap takes off: SPRING (|x| - HALF / 2) HALF on each flank, and DAMPER inside.
        lost = [SPRING * HALF * (abs(end) - HALF / 2) for end in (first, last)]
        exact = (1 - RESIDUAL) * (lost[0] - lost[1] - DAMPER * velocity * GAP) / (velocity * step)
        scale = SPRING * HALF
        # Samples within a corner of a fixed radius (a tenth of the gap) are summed to (travel / radius)^2 / 24.
        bound = 1e-9 if travel > ROUNDING else (travel / 0.1) ** 2 / 24
        assert torque.sum() == pytest.approx(exact, abs=bound * scale)


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


@pytest.mark.parametrize(("ratio", "textbook"), [(0.7, 0.0), (2.0, 0.391), (1e4, 1.0)])
def test_the_first_harmonic_under_a_sine_is_the_textbooks(at, ratio: float, textbook: float) -> None:
    """Gelb and Vander Velde: N / k at an amplitude of twice the dead zone is 1 - (2/pi)(pi/6 + sqrt(3)/4) = 0.391."""
    undamped, amplitude, n = at("gear", stiffness=SPRING), ratio * HALF, 4000
    phase = 2 * np.pi * (np.arange(n) + 0.5) / n
    harmonic = np.array([torque(amplitude * np.sin(p), 0.0, undamped) for p in phase])
    in_phase = 2 * np.mean(harmonic * np.sin(phase)) / amplitude / SPRING
    assert 2 * np.mean(harmonic * np.cos(phase)) / amplitude == pytest.approx(0.0, abs=1e-6 * SPRING)
    # A corner that is rounded by r is a mean over corners: r^2 / 6 times N's curvature, 0.73 / (A c) here: 0.0025.
    assert in_phase == pytest.approx(RESIDUAL + (1 - RESIDUAL) * textbook, abs=2.6e-3)


def test_the_radius_is_a_tenth_of_the_gap_unless_told_otherwise(place) -> None:
    assert Backlash.arguments(Backlash.defaults(), place)[1] == pytest.approx(GAP / 10, rel=1e-12)
    assert Backlash.arguments(np.array([GAP, 0.9]), place)[1] == pytest.approx(0.45 * GAP, rel=1e-12)


def test_a_width_is_told_where_one_experiment_touches_both_flanks(place) -> None:
    """A wave of 0.9 gaps about either flank enters the gap by 0.9 gaps and no further; about the middle it crosses."""
    wave = 0.9 * GAP * np.sin(np.linspace(0, 20, 2000))
    above, below, across = HALF + wave, -HALF - wave, wave
    gap = np.array([GAP])
    assert not Backlash.hardly_told(gap, place, [across])
    assert not Backlash.hardly_told(gap, place, [above, across])
    for positions in ([above], [below], [above, below]):
        said = Backlash.hardly_told(gap, place, positions)["gap"]
        assert said.startswith("no experiment that counts touches both flanks")
        assert f"more than {0.9 * GAP:.2g} rad, by which motions went into it" in said
    told = Backlash.hardly_told(gap, place, [HALF + 0.1 * GAP + np.abs(wave)])
    assert "its width is not determined. Measure" in told["gap"]
