"""Rest positions under gravity: a pendulum in closed form, balance of forces, and springs that are too weak."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from robid_core.errors import ConfigurationError, NotTrustworthy
from robid_core.mechanics import Chain, Mechanism, solve_equilibrium
from robid_core.mechanics.equilibrium import solve_rows
from robid_core.mechanics.reference import acceleration_by_solving


def _pendulum(stiffness: float) -> tuple[Mechanism, Any]:
    """Build a point mass of 2 kg at 0.5 m, its axis along -y, so that a positive angle lifts it; ratio 1/20."""
    chain = Chain(
        parent=np.array([-1]),
        joint_type=np.array([0]),
        axis=np.array([[0.0, -1.0, 0.0]]),
        rotation=np.eye(3)[None],
        translation=np.zeros((1, 3)),
        mass=np.array([2.0]),
        centre_of_mass=np.array([[0.5, 0.0, 0.0]]),
        inertia=np.zeros((1, 3, 3)),
        names=("swing",),
        gravity=np.array([0.0, 0.0, -9.81]),
    )
    one = np.ones(1)
    arm, elastic = np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64)
    mechanism = Mechanism(chain, np.eye(1) / 20, one, arm, elastic, np.ones(1, dtype=np.bool_))
    return mechanism, np.array([stiffness])


def test_a_pendulum_sags_until_spring_and_weight_balance() -> None:
    mechanism, stiffness = _pendulum(150.0)
    motor = np.linspace(-25, 25, 11)[:, None]
    rest = solve_equilibrium(mechanism, stiffness, motor)
    weight = 2.0 * 9.81 * 0.5 * np.cos(rest.joint[:, 0])
    np.testing.assert_allclose(150.0 * (motor[:, 0] / 20 - rest.joint[:, 0]), weight, rtol=0, atol=1e-11)
    np.testing.assert_allclose(rest.torque[:, 0], weight / 20, rtol=0, atol=1e-12)


def test_forces_balance_at_rest_for_every_kind_of_axis(three_axis: Any, half_rigid: Any) -> None:
    rng = np.random.default_rng(2)
    for arm in (three_axis, half_rigid):
        mechanism = arm.mechanism
        motor = np.linalg.solve(mechanism.gear, rng.uniform(-1.5, 1.5, (mechanism.n_axis, 4))).T
        rest = solve_equilibrium(mechanism, arm.stiffness, motor)
        np.testing.assert_array_equal(rest.position[:, : mechanism.n_axis], motor)
        np.testing.assert_allclose(rest.joint, rest.position @ mechanism.constraint_map.T, rtol=1e-14)
        none = np.zeros(mechanism.n_axis)
        friction = (none, none, none + 1, none)
        for z, torque in zip(rest.position, rest.torque, strict=True):
            moved = acceleration_by_solving(
                mechanism, arm.stiffness, arm.damping, friction, z, np.zeros_like(z), torque
            )
            # residual torque is rounding, 1e-16 of the spring torque of 1e4 N m, over inertias from 1e-4 kg m^2
            assert abs(moved).max() < 1e-7


def test_each_configuration_rests_as_if_it_were_alone(three_axis: Any) -> None:
    mechanism = three_axis.mechanism
    motor = np.linalg.solve(mechanism.gear, np.random.default_rng(3).uniform(-1.5, 1.5, (3, 11))).T
    together = solve_equilibrium(mechanism, three_axis.stiffness / 100, motor)  # sags by degrees, more steps
    for i in range(11):
        alone = solve_equilibrium(mechanism, three_axis.stiffness / 100, motor[i])
        # Newton's last step is below 1e-13, its error below rounding: of an angle of 1 rad, and of torques that
        # stiff springs make of it
        np.testing.assert_allclose(together.position[i], alone.position, rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(together.torque[i], alone.torque, rtol=0, atol=1e-11)


@pytest.mark.parametrize("n", [1, 2, 12])
def test_rows_are_solved_as_numpy_does(n: int) -> None:
    rng = np.random.default_rng(n)
    root = rng.normal(size=(4, n, n))
    matrix = root @ root.transpose(0, 2, 1) + np.eye(n)
    right = rng.normal(size=(4, n))
    expected = np.linalg.solve(matrix, right[..., None])[..., 0]
    solve_rows(matrix, right)
    # condition number up to (4 n)^2 times rounding
    np.testing.assert_allclose(right, expected, rtol=0, atol=1e-12)


def test_a_rigid_axis_is_where_its_motor_is(half_rigid: Any) -> None:
    mechanism = half_rigid.mechanism
    motor = np.array([20.0, -15.0])
    rest = solve_equilibrium(mechanism, half_rigid.stiffness, motor)
    assert rest.joint[1] == pytest.approx(20 / 300 - 15 / 40, rel=1e-14)
    assert rest.joint[0] != pytest.approx(20 / 50, rel=1e-6)


def test_a_fully_rigid_axis_needs_no_torque_on_a_level_rail(carriage: Any) -> None:
    rest = solve_equilibrium(carriage.mechanism, carriage.stiffness, np.array([[0.3]]))
    np.testing.assert_array_equal(rest.joint, [[0.3]])
    np.testing.assert_array_equal(rest.torque, [[0.0]])


OVERHEAD = np.array([[20 * np.pi / 2]])  # straight up the weight destiffens by m g l = 9.81 N m/rad


@pytest.mark.parametrize("stiffness", [9.82, 9.80, 9.0])
def test_a_mass_overhead_leans_to_a_side_where_its_spring_is_softer_than_its_weight(stiffness: float) -> None:
    """The upright pose is a rest with the first spring only; then the arm leans until k x = m g l sin(x)."""
    mechanism, springs = _pendulum(stiffness)
    rest = solve_equilibrium(mechanism, springs, OVERHEAD)
    lean = abs(rest.position[0, 1] - np.pi / 2)
    if stiffness > 9.81:
        assert lean < 1e-12
        return
    expected = brentq(lambda x: stiffness * x - 9.81 * np.sin(x), 1e-3, 1.5, xtol=1e-14)
    # A residual of eps * 9.81 N m over the stiffness that is left there, k - m g l cos(x) >= 0.02 N m/rad.
    assert lean == pytest.approx(expected, abs=1e-12)


def test_a_spring_too_weak_for_a_mass_overhead_is_refused_by_name_and_row() -> None:
    mechanism, springs = _pendulum(3.0)
    hanging = np.array([[-20 * np.pi / 2]])
    motor = np.concatenate([hanging, OVERHEAD, hanging, OVERHEAD])
    with pytest.raises(
        NotTrustworthy, match=r"configuration 2 \(and 1 more of 4\): coordinate 'swing' falls"
    ):
        solve_equilibrium(mechanism, springs, motor)
    rest = solve_equilibrium(mechanism, springs, motor, partial=True)
    assert sorted(rest.refused) == [1, 3]
    assert np.isnan(rest.position[[1, 3], 1]).all()
    assert np.isnan(rest.torque[[1, 3]]).all()
    alone = solve_equilibrium(mechanism, springs, hanging)
    np.testing.assert_array_equal(rest.position[[0, 2]], np.repeat(alone.position, 2, axis=0))


def test_a_joint_that_nothing_holds_is_refused_by_name(two_mass: Any) -> None:
    with pytest.raises(
        NotTrustworthy, match="coordinate 'axis_1' comes to no rest: its stiffness with gravity is 0"
    ):
        solve_equilibrium(two_mass.mechanism, np.zeros(1), np.zeros((1, 1)))


def test_spring_constants_of_the_wrong_number_or_sign_are_refused(three_axis: Any) -> None:
    motor = np.zeros((1, 3))
    for wrong in (three_axis.stiffness[:3], -three_axis.stiffness, np.full(4, np.nan)):
        with pytest.raises(ConfigurationError, match="stiffness needs 4 finite numbers"):
            solve_equilibrium(three_axis.mechanism, wrong, motor)
    with pytest.raises(ConfigurationError, match="give 3 finite angles"):
        solve_equilibrium(three_axis.mechanism, three_axis.stiffness, np.zeros((1, 2)))


def test_without_gravity_nothing_sags(three_axis: Any) -> None:
    chain = replace(three_axis.mechanism.chain, gravity=np.zeros(3))
    m = three_axis.mechanism
    weightless = Mechanism(chain, m.gear, m.rotor_inertia, m.arm, m.elastic, m.elastic_gear)
    motor = np.array([[10.0, -20.0, 30.0]])
    rest = solve_equilibrium(weightless, three_axis.stiffness, motor)
    np.testing.assert_allclose(rest.joint[0, m.arm], m.gear @ motor[0], rtol=1e-13)
    np.testing.assert_allclose(rest.torque, 0, atol=1e-12)
