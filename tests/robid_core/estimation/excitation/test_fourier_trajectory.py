"""Fourier trajectories: rest at both ends, limits, and a search that is worth its evaluations."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from robid_core.estimation.excitation.criteria import Criterion, log_determinant
from robid_core.estimation.excitation.fourier_trajectory import (
    TrajectoryProblem,
    fitted,
    gram_of,
    kinematic_share,
    random_coefficients,
    rest_to_rest_basis,
    torque_share,
)
from robid_core.estimation.excitation.trajectory_search import _Descent, improved, search, state_slopes
from robid_core.estimation.rigid.rigid_torque import motor_torque, motor_torque_regressor
from robid_core.testing.robots import example_robot
from robid_excitation.fourier import Fourier, problem_of


def problem(criterion: Criterion = "log_det", **settings_: float) -> TrajectoryProblem:
    """Two links in a vertical plane, configuration off the middle."""
    settings_ = {"period_s": 4.0, "harmonics": 4, **settings_}
    return problem_of(example_robot(2), np.array([0.4, -0.9]), Fourier(criterion=criterion, **settings_))


@given(st.integers(2, 12), st.floats(0.5, 20.0))
@settings(max_examples=25, deadline=None)
def test_every_motion_is_at_rest_at_both_ends_and_has_no_mean(harmonics: int, period_s: float) -> None:
    n_time = 40 * harmonics
    basis = rest_to_rest_basis(harmonics, period_s, n_time)
    # Exactly, not to rounding; the end of the period is its start.
    assert (basis.speed[0] == 0).all()
    assert (basis.acceleration[0] == 0).all()
    size = np.abs(basis.position).max(axis=0)
    assert (np.abs(basis.position.mean(axis=0)) < 1e-12 * size).all()
    assert np.abs(basis.speed.mean(axis=0)).max() < 1e-12


def test_motions_are_derivatives_of_one_another_of_limited_bandwidth_and_orthonormal() -> None:
    harmonics, period_s, n_time = 5, 3.0, 400
    basis = rest_to_rest_basis(harmonics, period_s, n_time)
    spectrum = np.fft.rfft(basis.speed, axis=0)
    assert np.abs(spectrum[harmonics + 1 :]).max() < 1e-10
    omega = 2 * np.pi * np.arange(len(spectrum)) / period_s
    for lower, upper in ((basis.position, basis.speed), (basis.speed, basis.acceleration)):
        # Exact for a periodic signal: differentiation in frequency.
        derivative = np.fft.irfft(1j * omega[:, None] * np.fft.rfft(lower, axis=0), n=n_time, axis=0)
        np.testing.assert_allclose(derivative, upper, atol=1e-9 * np.abs(upper).max())
    np.testing.assert_allclose(basis.speed.T @ basis.speed / n_time, np.eye(8), atol=1e-10)


def test_the_basis_spans_all_such_speeds() -> None:
    # 2 n coefficients, two conditions: any speed of that bandwidth without mean at rest at t = 0 is in the span.
    draw, n_time = np.random.default_rng(0), 200
    turn = 2 * np.pi * np.arange(n_time) / n_time
    order = np.arange(1, 5)
    a, b = draw.normal(size=(2, 4))
    a[0], b[0] = -a[1:].sum(), -(order[1:] * b[1:]).sum()
    speed = np.cos(np.outer(turn, order)) @ a + np.sin(np.outer(turn, order)) @ b
    basis = rest_to_rest_basis(4, 1.0, n_time)
    residual = speed - basis.speed @ np.linalg.lstsq(basis.speed, speed)[0]
    assert np.abs(residual).max() < 1e-12 * np.abs(speed).max()


@pytest.mark.parametrize("stretch", [True, False])
def test_fitted_motions_keep_all_limits_and_use_them(stretch: bool) -> None:
    for torque in (25.0, 3.0):  # where kinematics bind, and where torque does
        wide = problem()
        tight = replace(wide, limits=replace(wide.limits, torque=np.full(2, torque)))
        coefficient = 1e3 * np.random.default_rng(1).normal(size=tight.shape)
        result = fitted(tight, coefficient, stretch)
        # On a grid that is no multiple of the one it was fitted on; between instants a wave of 60 samples per period
        # of its highest harmonic rises by 1 - cos(pi / 60) = 0.14 %, and torque has a few times that bandwidth.
        basis = rest_to_rest_basis(4, 4.0, 4001)
        position, speed, acceleration = basis.motion(result)
        limits = tight.limits
        assert (tight.centre + position <= limits.upper * 1.002).all()
        assert (tight.centre + position >= limits.lower * 1.002).all()
        assert (np.abs(speed) <= limits.speed * 1.002).all()
        used = np.abs(motor_torque(tight.drives, tight.centre + position, speed, acceleration)).max(axis=0)
        assert (used <= limits.torque * 1.01).all()
        largest = max(kinematic_share(tight, result).max(), torque_share(tight, result))
        assert largest == pytest.approx(1.0, abs=1e-3)


def test_a_motion_inside_its_limits_stays_as_it_is_unless_it_is_stretched() -> None:
    small = 1e-2 * random_coefficients(problem(), np.random.default_rng(2))
    np.testing.assert_array_equal(fitted(problem(), small), small)
    assert np.abs(fitted(problem(), small, stretch=True)).max() > 10 * np.abs(small).max()


def test_gram_matrix_is_that_of_the_weighted_regressor() -> None:
    p = problem()
    coefficient = random_coefficients(p, np.random.default_rng(3))
    basis = rest_to_rest_basis(4, 4.0, 240)
    position, speed, acceleration = basis.motion(coefficient)
    w = motor_torque_regressor(p.drives, p.centre + position, speed, acceleration)[:, :, p.column]
    rows = np.concatenate([w[:, axis] / p.noise[axis] for axis in range(2)]) / p.column_scale
    np.testing.assert_allclose(p.gram(coefficient), rows.T @ rows / 240, rtol=1e-9, atol=1e-12)
    assert gram_of(w, p.noise, p.column_scale).shape == (len(p.column), len(p.column))


def test_state_slopes_are_those_of_central_differences() -> None:
    p, draw = problem(), np.random.default_rng(4)
    state = draw.normal(size=(3, 6, 2)) * np.array([50.0, 100.0, 1000.0])[:, None, None]
    drives = replace(p.drives, friction_speed=np.full(2, 40.0))
    regressor = motor_torque_regressor(drives, *state)
    adjoint = draw.normal(size=regressor.shape) / (np.abs(regressor) + 1)
    ours = state_slopes(drives, *state, regressor, adjoint)
    for kind, step in enumerate((1e-3, 1e-3, 1.0)):
        for axis in range(2):
            moved = [state.copy(), state.copy()]
            moved[0][kind, :, axis] += step
            moved[1][kind, :, axis] -= step
            up, down = (np.sum(adjoint * motor_torque_regressor(drives, *one), axis=(1, 2)) for one in moved)
            expected = (up - down) / (2 * step)
            # Forward differences of a millionth of each state: relative error of that order.
            np.testing.assert_allclose(
                ours[kind][:, axis], expected, rtol=1e-3, atol=1e-5 * np.abs(expected).max()
            )


@pytest.mark.parametrize("criterion", get_args(Criterion))
def test_the_lagrangians_slope_is_its_derivative_limits_included(criterion: Criterion) -> None:
    p = problem(criterion)
    start = 1.3 * random_coefficients(p, np.random.default_rng(5))  # beyond its limits: constraints press
    descent = _Descent(p, start, 10, lambda done: None)
    unknown = (start / descent.size).ravel()
    value, slope = descent.value_and_slope(unknown)
    assert np.isfinite(value)
    for index in range(0, len(unknown), 3):
        step = np.zeros_like(unknown)
        step[index] = 1e-5
        difference = descent.value_and_slope(unknown + step)[0] - descent.value_and_slope(unknown - step)[0]
        assert slope[index] == pytest.approx(difference / 2e-5, rel=1e-3, abs=1e-3 * np.abs(slope).max())


# Gains in the logarithm of each criterion: the condition number 20 % smaller, standard errors 10 % smaller in the
# geometric mean of 13 parameters; Hadamard's ratio is flat for two links, where random motions are good already.
@pytest.mark.parametrize(
    ("criterion", "gain"), [("condition", 0.2), ("log_det", 2 * 13 * np.log(1.1)), ("hadamard", 0.3)]
)
def test_the_search_beats_the_best_of_as_many_random_trajectories(criterion: Criterion, gain: float) -> None:
    p, evaluations = problem(criterion), 150
    found = search(p, np.random.default_rng(6), 20, 1, evaluations)
    assert found.evaluations <= evaluations + 10  # L-BFGS may finish a line search that it has begun
    assert kinematic_share(p, found.coefficient).max() <= 1 + 1e-9
    assert torque_share(p, found.coefficient) <= 1
    generator = np.random.default_rng(7)
    best = min(p.cost(random_coefficients(p, generator)) for _ in range(evaluations))
    assert len(p.column) == 13
    assert found.cost < best - gain


@pytest.mark.full
def test_with_six_axes_standard_errors_are_a_third_smaller_than_with_the_best_random_trajectory() -> None:
    robot, where = example_robot(6), np.array([0.0, 0.1, -0.2, 0.0, 0.5, 0.0])
    p, evaluations = problem_of(robot, where, Fourier()), 120
    found = search(p, np.random.default_rng(1), 10, 1, evaluations)
    generator = np.random.default_rng(2)
    best = min(p.cost(random_coefficients(p, generator)) for _ in range(evaluations))
    # Geometric mean over the base parameters: the determinant's inverse is the product of their squares.
    assert np.exp((best - found.cost) / (2 * len(p.column))) > 1.5


def test_a_later_trajectory_completes_an_earlier_one() -> None:
    p, generator = problem(), np.random.default_rng(8)
    first = search(p, generator, 10, 1, 60)
    gram = p.gram(first.coefficient)
    second = search(replace(p, before=gram), generator, 10, 1, 60)
    both = gram + p.gram(second.coefficient)
    # Twice the same motion would add log 2 for each parameter.
    assert log_determinant(both) > log_determinant(2 * gram)
    assert second.cost == pytest.approx(-log_determinant(both), abs=1e-6)


def test_improving_never_makes_worse() -> None:
    p = problem()
    start = search(p, np.random.default_rng(9), 5, 1, 60).coefficient
    better, _ = improved(p, start, 6)
    # The cost is a logarithm of a determinant; coefficients that went through the search's scaling and back round it.
    assert p.cost(better) <= p.cost(start) + 1e-9
