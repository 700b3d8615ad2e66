"""Simulation against closed forms, scipy's integrator, its own check method and the linear response."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robid_core.errors import ConfigurationError, NotTrustworthy
from robid_core.mechanics import (
    Controller,
    SimulationDiverged,
    SimulationState,
    equivalent_damping,
    friction_terms,
    response,
    rest_state,
    second_order_model,
    simulate,
)
from robid_core.mechanics.closed_loop import run_blocks
from robid_core.mechanics.mechanical_model import spring_weights
from robid_core.mechanics.reference import acceleration_by_solving

_T = 1e-3


def _controller(n_axis: int, **gains: Any) -> Controller:
    zero = np.zeros(n_axis)
    values = {"speed_gain": zero, "integral_gain": zero, "position_gain": zero, "speed_feedforward": zero + 1,
              "torque_limit": zero + 1e3, "encoder_step": zero} | {k: zero + v for k, v in gains.items()}  # fmt: skip
    return Controller(**values)


def _friction(
    n_axis: int, coulomb: Any = 0.0, viscous: Any = 0.0, speed: float = 0.1, offset: Any = 0.0
) -> Any:
    zero = np.zeros(n_axis)
    return zero + coulomb, zero + viscous, zero + speed, zero + offset


def _motor_angles(arm: Any, n_lane: int = 1) -> Any:
    mechanism = arm.mechanism
    angle = np.random.default_rng(1).uniform(-0.8, 0.8, (n_lane, mechanism.n_axis))
    return np.linalg.solve(mechanism.gear, angle.T).T


def _run(arm: Any, controller: Any, friction: Any, state: Any, reference: Any, **more: Any) -> Any:
    forces = friction_terms(arm.mechanism, *friction)
    return simulate(
        arm.mechanism, arm.stiffness, arm.damping, controller, state, reference, forces=forces, **more
    )


def test_two_masses_on_a_spring_swing_at_the_frequency_of_the_textbook(two_mass: Any) -> None:
    # Reduced inertia of rotor and load seen from the arm; the rule keeps the amplitude of a linear oscillation
    # and swings
    # at W with cos(W h) = 1 - (w h)^2 / (2 + (w h)^2 / 6), which is w (1 - (w h)^4 / 480).
    rotor, load = 2e-3 * 10**2, 0.3
    omega = np.sqrt(3e3 * (1 / rotor + 1 / load))
    step = 2.5e-4
    swung = np.arccos(1 - (omega * step) ** 2 / (2 + (omega * step) ** 2 / 6)) / step
    assert abs(swung / omega - 1) < (omega * step) ** 4 / 400
    state = rest_state(two_mass.mechanism, two_mass.stiffness, np.zeros((1, 1)))
    position = state.position.copy()
    position[0] = [10 * 0.02, -0.02 * rotor / load]  # centre of mass at rest, twist 0.02 (1 + rotor / load)
    n = 2000
    run = _run(two_mass, _controller(1), _friction(1), replace(state, position=position), np.zeros((1, n, 1)))
    expected = 0.2 * np.cos(swung * _T * np.arange(n))
    # phase error: the first midpoint is extrapolated from acceleration zero, which only friction and c(q, v) see
    np.testing.assert_allclose(run.position[0, :, 0], expected, rtol=0, atol=1e-9)


def test_coulomb_friction_stops_a_motor_on_a_parabola_and_holds_it(two_mass: Any) -> None:
    # Motor alone (no spring): speed falls by coulomb / rotor a second, then creeps to rest without rattling.
    arm = replace(two_mass, stiffness=np.array([1e-9]))
    state = rest_state(arm.mechanism, arm.stiffness, np.zeros((1, 1)))
    coulomb, rotor, first = 0.2, 2e-3, 10.0
    moving = np.zeros((1, 2))
    moving[0, 0] = first
    n = 200
    friction = _friction(1, coulomb, speed=0.05)
    run = _run(
        arm,
        _controller(1),
        friction,
        replace(state, speed=moving),
        np.zeros((1, n, 1)),
        keep_coordinates=True,
    )
    t = _T * np.arange(n)
    deceleration = coulomb / rotor
    sliding = t < first / deceleration - 0.01
    expected = first * t - deceleration * t**2 / 2
    # tanh falls below one only in the last 0.05 * 5 rad/s: in the rest the parabola is exact but for rounding and
    # the first step, whose slope is that at the extrapolated speed
    np.testing.assert_allclose(run.position[0, sliding, 0], expected[sliding], rtol=0, atol=1e-6)
    assert abs(run.position[0, -1, 0] - first**2 / (2 * deceleration)) < 5e-3
    speed = np.diff(run.position[0, :, 0]) / _T
    assert (speed[:-1] >= speed[1:] - 1e-6).all()  # never accelerated: no rattling
    assert speed[-1] < 1e-3 * first


@pytest.mark.parametrize("stiff", [1.0, 1e6])
def test_friction_and_springs_beyond_the_step_stay_stable(three_axis: Any, stiff: float) -> None:
    arm = replace(three_axis, stiffness=stiff * three_axis.stiffness)
    state = rest_state(arm.mechanism, arm.stiffness, _motor_angles(arm))
    t = _T * np.arange(800)
    reference = (4.0 * np.sin(2 * np.pi * 5 * t))[None, :, None] * np.ones(3)
    controller = _controller(3, speed_gain=0.1, integral_gain=1.0, position_gain=3.0)
    run = _run(arm, controller, _friction(3, 0.5, 0.01, speed=0.08), state, reference)
    measured = np.diff(run.position[0], axis=0)[200:] / _T
    assert abs(measured).max() < 8.0


@pytest.mark.parametrize("name", ["three_axis", "half_rigid"])
@pytest.mark.parametrize("method", ["implicit_midpoint", "runge_kutta"])
def test_free_motion_follows_scipys_integrator(
    name: str, method: Any, request: pytest.FixtureRequest
) -> None:
    arm = request.getfixturevalue(name)
    mechanism = arm.mechanism
    n_axis, n = mechanism.n_axis, mechanism.n_coordinate
    law = _friction(n_axis, 0.02, 0.004, speed=2.0, offset=np.linspace(-0.4, 0.3, n_axis))
    start = rest_state(mechanism, arm.stiffness, _motor_angles(arm))
    torque = np.linspace(2.0, -1.5, n_axis)
    duration = 40
    run = _run(
        arm, _controller(n_axis), law, start, np.zeros((1, duration + 1, n_axis)),
        torque_feedforward=np.tile(torque, (1, duration + 1, 1)), method=method, step=_T / 16, keep_coordinates=True,
    )  # fmt: skip

    def slope(_: float, x: Any) -> Any:
        u = torque + start.holding_torque[0]
        change = acceleration_by_solving(mechanism, arm.stiffness, arm.damping, law, x[:n], x[n:], u)
        return np.concatenate((x[n:], change))

    x0 = np.concatenate((start.position[0], start.speed[0]))
    exact = solve_ivp(slope, (0, duration * _T), x0, method="DOP853", rtol=1e-9, atol=1e-10)
    moved = abs(exact.y[:n, -1] - x0[:n])
    error = abs(run.coordinates[0, -1] - exact.y[:n, -1])
    # midpoint: (w h)^2 / 12 a radian of the fastest mode that moves much, w about 600 rad/s: 1e-4 here and as much
    # again from the nonlinear terms; Runge-Kutta: (w h)^4 / 120, below the integrator's own tolerance
    assert (error <= (5e-4 if method == "implicit_midpoint" else 1e-6) * moved.max()).all()
    assert moved.max() > 1.0


def test_the_midpoint_rule_is_of_second_order(three_axis: Any) -> None:
    start = rest_state(three_axis.mechanism, three_axis.stiffness, _motor_angles(three_axis))
    t = _T * np.arange(300)
    reference = (6.0 * np.sin(2 * np.pi * 8 * t))[None, :, None] * np.array([1.0, -0.5, 0.7])
    controller = _controller(3, speed_gain=0.08, integral_gain=1.0, position_gain=3.0)
    friction = _friction(3, 0.1, 0.01, speed=1.0)

    def end(method: Any, step: float) -> Any:
        return _run(three_axis, controller, friction, start, reference, method=method, step=step).position

    exact = end("runge_kutta", _T / 32)
    coarse, fine = (abs(end("implicit_midpoint", _T / m) - exact).max() for m in (4, 8))
    assert 3.0 < coarse / fine < 5.0
    assert coarse < 1e-3 * abs(exact - exact[:, :1]).max()


def test_energy_is_kept_where_nothing_takes_it(three_axis: Any) -> None:
    # No damper, friction or gravity: kinetic and spring energy of a freely tumbling arm.
    arm = replace(three_axis.without_gravity(), damping=np.zeros(4))
    mechanism = arm.mechanism
    state = rest_state(mechanism, arm.stiffness, _motor_angles(arm))
    speed = np.zeros((1, mechanism.n_coordinate))
    speed[0, :3] = np.linalg.solve(mechanism.gear, [0.8, -1.5, 2.0])
    speed[0, [3, 5, 6]] = [0.8, -1.5, 2.0]

    def energy(s: SimulationState) -> float:
        model = second_order_model(mechanism, arm.stiffness, arm.damping, s.position[0])
        return (
            float(s.speed[0] @ model.mass @ s.speed[0] + s.position[0] @ model.stiffness @ s.position[0]) / 2
        )

    moving = replace(state, speed=speed)
    run = _run(arm, _controller(3), _friction(3), moving, np.zeros((1, 400, 3)))
    # second order: (w h)^2 / 12 = 1e-3 of the part that is exchanged
    assert energy(run.state) == pytest.approx(energy(moving), rel=1e-3)
    assert abs(run.state.position - state.position).max() > 10


def _identify(arm: Any, method: Any, step: float) -> tuple[Any, Any, Any]:
    """Response from simulated periodic data: one experiment a motor, small multisines in closed loop."""
    mechanism = arm.mechanism
    n_axis, n_sample, n_period = mechanism.n_axis, 1000, 12
    rng = np.random.default_rng(11)
    lines = np.arange(5, 81, 5)
    t = _T * np.arange(n_sample)
    tones = np.cos(2 * np.pi * lines[:, None] * t + rng.uniform(0, 2 * np.pi, (len(lines), 1))).sum(axis=0)
    push = 2e-6 * np.eye(n_axis)[:, None, :] * np.tile(tones, n_period)[None, :, None]
    angle = np.tile(_motor_angles(arm), (n_axis, 1))
    state = rest_state(mechanism, arm.stiffness, angle)
    # a low feedback holds the arm up and damps its slow modes; torque and position are both measured
    controller = _controller(n_axis, speed_gain=0.02, integral_gain=0.1, position_gain=3.0)
    friction = _friction(n_axis, 0.0, 0.03)
    run = _run(
        arm,
        controller,
        friction,
        state,
        np.zeros_like(push),
        torque_feedforward=push,
        method=method,
        step=step,
    )
    n_last = (n_period - 1) * n_sample
    position, torque = run.position - angle[:, None], run.torque - state.holding_torque[:, None]
    omega = 2 * np.pi * lines / (n_sample * _T)
    y = -(omega[:, None, None] ** 2) * np.fft.fft(position[:, n_last:], axis=1)[:, lines].transpose(1, 2, 0)
    u = np.fft.fft(torque[:, n_last:], axis=1)[:, lines].transpose(1, 2, 0)
    transient = (
        abs(position[:, n_last:] - position[:, n_last - n_sample : n_last]).max() / abs(position).max()
    )
    assert transient < 3e-6
    second = second_order_model(
        mechanism, arm.stiffness, arm.damping, state.position[0], np.full(n_axis, 0.03)
    )
    return omega, y @ np.linalg.inv(u), second


@pytest.mark.parametrize("name", ["three_axis", "half_rigid"])
def test_simulated_data_give_the_sampled_response_of_the_linear_model(
    name: str, request: pytest.FixtureRequest
) -> None:
    arm = request.getfixturevalue(name)
    omega, measured, model = _identify(arm, "runge_kutta", _T / 8)
    expected = response(model, omega, _T)
    size = abs(expected).max(axis=(1, 2), keepdims=True)
    # Left over: the transient (3e-6 of the motion, amplified where little moves), images that
    # the closed form neglects (1e-5), Runge-Kutta's (w h)^4 / 120, and terms of second order in the amplitude.
    assert (abs(measured - expected) / size).max() < 5e-5
    # the convention matters: the continuous response is 14 degrees ahead at 80 Hz, that is a quarter off
    assert abs(measured[-1] - response(model, omega)[-1]).max() > 0.2 * size[-1, 0, 0]


def test_the_default_step_gives_the_response_of_the_linear_model(three_axis: Any) -> None:
    step = _T / 4
    omega, measured, model = _identify(three_axis, "implicit_midpoint", step)
    expected = response(model, omega, _T)
    size = abs(expected).max(axis=(1, 2), keepdims=True)
    # Dampers act at the midpoint, with an error of (w h)^2 / 12; at 80 Hz this arm's are as strong as its springs. Were
    # the springs there too, the plant would be seen at this frequency instead:
    warped = 2 / step * np.tan(omega * step / 2)
    moved = abs(response(model, warped) - response(model, omega)).max(axis=(1, 2), keepdims=True) / size
    assert (abs(measured - expected) / size <= 0.9 * moved + 5e-5).all()


def test_a_robot_at_rest_is_not_kicked_by_what_its_sensors_show(three_axis: Any) -> None:
    # Angles measured in coarse counts are off by up to half a count; the first speed is none all the same.
    controller, friction, state, reference, _ = _closed_loop(three_axis, n_lane=1, n_sample=3)
    coarse = replace(controller, encoder_step=np.full(3, 0.1))
    run = _run(three_axis, coarse, friction, state, 0 * reference)
    np.testing.assert_array_equal(run.torque[0, 0], state.holding_torque[0])
    assert abs(run.position[0, 0] - state.position[0, :3]).max() > 0.01


def test_springs_beyond_what_the_step_resolves_go_back_to_the_midpoint_rule(three_axis: Any) -> None:
    step = 2.5e-4
    weak = spring_weights(three_axis.mechanism, three_axis.stiffness, step)
    np.testing.assert_allclose(weak, step**2 / 12)
    stiff = spring_weights(three_axis.mechanism, 1e6 * three_axis.stiffness, step)
    np.testing.assert_allclose(stiff, step**2 / 4, rtol=1e-2)
    np.testing.assert_array_equal(
        spring_weights(three_axis.mechanism, three_axis.stiffness, 0.0), np.zeros(4)
    )


def test_friction_under_a_slow_sine_has_its_equivalent_gain(two_mass: Any) -> None:
    # A small fast torque on top of a slow large motion meets the motor with E[df/dv] as its damping, as long as one
    # reversal takes little of its speed: 2 coulomb / (amplitude w_slow rotor) = 10 % here, the error of the gain.
    arm = replace(two_mass, stiffness=np.array([1e-9]))
    n_sample, amplitude, coulomb, smooth, rotor = 4000, 8.0, 0.05, 1.0, 2e-3
    omega_slow, omega = 2 * np.pi * 40 / (n_sample * _T), 2 * np.pi * 101 / (n_sample * _T)
    t = _T * np.arange(3 * n_sample)
    slow = amplitude * np.sin(omega_slow * t)
    drive = rotor * omega_slow * amplitude * np.cos(omega_slow * t) + coulomb * np.tanh(slow / smooth)
    small = 1e-3 * np.cos(omega * t)
    two = rest_state(arm.mechanism, arm.stiffness, np.zeros((2, 1)))
    feedforward = np.stack((drive + small, drive - small))[..., None]
    run = _run(arm, _controller(1), _friction(1, coulomb, speed=smooth), two, np.zeros_like(feedforward),
               torque_feedforward=feedforward)  # fmt: skip
    moved = run.position[0, -n_sample:, 0] - run.position[1, -n_sample:, 0]
    speed = 1j * omega * np.fft.fft(moved)[101] / np.fft.fft(2 * small[:n_sample])[101]
    gain = (1 / (speed * np.exp(0.5j * omega * _T))).real
    assert gain == pytest.approx(float(equivalent_damping(0.0, amplitude, coulomb, 0.0, smooth)), rel=0.1)


def _closed_loop(arm: Any, n_lane: int = 3, n_sample: int = 120) -> tuple[Any, ...]:
    rng = np.random.default_rng(5)
    state = rest_state(arm.mechanism, arm.stiffness, _motor_angles(arm, n_lane))
    t = _T * np.arange(n_sample)
    reference = rng.normal(size=(n_lane, 1, 3)) * np.sin(2 * np.pi * 10 * t)[None, :, None]
    controller = _controller(3, speed_gain=0.05, integral_gain=1.0, position_gain=3.0)
    return controller, _friction(3, 0.1, 0.01), state, reference, rng


def test_a_run_in_two_parts_is_the_run_in_one(three_axis: Any) -> None:
    controller, friction, state, reference, rng = _closed_loop(three_axis)
    noise = 1e-5 * rng.normal(size=reference.shape)
    whole = _run(three_axis, controller, friction, state, reference, position_noise=noise)
    first = _run(three_axis, controller, friction, state, reference[:, :50], position_noise=noise[:, :50])
    rest = _run(
        three_axis, controller, friction, first.state, reference[:, 50:], position_noise=noise[:, 50:]
    )
    np.testing.assert_array_equal(np.concatenate((first.position, rest.position), axis=1), whole.position)
    np.testing.assert_array_equal(np.concatenate((first.torque, rest.torque), axis=1), whole.torque)
    for field in fields(SimulationState):
        np.testing.assert_array_equal(getattr(rest.state, field.name), getattr(whole.state, field.name))


def test_lanes_do_not_depend_on_each_other_or_on_threads(three_axis: Any) -> None:
    controller, friction, state, reference, _ = _closed_loop(
        three_axis, n_lane=19
    )  # two blocks of lanes and a part
    together = _run(three_axis, controller, friction, state, reference)
    threaded = _run(three_axis, controller, friction, state, reference, n_thread=2)
    np.testing.assert_array_equal(together.position, threaded.position)
    for some in (
        slice(1, 2),
        slice(17, 19),
        slice(5, 14),
    ):  # alone, in a pair (both one by one), among others
        part = SimulationState(**{f.name: getattr(state, f.name)[some] for f in fields(state)})
        alone = _run(three_axis, controller, friction, part, reference[some])
        np.testing.assert_array_equal(together.torque[some], alone.torque)
        np.testing.assert_array_equal(together.state.speed[some], alone.state.speed)


def test_inputs_are_left_alone(three_axis: Any) -> None:
    controller, friction, state, reference, _ = _closed_loop(three_axis)
    before = {f.name: getattr(state, f.name).copy() for f in fields(state)}
    _run(three_axis, controller, friction, state, reference)
    for name, value in before.items():
        np.testing.assert_array_equal(getattr(state, name), value)


def test_the_controller_does_what_its_formula_says(three_axis: Any) -> None:
    controller, friction, state, reference, rng = _closed_loop(three_axis, n_lane=1)
    feedforward, noise = rng.normal(size=(2, *reference.shape))
    torque_noise = rng.normal(size=reference.shape)
    run = _run(
        three_axis, controller, friction, state, reference, torque_feedforward=0.1 * feedforward,
        position_noise=1e-5 * noise, torque_noise=torque_noise, keep_coordinates=True,
    )  # fmt: skip
    measured = run.coordinates[0, :, :3] + 1e-5 * noise[0]
    np.testing.assert_array_equal(run.position[0], measured)
    wanted = measured[0] + _T * np.concatenate((np.zeros((1, 3)), np.cumsum(reference[0], axis=0)[:-1]))
    rate = np.diff(measured, axis=0, prepend=measured[:1]) / _T  # the first sample has no speed yet
    error = reference[0] + 3.0 * (wanted - measured) - rate
    torque = (
        0.05 * error + np.cumsum(1.0 * _T * error, axis=0) + state.holding_torque[0] + 0.1 * feedforward[0]
    )
    np.testing.assert_allclose(run.torque[0], torque + torque_noise[0], rtol=0, atol=1e-9)
    assert not run.saturated.any()


def test_a_position_reference_replaces_the_integral_of_the_speed(three_axis: Any) -> None:
    controller, friction, state, reference, _ = _closed_loop(three_axis)
    integral = _T * np.concatenate((np.zeros((3, 1, 3)), np.cumsum(reference, axis=1)[:, :-1]), axis=1)
    by_speed = _run(three_axis, controller, friction, state, reference)
    wanted = by_speed.position[:, :1] + integral
    by_position = _run(three_axis, controller, friction, state, reference, position_reference=wanted)
    np.testing.assert_allclose(by_position.position, by_speed.position, rtol=0, atol=1e-9)


def test_measured_angles_are_whole_encoder_counts(three_axis: Any) -> None:
    controller, friction, state, reference, _ = _closed_loop(three_axis)
    count = 2 * np.pi / 4096
    stepped = replace(controller, encoder_step=np.full(3, count))
    run = _run(three_axis, stepped, friction, state, reference, keep_coordinates=True)
    counts = run.position / count
    np.testing.assert_allclose(counts, np.round(counts), rtol=0, atol=1e-9)
    assert abs(run.position - run.coordinates[..., :3]).max() <= count / 2 * (1 + 1e-9)


def test_torque_stops_at_its_limit_and_is_counted(three_axis: Any) -> None:
    controller, friction, state, reference, _ = _closed_loop(three_axis, n_lane=1)
    weak = replace(controller, torque_limit=np.array([1e3, 0.5 * abs(state.holding_torque[0, 1]), 1e3]))
    run = _run(three_axis, weak, friction, state, reference)
    assert abs(run.torque[..., 1]).max() == weak.torque_limit[1]
    assert run.saturated[0, 1] > 0.3
    assert run.saturated[0, 0] == 0


def test_a_rigid_carriage_follows_the_double_integrator(carriage: Any) -> None:
    state = rest_state(carriage.mechanism, carriage.stiffness, np.zeros((1, 1)))
    force = np.random.default_rng(0).normal(size=(1, 200, 1)) * 50
    run = _run(carriage, _controller(1), _friction(1), state, np.zeros_like(force), torque_feedforward=force)
    speed = np.concatenate(([0.0], np.cumsum(force[0, :, 0] * _T / 95.0)))[:-1]
    position = np.concatenate(([0.0], np.cumsum(speed * _T + force[0, :, 0] * _T**2 / 2 / 95.0)))[:-1]
    np.testing.assert_allclose(run.position[0, :, 0], position, rtol=0, atol=1e-12)


def test_a_lane_that_explodes_is_stopped_and_named(three_axis: Any) -> None:
    controller, friction, state, reference, _ = _closed_loop(three_axis, n_sample=2000)
    wild = replace(controller, speed_gain=np.full(3, 50.0), torque_limit=np.full(3, 1e12))
    with pytest.raises(NotTrustworthy, match=r"lane 0 left all bounds at \d\.\d+ s"):
        _run(three_axis, wild, friction, state, reference)
    lost = reference.copy()
    lost[2, 7, 0] = np.nan
    with pytest.raises(SimulationDiverged, match=r"lane 2 left all bounds at 0\.007 s") as caught:
        _run(three_axis, controller, friction, state, lost)
    found = caught.value.partial
    whole = _run(three_axis, controller, friction, state, reference)
    np.testing.assert_array_equal(found.position[:2], whole.position[:2])  # the others ran to the end
    np.testing.assert_array_equal(found.position[2, :8], whole.position[2, :8])
    assert np.isnan(found.position[2, 8:]).all()


def test_sizes_and_numbers_that_do_not_fit_are_refused(three_axis: Any) -> None:
    controller, friction, state, reference, _ = _closed_loop(three_axis)
    cases: list[tuple[dict[str, Any], str]] = [
        ({"step": 3e-4}, "not a whole number of steps"),
        ({"method": "euler"}, "no method 'euler'"),
        ({"position_noise": np.zeros(3)}, "position_noise has shape"),
    ]
    for more, told in cases:
        with pytest.raises(ConfigurationError, match=told):
            _run(three_axis, controller, friction, state, reference, **more)
    with pytest.raises(ConfigurationError, match="friction speed 0"):
        _run(three_axis, controller, _friction(3, 1.0, speed=0.0), state, reference)
    with pytest.raises(ConfigurationError, match="torque_limit needs 3"):
        _run(three_axis, replace(controller, torque_limit=np.ones(2)), friction, state, reference)
    with pytest.raises(ConfigurationError, match=r"speed reference of shape \(3, 120, 2\)"):
        _run(three_axis, controller, friction, state, reference[..., :2])


def test_every_robot_runs_through_one_compiled_kernel(
    three_axis: Any, half_rigid: Any, carriage: Any
) -> None:
    for arm in (three_axis, half_rigid, carriage):
        n_axis = arm.mechanism.n_axis
        state = rest_state(arm.mechanism, arm.stiffness, _motor_angles(arm))
        _run(arm, _controller(n_axis), _friction(n_axis), state, np.zeros((1, 2, n_axis)))
    kernel: Any = run_blocks
    assert len(kernel.signatures) <= 2  # one experiment, and all lanes
