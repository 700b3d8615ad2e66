"""Break-away: a spring at rest, a Coulomb level in motion, a drop between them, and no energy from nowhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from robid_core import ConfigurationError, Motion, Place
from robid_core.mechanics import equivalent_damping
from robid_effects.breakaway import Breakaway

FloatArray = npt.NDArray[np.float64]
COULOMB, HOLD, STIFFNESS = 0.5, 0.8, 200.0


def along(velocity: FloatArray, step: float, damping: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Torque in the middle of each step, and state at its end."""
    parameters, state = np.array([COULOMB, HOLD, STIFFNESS, damping]), np.zeros(2)
    force, states = np.empty(len(velocity)), np.empty((len(velocity), 2))
    for k, v in enumerate(velocity):
        force[k] = Breakaway.law(0.0, v, 0.0, state, states[k], parameters, step)[0]
        state = states[k].copy()
    return force, states


def test_the_contact_holds_up_to_one_level_and_slides_at_another() -> None:
    """Steady pull at 0.1 rad/s: a spring for F_s / k / v = 40 ms, then F_c; back, from F_c without a jump."""
    step = 1e-3
    force, _ = along(np.concatenate((np.full(100, 0.1), np.full(100, -0.1))), step)
    path = 0.1 * step * (np.arange(100) + 0.5)
    held = STIFFNESS * path < HOLD
    np.testing.assert_allclose(force[:100], np.where(held, STIFFNESS * path, COULOMB), rtol=1e-12)
    back = COULOMB - STIFFNESS * path
    np.testing.assert_allclose(force[100:], np.where(back > -HOLD, back, -COULOMB), rtol=1e-11, atol=1e-13)


def test_a_contact_that_stops_and_goes_on_must_break_away_again_only_after_reversal() -> None:
    force, _ = along(np.repeat([1.0, -0.1, 1.0], [50, 20, 50]), 1e-3)
    assert force[49] == COULOMB
    assert np.max(force[70:]) == pytest.approx(
        HOLD, abs=STIFFNESS * 1e-3
    )  # one step short of the level at most
    assert np.max(force[70:]) > COULOMB + 0.1
    assert force[-1] == COULOMB


@pytest.mark.parametrize("step", [1e-4, 1e-2, 10.0])
def test_it_is_passive_whatever_the_step(step: float) -> None:
    """Work up to any time is at least what the spring holds then, z^2 / (2 k), for random motions."""
    rng = np.random.default_rng(3)
    speed = rng.standard_normal(4000) * 10 ** rng.uniform(-2, 0.5, 4000) * 0.01 / step
    for damping in (0.0, 0.3):
        force, states = along(speed, step, damping)
        work = np.cumsum(force * speed * step)
        assert np.all(work >= states[:, 0] ** 2 / (2 * STIFFNESS) - 1e-9)
        assert np.all(np.abs(states[:, 0]) <= HOLD)
        assert {0.0, 1.0} == set(states[:, 1])


def test_slopes_hold_what_the_speed_does_to_the_spring_within_half_a_step() -> None:
    parameters, step, h = np.array([COULOMB, HOLD, STIFFNESS, 0.3]), 2e-3, 1e-6
    for state, speed in (((0.2, 0.0), 0.4), ((0.5, 1.0), -0.4), ((0.5, 1.0), 2.0), ((0.0, 0.0), 50.0)):
        up, down, here = (
            Breakaway.law(0.0, speed + d, 0.0, np.array(state), np.zeros(2), parameters, step)
            for d in (h, -h, 0.0)
        )
        assert here[2] == pytest.approx((up[0] - down[0]) / (2 * h), abs=1e-7)


def test_a_loaded_axis_rests_below_the_level_and_runs_away_above_it() -> None:
    """Rotor under constant torque, linearly implicit midpoint against solve_ivp while it sticks.

    The spring overshoots by a third when the torque is switched on: 0.55 N m stay below 0.8 N m, though above F_c.
    """
    inertia, step, n = 1e-3, 2.5e-4, 4000
    parameters = np.array([COULOMB, HOLD, STIFFNESS, 0.3])
    ends = []
    for torque in (0.55, 0.9):
        state, following, speed, angle = np.zeros(2), np.zeros(2), 0.0, 0.0
        for _ in range(n):
            force, _, slope = Breakaway.law(angle, speed, 0.0, state, following, parameters, step)
            middle = speed + 0.5 * step * (torque - force) / (inertia + 0.5 * step * slope)
            Breakaway.law(angle, middle, 0.0, state, following, parameters, step)
            speed, angle = 2 * middle - speed, angle + step * middle
            state, following = following, state
        ends.append((angle, speed))

    def stuck(_: float, y: FloatArray) -> list[float]:
        return [y[1], (0.55 - STIFFNESS * y[0] - 0.3 * y[1]) / inertia]

    expected = solve_ivp(stuck, (0, n * step), [0.0, 0.0], rtol=1e-9, atol=1e-12, method="LSODA").y[:, -1]
    assert ends[0] == pytest.approx(expected, abs=1e-8)  # decayed: 0.55 N m / 200 N m/rad, at rest
    # 1 s of (0.9 - 0.5) N m on 1e-3 kg m^2, less the few ms before it lets go, and after a start of 4 mrad
    assert ends[1][1] == pytest.approx(400.0, rel=0.05)


def test_a_small_signal_meets_the_spring_and_a_large_one_coulomb_friction(at: Callable[..., Place]) -> None:
    parameters = np.array([COULOMB, HOLD, STIFFNESS, 0.3])
    small = Breakaway.linearize(parameters, at("motor"), Motion(velocity_rms=0.01, omega=60.0))
    assert float(small.stiffness) == pytest.approx(STIFFNESS, rel=5e-3)  # speeds held over a step: 3e-3
    assert float(small.damping) == pytest.approx(0.3, rel=5e-3)
    # A speed of 60 rad/s rms at 60 rad/s moves a radian; the contact sticks over (F_c + F_s) / k = 6.5 mrad of it.
    large = Breakaway.linearize(parameters, at("motor"), Motion(velocity_rms=60.0, omega=60.0))
    coulomb = float(equivalent_damping(60.0, 0.0, COULOMB, 0.0))
    assert float(large.damping) == pytest.approx(coulomb, rel=0.02)


def test_a_level_at_rest_below_that_of_sliding_is_refused(at: Callable[..., Place]) -> None:
    with pytest.raises(ConfigurationError, match=r"tried: breakaway is 0\.4 N m, below coulomb 0\.5"):
        Breakaway.arguments(np.array([0.5, 0.4, 200.0, 0.0]), at("motor"))
