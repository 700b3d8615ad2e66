"""Dahl's friction against its closed forms: virgin curve, steady loop, limits of small and of large motion."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from robid_core import Motion, Place
from robid_effects.dahl import Dahl

FloatArray = npt.NDArray[np.float64]

COULOMB, STIFFNESS = 0.8, 40.0


def along(
    velocity: FloatArray,
    step: float,
    start: float = 0.0,
    coulomb: float = COULOMB,
    stiffness: float = STIFFNESS,
) -> tuple[FloatArray, FloatArray]:
    """Torque in the middle of each step and state at its end."""
    parameters, state, following = np.array([coulomb, stiffness]), np.array([start]), np.zeros(1)
    out = np.empty((2, len(velocity)))
    for k, v in enumerate(velocity):
        out[0, k] = Dahl.law(0.0, v, 0.0, state, following, parameters, step)[0]
        out[1, k] = following[0]
        state, following = following, state
    return out[0], out[1]


@pytest.mark.parametrize(("speed", "step"), [(1.0, 1e-3), (-30.0, 1e-3), (1e-4, 3.0), (2.0, 0.2)])
def test_the_virgin_curve_is_exact_at_any_speed_and_step(speed: float, step: float) -> None:
    force, end = along(np.full(50, speed), step)
    path = speed * step * (np.arange(50) + 0.5)
    for torque, x in ((force, path), (end, path + 0.5 * speed * step)):
        expected = np.sign(speed) * COULOMB * -np.expm1(-STIFFNESS * np.abs(x) / COULOMB)
        np.testing.assert_allclose(torque, expected, rtol=1e-13)


def test_small_motions_meet_a_spring() -> None:
    """F = sigma x (1 - sigma x / (2 F_c) + ...): relative distance from the spring below sigma x / (2 F_c)."""
    force, _ = along(np.full(20, 1e-3), 1e-3)
    x = 1e-6 * (np.arange(20) + 0.5)
    assert np.all(np.abs(force / (STIFFNESS * x) - 1) <= STIFFNESS * x / (2 * COULOMB))
    _, _, slope = Dahl.law(0.0, 0.0, 0.0, np.zeros(1), np.zeros(1), np.array([COULOMB, STIFFNESS]), 1e-3)
    assert slope == pytest.approx(STIFFNESS * 0.5e-3, rel=1e-14)


@pytest.mark.parametrize("amplitude", [1e-3, 0.02, 0.5])
def test_the_work_of_a_steady_loop_has_its_closed_form(amplitude: float) -> None:
    """W = 4 F_c A (1 - tanh(a) / a), a = sigma A / F_c: from 4/3 sigma^2 A^3 / F_c to the Coulomb loop 4 F_c A.

    The midpoint rule misses a branch by dx^2 / 24 times the change of slope, which is below 2 sigma.
    """
    n, a = 400, STIFFNESS * amplitude / COULOMB
    step = 2 * amplitude / n  # speed 1
    velocity, peak = np.repeat([1.0, -1.0], n), COULOMB * np.tanh(a)
    force, end = along(velocity, step, start=-peak)
    expected = 4 * COULOMB * amplitude * (1 - np.tanh(a) / a)
    assert np.sum(force * velocity * step) == pytest.approx(
        expected, abs=2 * step**2 / 24 * 2 * STIFFNESS, rel=1e-12
    )
    assert (end[n - 1], end[-1]) == pytest.approx((peak, -peak), rel=1e-12)


def test_refining_the_step_four_times_reduces_the_error_sixteenfold() -> None:
    def exact(t: float, z: FloatArray) -> FloatArray:
        v = np.cos(2 * np.pi * t)
        return STIFFNESS * (v - np.abs(v) * z / COULOMB)

    errors = []
    for n in (100, 400):
        t = (np.arange(n) + 0.5) / n
        pieces = [0.0, 0.25, 0.75, 1.0]  # reversals
        z, start = np.empty(n), np.zeros(1)
        for a, b in pairwise(pieces):
            part = solve_ivp(exact, (a, b), start, rtol=1e-11, atol=1e-13, dense_output=True)
            inside = (t > a) & (t < b)
            z[inside], start = part.sol(t[inside])[0], part.y[:, -1]
        errors.append(np.abs(along(np.cos(2 * np.pi * t), 1 / n)[0] - z).max())
    assert 12 < errors[0] / errors[1] < 20
    assert errors[1] < 1e-3 * COULOMB


def test_a_stiff_bristle_stays_at_the_level_whatever_the_step() -> None:
    rng = np.random.default_rng(3)
    velocity = rng.standard_normal(2000) * 10 ** rng.uniform(-6, 3, 2000)
    force, end = along(velocity, 1e-3, stiffness=1e6)
    assert max(np.abs(force).max(), np.abs(end).max()) <= COULOMB * (1 + 1e-14)
    sliding = np.abs(velocity) > 0.1  # 50 times the path of relaxation in half a step
    np.testing.assert_allclose(force[sliding], COULOMB * np.sign(velocity[sliding]), rtol=1e-14)


def test_no_motion_gains_more_than_was_stored() -> None:
    """Work = loss + change of z^2 / (2 sigma); midpoint rule: dx^3 / 24 |d2F/dx2|, at most 2 sigma^2 / F_c, a step."""
    rng = np.random.default_rng(4)
    velocity, step = np.repeat(rng.standard_normal(300), 10), 2e-3
    force, end = along(velocity, step)
    work = np.cumsum(force * velocity * step)
    allowed = np.cumsum(np.abs(velocity * step) ** 3) / 24 * 2 * STIFFNESS**2 / COULOMB
    assert np.all(work >= end**2 / (2 * STIFFNESS) - allowed)
    assert allowed[-1] < 0.01 * work[-1]


@pytest.mark.parametrize("torque", [-0.7, 0.0, 0.5])
@pytest.mark.parametrize("velocity", [-20.0, -0.3, 0.01, 3.0])
def test_the_slope_is_the_central_difference_of_the_torque(velocity: float, torque: float) -> None:
    h = 1e-4 * abs(velocity)
    forces = [along(np.array([velocity + d]), 0.01, torque)[0][0] for d in (h, -h)]
    parameters = np.array([COULOMB, STIFFNESS])
    slope = Dahl.law(0.0, velocity, 0.0, np.array([torque]), np.zeros(1), parameters, 0.01)[2]
    # f''' / f' is (rate t)^2 = 0.0625: error below h^2 * 0.0625 of the slope; rounding 1e-16 / h.
    assert slope == pytest.approx((forces[0] - forces[1]) / (2 * h), rel=1e-6, abs=1e-9)


def test_a_step_of_no_length_keeps_the_state_and_needs_no_velocity() -> None:
    following = np.zeros(1)
    for velocity in (0.0, -3.0):
        out = Dahl.law(0.0, velocity, 0.0, np.array([0.3]), following, np.array([COULOMB, STIFFNESS]), 0.0)
        assert (*out, following[0]) == (0.3, 0.0, 0.0, 0.3)


def test_linearisation_ends_in_the_spring_and_in_coulomb_friction(at: Callable[..., Place]) -> None:
    """Small: sigma. Large: E[df/dv] of F_c sign(v), 2 F_c times the density of v at 0; the core states 2 %."""
    parameters, omega = np.array([COULOMB, STIFFNESS]), 50.0
    small = Dahl.linearize(parameters, at("motor"), Motion(position_rms=1e-6, velocity_rms=5e-5, omega=omega))
    assert float(small.stiffness) == pytest.approx(STIFFNESS, rel=0.01)
    large = Dahl.linearize(parameters, at("motor"), Motion(position_rms=20.0, velocity_rms=1e3, omega=omega))
    assert float(large.damping) == pytest.approx(2 * COULOMB / (np.sqrt(2 * np.pi) * 1e3), rel=0.03)
    assert abs(float(large.stiffness)) < 0.05 * omega * float(large.damping)
