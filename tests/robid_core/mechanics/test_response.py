"""The response against closed forms, its twin, finite differences and the exact discretisation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete

from robid_core.errors import ConfigurationError
from robid_core.mechanics import (
    Mechanism,
    linear_model,
    response,
    response_with_gradient,
    second_order_model,
    solve_equilibrium,
    with_motor_impedance,
)
from robid_core.mechanics.elimination import plan_of
from robid_core.mechanics.reference import response_by_solving

_OMEGA = 2 * np.pi * np.geomspace(4, 80, 25)
_SAMPLE_TIME = 1e-3


def _model(arm: Any, n_config: int = 3, motor_damping: Any = None, **changed: Any) -> Any:
    mechanism = arm.mechanism
    angle = np.random.default_rng(6).uniform(-1.2, 1.2, (n_config, mechanism.n_axis))
    motor = np.linalg.solve(mechanism.gear, angle.T).T
    z = solve_equilibrium(mechanism, arm.stiffness, motor).position
    arm = replace(arm, **changed)
    return second_order_model(arm.mechanism, arm.stiffness, arm.damping, z, motor_damping)


def test_two_masses_and_a_spring_respond_as_the_textbook_says(two_mass: Any) -> None:
    arm = replace(two_mass, damping=np.array([0.5]))
    model = _model(arm, n_config=1)
    rotor, load, k, d, r = 2e-3, 0.3, 3e3, 0.5, 0.1
    s = 1j * _OMEGA
    gear = k + d * s
    expected = (load * s**2 + gear) / (rotor * (load * s**2 + gear) + r**2 * load * gear)
    np.testing.assert_allclose(response(model, _OMEGA)[0, :, 0, 0], expected, rtol=1e-11)


@pytest.mark.parametrize("name", ["three_axis", "half_rigid", "carriage"])
@pytest.mark.parametrize("hold", [None, _SAMPLE_TIME])
def test_kernel_agrees_with_its_twin(name: str, hold: float | None, request: pytest.FixtureRequest) -> None:
    arm = request.getfixturevalue(name)
    model = _model(arm, motor_damping=np.full(arm.mechanism.n_axis, 0.01))
    ours, twin = response_with_gradient(model, _OMEGA, hold), response_by_solving(model, _OMEGA, hold)
    for field in ("response", "spring_vectors", "motor_vectors"):
        got, expected = getattr(ours, field), getattr(twin, field)
        assert got.shape == expected.shape
        # elimination without pivoting loses at most the damping ratio, two digits here
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-11 * abs(expected).max(initial=1.0))
    alone = response(model, _OMEGA, hold)  # other sums are fused where nothing else is eliminated
    np.testing.assert_allclose(alone, ours.response, rtol=0, atol=1e-14 * abs(alone).max())


@pytest.mark.parametrize("seed", range(12))
def test_trees_with_coupled_rigid_and_elastic_gears_agree_with_the_twin(draw_chain: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_joint = 1 + seed
    chain = draw_chain(rng, n_joint, seed % 2 == 0)
    chain = replace(chain, mass=np.maximum(chain.mass, 0.5))  # the last body of a branch needs a mass
    joints = rng.permutation(n_joint)
    n_axis = int(rng.integers(1, n_joint + 1))
    gear = 0.02 * (np.diag(rng.uniform(0.5, 1.5, n_axis)) + np.triu(rng.random((n_axis, n_axis)) < 0.2, 1))
    inertia, elastic = rng.uniform(1e-4, 1e-3, n_axis), rng.random(n_axis) < 0.7
    mechanism = Mechanism(chain, gear, inertia, joints[:n_axis], joints[n_axis:], elastic)
    stiffness, position = (
        rng.uniform(1e4, 1e5, mechanism.n_spring),
        rng.uniform(-1, 1, mechanism.n_coordinate),
    )
    damping = 2e-3 * stiffness  # every mode is damped by 5 % and more at 8 Hz
    model = second_order_model(mechanism, stiffness, damping, position, np.full(n_axis, 0.01))
    omega = _OMEGA[: int(rng.integers(1, 20))]
    ours, twin = (
        solve(model, omega, _SAMPLE_TIME) for solve in (response_with_gradient, response_by_solving)
    )
    for field in ("response", "spring_vectors", "motor_vectors"):
        got, expected = getattr(ours, field), getattr(twin, field)
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-10 * abs(expected).max(initial=1.0))


@pytest.mark.parametrize("hold", [None, _SAMPLE_TIME])
def test_a_line_is_the_same_in_any_company(three_axis: Any, hold: float | None) -> None:
    model = _model(three_axis)
    all_lines = response_with_gradient(model, _OMEGA, hold)
    for some in ([7], [0, 24], list(range(3, 20))):  # fewer than the lanes of a register, and more
        few = response_with_gradient(model, _OMEGA[some], hold)
        np.testing.assert_array_equal(few.response, all_lines.response[:, some])
        np.testing.assert_array_equal(few.spring_vectors, all_lines.spring_vectors[:, some])
        np.testing.assert_array_equal(few.motor_vectors, all_lines.motor_vectors[:, some])
    assert response(model, np.zeros(0), hold).shape == (3, 0, 3, 3)


def test_elimination_keeps_branches_of_a_tree_apart() -> None:
    # A chain of three joints behind three springs and motors; then two such chains on one base.
    dense, apart = np.ones((1, 3, 3)), np.kron(np.eye(2), np.ones((3, 3)))[None]
    n_target = []
    for mass, n_axis in ((dense, 3), (apart, 6)):
        none = np.zeros((1, n_axis, n_axis))
        inertia = np.block([[np.eye(n_axis)[None], none], [none, mass]])
        springs = np.hstack((np.eye(n_axis), -np.eye(n_axis)))
        border = np.concatenate((np.eye(n_axis, 2 * n_axis), springs))
        n_target.append(
            len(plan_of(inertia, inertia * 0, (springs.T @ springs)[None], border, n_axis).target)
        )
    assert n_target[1] == 2 * n_target[0]
    # Each motor: its arm, its place, its spring, so 3 + 2 (the spring is no column). Of the arm joints the first to go
    # touches two others, one place (its own) and three springs, and passes the place on to the next: rows below it
    # 2 + 1 + 1, then 1 + 2 + 2, then 0 + 3 + 3. With r rows, s of them springs: r (r + 1) / 2 - s (s + 1) / 2.
    assert n_target[0] == 3 * (3 + 2) + (10 - 1) + (15 - 3) + (21 - 6)


def test_a_coordinate_without_mass_is_refused(two_mass: Any) -> None:
    model = _model(replace(two_mass, damping=np.array([0.5])), n_config=2)
    mass = model.mass.copy()
    mass[1, 1, 1] = 0.0
    weightless = replace(model, mass=mass)
    with pytest.raises(ConfigurationError, match="configuration 2: the mass matrix is singular"):
        response(weightless, _OMEGA, _SAMPLE_TIME)
    assert np.isfinite(response(weightless, _OMEGA)).all()  # without hold nothing asks how it moves at once


def test_one_configuration_needs_no_leading_axis(three_axis: Any) -> None:
    many = _model(three_axis)
    one = replace(many, mass=many.mass[1], damping=many.damping, stiffness=many.stiffness[1])
    one = replace(one, damping=many.damping[1])
    np.testing.assert_array_equal(response(one, _OMEGA), response(many, _OMEGA)[1])
    assert response_with_gradient(one, _OMEGA).spring_vectors.shape == (25, 4, 3)


@pytest.mark.parametrize("hold", [None, _SAMPLE_TIME])
def test_gradient_vectors_give_the_finite_difference(three_axis: Any, hold: float | None) -> None:
    viscous = np.array([0.02, 0.01, 0.015])
    model = _model(three_axis, motor_damping=viscous)
    gradient = response_with_gradient(model, _OMEGA, hold)
    x, v, w = gradient.spring_vectors, gradient.motor_vectors, _OMEGA[:, None, None]

    def outer(vectors: Any, i: int) -> Any:
        return vectors[..., i, :, None] * vectors[..., i, None, :]

    def difference(up: Any, down: Any, step: float) -> Any:
        return (response(up, _OMEGA, hold) - response(down, _OMEGA, hold)) / (2 * step)

    def check(got: Any, expected: Any) -> None:
        np.testing.assert_allclose(got, expected, rtol=0, atol=2e-5 * abs(expected).max())

    # Steps of 1e-4: the second-order remainder is (1e-4 / 2 zeta)^2 with damping ratios above 0.02, below 2e-5
    # (of a motor's damper, 1e-5 beside 0.01: (1e-3)^2).
    for s in range(4):
        step = np.zeros(4)
        step[s] = 1e-4 * three_axis.stiffness[s]
        e = np.outer(model.spring_directions[s], model.spring_directions[s])
        up = replace(model, stiffness=model.stiffness + step[s] * e)
        down = replace(model, stiffness=model.stiffness - step[s] * e)
        check(-outer(x, s), difference(up, down, step[s]))
        size = 1e-3 * three_axis.damping[s]
        up, down = (
            replace(model, damping=model.damping + size * e),
            replace(model, damping=model.damping - size * e),
        )
        check(-1j * w * outer(x, s), difference(up, down, size))
    for a in range(3):
        e = np.zeros_like(model.mass[0])
        e[a, a] = 1.0
        up, down = (
            replace(model, damping=model.damping + 1e-5 * e),
            replace(model, damping=model.damping - 1e-5 * e),
        )
        check(-1j * w * outer(v, a), difference(up, down, 1e-5))
    e = np.zeros_like(model.mass[0])
    e[0, 0] = 1.0
    up, down = replace(model, mass=model.mass + 1e-7 * e), replace(model, mass=model.mass - 1e-7 * e)
    expected = difference(up, down, 1e-7)
    # the inertia moves the images too, which the vectors leave out
    np.testing.assert_allclose(w**2 * outer(v, 0), expected, rtol=0, atol=1e-3 * abs(expected).max())


def test_spring_constants_enter_the_model_as_the_gradient_takes_them(three_axis: Any) -> None:
    # At fixed positions dK/dk_s is the outer product of the spring's direction: the same for robot and gradient.
    k = three_axis.stiffness.copy()
    k[3] *= 1.001
    model, stiffer = _model(three_axis), _model(three_axis, stiffness=k)
    e = model.spring_directions[3]
    expected = model.stiffness + 0.001 * three_axis.stiffness[3] * np.outer(e, e)
    np.testing.assert_allclose(stiffer.stiffness, expected, rtol=0, atol=1e-10 * abs(expected).max())


def test_torque_and_angle_are_reciprocal(three_axis: Any) -> None:
    g = response(_model(three_axis), _OMEGA, _SAMPLE_TIME)
    np.testing.assert_allclose(g, np.swapaxes(g, -1, -2), rtol=0, atol=1e-12 * abs(g).max())


@pytest.mark.parametrize("name", ["three_axis", "half_rigid", "carriage"])
def test_held_torque_and_sampled_position_follow_the_exact_discretisation(
    name: str, request: pytest.FixtureRequest
) -> None:
    arm = request.getfixturevalue(name)
    mechanism, n_axis = arm.mechanism, arm.mechanism.n_axis
    viscous = np.full(n_axis, 0.02 if name != "carriage" else 200.0)
    z = solve_equilibrium(
        mechanism, arm.stiffness, np.linalg.solve(mechanism.gear, np.full(n_axis, 0.5))
    ).position
    model = second_order_model(mechanism, arm.stiffness, arm.damping, z, viscous)
    state_space = linear_model(mechanism, arm.stiffness, arm.damping, z, ("motor_angle",), viscous)
    matrices = (state_space.a, state_space.b, state_space.c, state_space.d)
    a, b, c, d, _ = cont2discrete(matrices, _SAMPLE_TIME)
    shift = np.exp(1j * _OMEGA * _SAMPLE_TIME)[:, None, None]
    exact = -(_OMEGA[:, None, None] ** 2) * (
        c @ np.linalg.solve(shift * np.eye(len(a)) - a, b.astype(complex)) + d
    )
    # the bound of the docstring
    inverse = np.linalg.inv(model.mass)
    sampling = 2 * np.pi / _SAMPLE_TIME
    near = 1 - _OMEGA / sampling
    damped = abs((inverse @ model.damping @ inverse)[:n_axis, :n_axis]).max()
    sprung = abs((inverse @ model.stiffness @ inverse)[:n_axis, :n_axis]).max()
    bound = (
        2.2 * damped * _OMEGA**3 / sampling**4 / near**4 + 5.1 * sprung * _OMEGA**4 / sampling**6 / near**6
    )
    error = abs(response(model, _OMEGA, _SAMPLE_TIME) - exact).max(axis=(1, 2))
    rounding = 1e-9 * abs(exact).max()  # of the discrete matrices
    assert (
        error <= 1.2 * bound + rounding
    ).all()  # 1.2: terms of the next order in (motor's decay) / sampling
    # and the bound says something: without the images the error is far larger at the last lines
    plain = (
        response(model, _OMEGA)
        * (np.exp(-0.5j * _OMEGA * _SAMPLE_TIME) * np.sinc(_OMEGA * _SAMPLE_TIME / 2 / np.pi))[:, None, None]
    )
    assert abs(plain - exact).max(axis=(1, 2))[-1] > 5 * (1.2 * bound + rounding)[-1]


def test_frequencies_at_or_below_zero_are_refused(three_axis: Any) -> None:
    with pytest.raises(ConfigurationError, match="frequencies must be finite and above zero"):
        response(_model(three_axis), np.array([0.0, 1.0]))


@pytest.mark.parametrize("hold", [None, _SAMPLE_TIME])
def test_an_impedance_at_the_motors_is_what_more_damping_and_inertia_would_be(
    three_axis: Any, hold: float | None
) -> None:
    """Dampers go into the matrices exactly; inertia too, but for the images of the held case, which it leaves alone."""
    n_axis = three_axis.mechanism.n_axis
    plain, damped = (_model(three_axis, motor_damping=np.full(n_axis, size)) for size in (0.01, 0.03))
    base = response_with_gradient(plain, _OMEGA, hold)
    impedance = np.broadcast_to(0.02j * _OMEGA[:, None], (3, len(_OMEGA), n_axis))
    made, known = (
        with_motor_impedance(base, impedance, _OMEGA, hold),
        response_with_gradient(damped, _OMEGA, hold),
    )
    for field in ("response", "spring_vectors", "motor_vectors"):
        got, expected = getattr(made, field), getattr(known, field)
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-10 * abs(expected).max())
    mass, motors = plain.mass.copy(), np.arange(n_axis)
    mass[:, motors, motors] *= 1.01
    more = (mass - plain.mass)[:, motors, motors]
    heavier = with_motor_impedance(base, -(_OMEGA**2)[:, None] * more[:, None], _OMEGA, hold)
    expected = response_with_gradient(replace(plain, mass=mass), _OMEGA, hold).motor_vectors
    np.testing.assert_allclose(heavier.motor_vectors, expected, rtol=0, atol=1e-10 * abs(expected).max())
