"""The linear model against finite differences of the nonlinear one, and its named outputs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core.errors import ConfigurationError
from robid_core.mechanics import linear_model, second_order_model, solve_equilibrium
from robid_core.mechanics.chain import rotation_about
from robid_core.mechanics.reference import acceleration_by_solving

_ARMS = ("three_axis", "half_rigid", "carriage")


def _at_rest(arm: Any) -> tuple[Any, Any]:
    mechanism = arm.mechanism
    angle = np.array([0.4, -0.7, 0.9])[: mechanism.n_axis]
    rest = solve_equilibrium(mechanism, arm.stiffness, np.linalg.solve(mechanism.gear, angle))
    return rest.position, rest.torque


@pytest.mark.parametrize("name", _ARMS)
def test_state_space_is_the_slope_of_the_nonlinear_model(name: str, request: pytest.FixtureRequest) -> None:
    arm = request.getfixturevalue(name)
    mechanism = arm.mechanism
    n, n_axis = mechanism.n_coordinate, mechanism.n_axis
    viscous = np.linspace(0.01, 0.03, n_axis)
    friction = (np.zeros(n_axis), viscous, np.ones(n_axis), np.zeros(n_axis))
    z, torque = _at_rest(arm)
    model = linear_model(mechanism, arm.stiffness, arm.damping, z, motor_damping=viscous)

    def acceleration(state: Any, u: Any) -> Any:
        return acceleration_by_solving(
            mechanism, arm.stiffness, arm.damping, friction, state[:n], state[n:], u
        )

    rest = np.concatenate((z, np.zeros(n)))
    step = 1e-4
    moves = step * np.eye(2 * n)
    slope = np.array(
        [acceleration(rest + dx, torque) - acceleration(rest - dx, torque) for dx in moves]
    ).T / (2 * step)
    pushes = np.eye(n_axis)
    gain = np.array([acceleration(rest, torque + du) - acceleration(rest, torque) for du in pushes]).T
    # Central differences: step^2 = 1e-8 of the third derivative, which is of the size of the first; rounding of
    # the accelerations (1e-7, see the equilibrium test) over the step: 1e-3 on entries of 1e6.
    np.testing.assert_allclose(model.a[n:], slope, rtol=0, atol=1e-7 * abs(slope).max() + 1e-12)
    np.testing.assert_allclose(model.b[n:], gain, rtol=0, atol=1e-9 * abs(gain).max())
    np.testing.assert_array_equal(model.a[:n], np.eye(n, 2 * n, n))
    np.testing.assert_array_equal(model.b[:n], 0)


def test_outputs_are_what_their_names_say(three_axis: Any) -> None:
    mechanism = three_axis.mechanism
    n, n_axis = mechanism.n_coordinate, mechanism.n_axis
    z, _ = _at_rest(three_axis)
    outputs = ("motor_angle", "motor_speed", "motor_acceleration", "arm_angle", "joint_torque")
    model = linear_model(mechanism, three_axis.stiffness, three_axis.damping, z, outputs)
    assert model.output_names[:4] == ("motor_angle.axis_1", "motor_angle.axis_2", "motor_angle.axis_3",
                                      "motor_speed.axis_1")  # fmt: skip
    assert model.input_names == ("torque.axis_1", "torque.axis_2", "torque.axis_3")
    assert model.state_names[n_axis] == "axis_1"
    assert model.state_names[n] == "motor.axis_1.rate"
    x, u = np.random.default_rng(0).normal(size=(2, 2 * n))
    u = u[:n_axis]
    y = dict(zip(model.output_names, model.c @ x + model.d @ u, strict=True))
    rate = model.a @ x + model.b @ u
    arm_coordinate = [model.state_names.index(f"axis_{a}") for a in (1, 2, 3)]
    # the gear's spring and damper are what moves the arm
    twist = mechanism.gear @ x[:n_axis] - x[arm_coordinate]
    twist_rate = mechanism.gear @ x[n : n + n_axis] - x[[n + i for i in arm_coordinate]]
    through_gear = three_axis.stiffness[:3] * twist + three_axis.damping[:3] * twist_rate
    for a in range(3):
        assert y[f"motor_angle.axis_{a + 1}"] == pytest.approx(x[a], rel=1e-14)
        assert y[f"motor_speed.axis_{a + 1}"] == pytest.approx(x[n + a], rel=1e-14)
        assert y[f"motor_acceleration.axis_{a + 1}"] == pytest.approx(rate[n + a], rel=1e-12)
        assert y[f"arm_angle.axis_{a + 1}"] == pytest.approx(x[arm_coordinate[a]], rel=1e-14)
        assert y[f"joint_torque.axis_{a + 1}"] == pytest.approx(through_gear[a], rel=1e-9)


def test_frame_acceleration_is_the_second_derivative_of_the_frames_position(three_axis: Any) -> None:
    mechanism = three_axis.mechanism
    chain = mechanism.chain
    n = mechanism.n_coordinate
    z, _ = _at_rest(three_axis)
    model = linear_model(
        mechanism, three_axis.stiffness, three_axis.damping, z, ("frame_acceleration.axis_3",)
    )
    assert model.output_names == tuple(f"frame_acceleration.axis_3.{direction}" for direction in "xyz")

    def origin(coordinates: Any) -> Any:
        joint = mechanism.constraint_map @ coordinates
        place, axes = np.zeros(3), np.eye(3)
        for j in range(chain.n_coordinate):  # a chain without branches that ends with axis_3
            place = place + axes @ chain.translation[j]
            axes = axes @ rotation_about(chain.axis[j], joint[j])
        return place

    push = np.array([0.3, -0.2, 0.5])
    acceleration = model.b[n:] @ push
    step = 1e-4
    # from rest z(t) = z + a t^2 / 2, so that the origin's acceleration is its slope along a
    slope = (
        origin(z + step * acceleration / abs(acceleration).max())
        - origin(z - step * acceleration / abs(acceleration).max())
    ) / (2 * step)
    np.testing.assert_allclose(model.d @ push, slope * abs(acceleration).max(), rtol=1e-6)


def test_joint_torque_of_a_rigid_axis_is_what_its_load_needs(carriage: Any) -> None:
    z, _ = _at_rest(carriage)
    model = linear_model(carriage.mechanism, carriage.stiffness, carriage.damping, z, ("joint_torque",))
    np.testing.assert_allclose(model.d, [[1.0]], rtol=1e-14)  # no rotor: all force reaches the carriage


def test_second_order_form_and_state_space_are_the_same_model(three_axis: Any) -> None:
    z, _ = _at_rest(three_axis)
    viscous = np.array([0.01, 0.02, 0.005])
    arguments = (three_axis.mechanism, three_axis.stiffness, three_axis.damping, z)
    second = second_order_model(*arguments, viscous)
    model = linear_model(*arguments, motor_damping=viscous)
    n = three_axis.mechanism.n_coordinate
    np.testing.assert_allclose(
        second.mass @ model.a[n:, :n], -second.stiffness, atol=1e-9 * second.stiffness.max()
    )
    np.testing.assert_allclose(
        second.mass @ model.a[n:, n:], -second.damping, atol=1e-9 * second.damping.max()
    )
    np.testing.assert_allclose(second.mass @ model.b[n:], second.input_map, atol=1e-12)
    np.testing.assert_allclose(second.stiffness, second.stiffness.T, atol=1e-12 * second.stiffness.max())


def test_an_unknown_output_or_body_is_refused_with_what_there_is(three_axis: Any) -> None:
    z, _ = _at_rest(three_axis)
    arguments = (three_axis.mechanism, three_axis.stiffness, three_axis.damping, z)
    with pytest.raises(
        ConfigurationError, match="no output 'motor_speeds'; there are motor_angle, motor_speed"
    ):
        linear_model(*arguments, ("motor_speeds",))
    with pytest.raises(ConfigurationError, match="no body 'tool'"):
        linear_model(*arguments, ("frame_acceleration.tool",))
