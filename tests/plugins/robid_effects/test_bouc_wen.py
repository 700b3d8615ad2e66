"""Bouc-Wen hysteresis against its equation, its closed forms (n = 1, n = 2, straight unloading), its loop's area."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from robid_core import Motion, Place
from robid_effects.bouc_wen import BoucWen
from robid_effects.dahl import Dahl

FloatArray = npt.NDArray[np.float64]

STIFFNESS, ULTIMATE = 300.0, 3.0


def along(
    velocity: FloatArray,
    step: float,
    sharpness: float,
    share: float,
    start: float = 0.0,
    stiffness: float = STIFFNESS,
) -> tuple[FloatArray, FloatArray]:
    """Torque in the middle of each step and state at its end."""
    parameters = np.array([stiffness, ULTIMATE, sharpness, share])
    state, following = np.array([start]), np.zeros(1)
    out = np.empty((2, len(velocity)))
    for k, v in enumerate(velocity):
        out[0, k] = BoucWen.law(0.0, v, 0.0, state, following, parameters, step)[0]
        out[1, k] = following[0]
        state, following = following, state
    return out[0], out[1]


def exact(t: FloatArray, amplitude: float, sharpness: float, share: float) -> FloatArray:
    """Torque under the deflection A sin(t), by LSODA from reversal to reversal."""

    def rate(t: float, z: FloatArray) -> FloatArray:
        v, y = amplitude * np.cos(t), z / ULTIMATE
        return STIFFNESS * (v - np.abs(y) ** sharpness * ((1 - share) * v + share * np.abs(v) * np.sign(y)))

    z, start, edges = np.empty(len(t)), np.zeros(1), np.pi / 2 * np.arange(-1, 2 * int(t[-1] / np.pi) + 5, 2)
    edges[0] = 0.0
    for a, b in pairwise(edges):
        inside = (t > a) & (t < b)
        part = solve_ivp(rate, (a, b), start, method="LSODA", rtol=1e-10, atol=1e-12, dense_output=True)
        z[inside], start = part.sol(t[inside])[0], part.y[:, -1]
    return z


@pytest.mark.parametrize(("sharpness", "share"), [(1.0, 1.0), (1.0, 0.5), (1.5, 0.6), (2.0, 0.5), (5.0, 0.8)])
def test_force_and_loop_area_are_those_of_the_equation(sharpness: float, share: float) -> None:
    """Second order: four times the steps, a sixteenth of the error (twelve where z = 0 bends the rate, n = 1)."""
    amplitude, errors = 2.5 * ULTIMATE / STIFFNESS, []
    for n in (400, 1600):
        t = (np.arange(2 * n) + 0.5) * 2 * np.pi / n
        z = exact(t, amplitude, sharpness, share)
        velocity = amplitude * np.cos(t)
        force, _ = along(velocity, 2 * np.pi / n, sharpness, share)
        errors.append(np.abs(force - z).max() / ULTIMATE)
    assert errors[1] < 1.5e-4
    assert errors[0] / errors[1] > 10
    area, expected = (np.sum((torque * velocity)[-n:]) * 2 * np.pi / n for torque in (force, z))
    assert area == pytest.approx(expected, rel=1e-4)
    assert 0 < area < 4 * ULTIMATE * amplitude


@pytest.mark.parametrize("speed", [1.0, -40.0])
def test_loading_follows_the_hyperbolic_tangent_for_n_2_and_ends_at_the_ultimate_torque(speed: float) -> None:
    n = 1000
    step = 10 * ULTIMATE / STIFFNESS / abs(speed) / n
    force, end = along(np.full(n, speed), step, 2.0, 0.5)
    x = speed * step * (np.arange(n) + 0.5)
    # curvature of tanh below 0.77, step 0.01 in its argument: 0.77 * 1e-4 / 2 at most, in the middle of a step
    np.testing.assert_allclose(force, ULTIMATE * np.tanh(STIFFNESS * x / ULTIMATE), atol=ULTIMATE * 4e-5)
    assert end[-1] == pytest.approx(np.sign(speed) * ULTIMATE, rel=1e-8)
    assert np.abs(end).max() <= ULTIMATE


def test_with_n_1_and_beta_1_it_is_dahl() -> None:
    rng = np.random.default_rng(11)
    velocity, state, following = rng.standard_normal(300), np.zeros(1), np.zeros(1)
    force, end = along(velocity, 0.005, 1.0, 1.0)
    for k, v in enumerate(velocity):
        # beta = 1: the rate of slip is k / T on either way
        torque = Dahl.law(0.0, v, 0.0, state, following, np.array([ULTIMATE, STIFFNESS]), 0.005)[0]
        assert (force[k], end[k]) == pytest.approx((torque, following[0]), rel=1e-12)
        state, following = following, state


def test_with_beta_one_half_it_unloads_along_a_straight_line() -> None:
    force, _ = along(np.full(50, -1.0), 1e-4, 3.0, 0.5, start=0.9 * ULTIMATE)
    np.testing.assert_allclose(force, 0.9 * ULTIMATE - STIFFNESS * 1e-4 * (np.arange(50) + 0.5), rtol=1e-13)


@pytest.mark.parametrize(("sharpness", "share"), [(1.0, 0.5), (1.7, 0.75), (6.0, 1.0)])
def test_no_closed_motion_gains_energy(sharpness: float, share: float) -> None:
    rng = np.random.default_rng(12)
    n, t = 3000, 2 * np.pi * np.arange(3000)[:, None] / 3000
    for reach in (0.1, 1.0, 10.0):
        velocity = (
            np.cos(np.arange(1, 9) * t + 2 * np.pi * rng.random(8)).sum(axis=1) * reach * ULTIMATE / STIFFNESS
        )
        force, end = along(np.tile(velocity, 2), 2 * np.pi / n, sharpness, share)
        stored = (end[-1] ** 2 - end[n - 1] ** 2) / (
            2 * STIFFNESS
        )  # of a straight line; both nearly periodic
        assert np.sum(force[n:] * velocity) * 2 * np.pi / n > stored - 1e-12


def test_it_stays_within_the_ultimate_torque_whatever_the_step() -> None:
    rng = np.random.default_rng(13)
    velocity = rng.standard_normal(2000) * 10 ** rng.uniform(-7, 3, 2000)
    for sharpness in (1.0, 1.5, 20.0):
        force, end = along(velocity, 1e-3, sharpness, 0.7, stiffness=1e7)
        assert max(np.abs(force).max(), np.abs(end).max()) <= ULTIMATE
        assert np.all(
            force[np.abs(velocity) > 0.1] * np.sign(velocity[np.abs(velocity) > 0.1]) > 0.9 * ULTIMATE
        )


@pytest.mark.parametrize("torque", [-2.5, 0.0, 1.0])
@pytest.mark.parametrize("velocity", [-3.0, -0.02, 1e-3, 0.5])
def test_the_slope_is_the_central_difference_of_the_torque(velocity: float, torque: float) -> None:
    h = 1e-4 * abs(velocity)
    forces = [along(np.array([velocity + d]), 0.01, 2.3, 0.6, torque)[0][0] for d in (h, -h)]
    parameters = np.array([STIFFNESS, ULTIMATE, 2.3, 0.6])
    slope = BoucWen.law(0.0, velocity, 0.0, np.array([torque]), np.zeros(1), parameters, 0.01)[2]
    assert slope == pytest.approx((forces[0] - forces[1]) / (2 * h), rel=1e-6, abs=1e-9)


def test_linearisation_ends_in_the_spring_and_in_coulomb_friction(at: Callable[..., Place]) -> None:
    """Small: stiffness k. Large: 2 T times the density of the deflection's speed at 0; about 2 % as the core states."""
    parameters, omega = np.array([STIFFNESS, ULTIMATE, 2.0, 0.5]), 60.0
    small = BoucWen.linearize(
        parameters, at("gear"), Motion(position_rms=1e-6, velocity_rms=6e-5, omega=omega)
    )
    assert float(small.stiffness) == pytest.approx(STIFFNESS, rel=0.02)
    assert abs(float(small.damping)) * omega < 0.02 * STIFFNESS
    large = BoucWen.linearize(
        parameters, at("gear"), Motion(position_rms=5.0, velocity_rms=300.0, omega=omega)
    )
    assert float(large.damping) == pytest.approx(2 * ULTIMATE / (np.sqrt(2 * np.pi) * 300.0), rel=0.02)
