"""The prediction-error fit: its likelihood, derivatives and gain against others, and what it finds of a robot."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
import scipy

from robid_core import (
    Channel,
    ConfigurationError,
    Context,
    DataRejected,
    DenseRun,
    Fit,
    FloatArray,
    Record,
    Robot,
)
from robid_core.stage import map_in_process
from robid_fit.innovations import free_outputs, log_likelihood_cost, predict
from robid_fit.kalman_gain import gain_slopes, steady_kalman_gain
from robid_fit.sampled_model import SampledModel
from robid_fit.state_space import StateSpaceFit

T = 1e-3
NOISE = np.array([[0.01], [1e-3], [2e-5]])
TRUE = {
    "gear_stiffness.axis_1": 1.0e5,
    "gear_damping.axis_1": 75.0,
    "friction.axis_1.viscous": 3.0e-3,
    "friction.axis_1.coulomb": 0.0,
}
FREE = ("gear_stiffness.*", "gear_damping.*", "friction.*.viscous")


def context() -> Context:
    return Context(np.random.default_rng(1), map_in_process, lambda *a, **k: None, logging.getLogger("test"))


def plant(coulomb: float = 0.0) -> Robot:
    return Robot.load("one_axis").with_parameters(TRUE | {"friction.axis_1.coulomb": coulomb})


def record_of(
    robot: Robot, seed: int | None, n_sample: int = 400, periods: int = 1, slow: float = 0.0
) -> Record:
    """Closed loop under random-phase waves of 5 to 80 Hz, after 0.3 s of settling."""
    generator = np.random.default_rng(7)
    settle = 300
    time = T * np.arange(settle + periods * n_sample)
    line = np.arange(round(5 * n_sample * T), round(80 * n_sample * T), 2)
    phase = generator.uniform(0, 2 * np.pi, len(line))
    waves = np.cos(2 * np.pi * np.outer(time, line) / (n_sample * T) + phase).sum(axis=1)
    speed = 6 * np.sqrt(2 / len(line)) * waves + slow * np.sin(2 * np.pi * time / (n_sample * T))
    made = robot.simulate(speed[None, :, None], np.zeros((1, 1)), seed=seed)
    shape = (1, 1, 1, periods, n_sample, 1)
    channels = {
        "motor_position": Channel("motor", "rad", made.position[:, settle:].reshape(shape)),
        "motor_torque": Channel("motor", "N m", made.torque[:, settle:].reshape(shape)),
    }
    run = DenseRun(T, channels, T * np.arange(n_sample), np.ones(shape[:-1], dtype=bool))
    return Record(("axis_1",), "simulated", "zero_order_hold", (run,), np.zeros((1, 1)))


def fitted(record: Record, start: Robot) -> Fit:
    return StateSpaceFit(free=FREE).run(record, start, context())


def sampled(robot: Robot, noise: FloatArray = NOISE) -> SampledModel:
    return SampledModel.of(robot.second_order(np.array([[0.3]])), 0, T, noise)


def test_the_gain_is_that_of_scipys_riccati_equation() -> None:
    generator = np.random.default_rng(3)
    a = generator.standard_normal((5, 5))
    a *= 1.02 / np.abs(np.linalg.eigvals(a)).max()  # one mode grows, and the outputs show it
    c, root, r = generator.standard_normal((2, 5)), generator.standard_normal((5, 3)), np.array([0.3, 2.0])
    found = steady_kalman_gain(a, c, root @ root.T, r)
    p = scipy.linalg.solve_discrete_are(a.T, c.T, root @ root.T, np.diag(r))
    np.testing.assert_allclose(found.state, p, rtol=1e-9, atol=1e-9 * p.max())
    s = c @ p @ c.T + np.diag(r)
    np.testing.assert_allclose(found.gain, a @ p @ c.T @ np.linalg.inv(s), rtol=1e-8, atol=1e-10)


def test_slopes_of_the_gain_are_differences_of_gains() -> None:
    generator = np.random.default_rng(4)
    a, c = 0.4 * generator.standard_normal((4, 4)), generator.standard_normal((2, 4))
    q, r = np.diag([1.0, 0.2, 0.0, 0.5]), np.array([0.3, 2.0])
    da, dq, dr = generator.standard_normal((4, 4)), np.diag([0.3, 0.0, 0.1, -0.2]), np.array([0.1, -0.4])
    in_gain, in_innovation = gain_slopes(a, c, steady_kalman_gain(a, c, q, r), da[None], dq[None], dr[None])
    step = 1e-5
    ends = [steady_kalman_gain(a + way * da, c, q + way * dq, r + way * dr) for way in (step, -step)]
    for slope, name in ((in_gain[0], "gain"), (in_innovation[0], "innovation")):
        difference = (getattr(ends[0], name) - getattr(ends[1], name)) / (2 * step)
        np.testing.assert_allclose(
            slope, difference, rtol=1e-6, atol=1e-7
        )  # curvature times step^2, rounding


def test_outputs_that_do_not_show_what_grows_are_refused() -> None:
    with pytest.raises(DataRejected, match="no steady Kalman gain"):
        steady_kalman_gain(np.diag([1.1, 0.5]), np.array([[0.0, 1.0]]), np.eye(2), np.ones(1))


def test_the_sampled_model_has_the_response_of_the_robot() -> None:
    robot, f = plant(), np.array([5.0, 20.0, 40.0, 80.0])
    z = np.exp(2j * np.pi * f * T)
    model = sampled(robot).predictor
    n = len(model.transition)
    angle = [
        (model.output @ np.linalg.solve(one * np.eye(n) - model.transition, model.input))[0, 0] for one in z
    ]
    acceleration = -((2 * np.pi * f) ** 2) * np.array(angle)
    # `response` leaves out images of damping and stiffness: 1e-5 at 80 Hz (its docstring).
    np.testing.assert_allclose(acceleration, robot.response(np.array([[0.3]]), f)[0, :, 0, 0], rtol=2e-5)


def test_the_likelihood_is_that_of_the_dense_gaussian() -> None:
    """Angles of all samples as one Gaussian vector, whose mean depends on the initial state that is most likely."""
    n_sample, generator = 30, np.random.default_rng(5)
    # Noise of the torque that is large and an angle's noise that is coarse: the dense matrix keeps its digits.
    model = sampled(plant(), np.array([[3.0], [20.0], [1e-4]]))
    form = model.predictor
    u, y = generator.standard_normal((n_sample, 1, 1)), 3e-4 * generator.standard_normal((n_sample, 1, 1))
    process = form.input @ form.input.T * 9.0
    process[-1, -1] += 400.0 * T
    state = steady_kalman_gain(form.transition, form.output, process, np.array([1e-8])).state
    n = len(state)
    shown, driven, mean = np.zeros((n_sample, n)), np.zeros((n_sample, n_sample, n)), np.zeros(n_sample)
    power, x = np.eye(n), np.zeros(n)
    for t in range(n_sample):
        shown[t], mean[t] = form.output @ power, form.output[0] @ x
        x, power = form.transition @ x + form.input[:, 0] * u[t, 0, 0], form.transition @ power
        for s in range(t):
            driven[t, s] = form.output[0] @ np.linalg.matrix_power(form.transition, t - 1 - s)
    covariance = shown @ state @ shown.T + np.einsum("tsi,ij,rsj->tr", driven, process, driven)
    covariance += 1e-8 * np.eye(n_sample)
    white = np.linalg.inv(np.linalg.cholesky(covariance))
    left = white @ (y[:, 0, 0] - mean)
    explained = np.linalg.lstsq(white @ shown, left, rcond=1e-12)[0]
    left = left - white @ shown @ explained
    expected = 0.5 * left @ left + 0.5 * np.linalg.slogdet(covariance)[1]
    found = predict(form, u, y)
    assert log_likelihood_cost(form, found) == pytest.approx(expected, rel=1e-7)
    assert free_outputs(form, 3).shape == (3, n, 1)


def test_the_gradient_is_the_difference_of_the_cost_and_information_its_variance() -> None:
    start = Robot.load("one_axis").with_parameters({"gear_stiffness.axis_1": 9.9e4})
    problem = StateSpaceFit(free=("gear_*", "friction.*.viscous", "mass.*", "rotor_inertia.*")).problem(
        record_of(plant(), seed=1, n_sample=300), start
    )
    point = problem.start.copy()
    point[-3:] = np.log(np.array([0.01, 1e-3, 2e-5]) / problem.noise_start[:, 0])
    _, gradient, matrix = problem.equations(point)
    scale = np.sqrt(np.diag(matrix))
    for i in range(len(point)):
        step = np.zeros_like(point)
        step[i] = 1e-2 / scale[i]
        difference = (problem.cost(point + step) - problem.cost(point - step)) / (2 * step[i])
        # Half a step of third derivatives, and 1e-8 of the matrices' differences.
        assert gradient[i] == pytest.approx(difference, abs=1e-4 * np.abs(gradient / scale).max() * scale[i])


def test_stated_errors_cover_a_motor_and_an_arm() -> None:
    """30 records in closed loop with noise of torque and angle; the first fit starts far away."""
    true, z, noise = plant(), [], []
    far = true.with_parameters(
        {"gear_stiffness.axis_1": 1.3e5, "gear_damping.axis_1": 50.0, "friction.axis_1.viscous": 5e-3}
    )
    for seed in range(30):
        fit = fitted(record_of(true, seed), true if seed else far)
        assert fit.converged
        table = fit.parameters
        truth = np.array([TRUE[name] for name in table.names[:3]])
        z.append((table.estimate[:3] - truth) / table.standard_error[:3])
        noise.append(table.estimate[[3, 5]] / NOISE[[0, 2], 0])
    power = (np.array(z) ** 2).mean(axis=0)
    # A mean of 30 squares scatters by sqrt(2 / 30) = 0.26: three of them.
    assert (np.abs(power - 1) < 0.78).all()
    assert (np.abs(z) < 1.96).mean() > 0.95 - 3 * np.sqrt(0.05 * 0.95 / 90)
    # Noise comes out low in so short a record: its likelihood does not count the five initial states as estimated.
    np.testing.assert_allclose(np.mean(noise, axis=0), 1.0, atol=0.15)


def test_innovations_are_white_where_the_model_is_linear_and_tell_friction_where_not() -> None:
    linear = fitted(record_of(plant(), seed=3), plant())
    assert not linear.stated_doubts
    rubbing = fitted(record_of(plant(coulomb=0.4), seed=3), plant())
    assert [doubt.kind for doubt in rubbing.stated_doubts] == ["innovations"]
    # The bias that a baseline has: E[df/dv] = 0.4 N m sqrt(2 / pi) / (6 rad/s) goes to the viscosity, ten times what
    # is there; the errors of the springs grow from a thousandth to percents.
    table, true = rubbing.parameters, linear.parameters
    assert table.estimate[2] > 5 * TRUE["friction.axis_1.viscous"]
    assert (
        abs(table.estimate[0] / TRUE["gear_stiffness.axis_1"] - 1)
        > 20 * true.standard_error[0] / TRUE["gear_stiffness.axis_1"]
    )


def test_a_constant_torque_does_no_harm() -> None:
    """Gravity on a slow way and a constant offset are what the walking torque is for."""
    record = record_of(plant(), seed=5)
    run = record.run
    torque = run.channel("motor_torque")
    drift = 0.3 + 0.2 * np.sin(2 * np.pi * np.arange(400) / 400)[:, None]
    offset = run.replace(
        channels=run.channels | {"motor_torque": replace(torque, values=torque.values + drift)}
    )
    fit = fitted(record.replace(runs=(offset,)), plant())
    assert fit.parameters.value("torque_walk.axis_1") > 10 * fit.parameters.value("torque_noise.axis_1") * T
    error = fit.parameters.value("gear_stiffness.axis_1") / TRUE["gear_stiffness.axis_1"] - 1
    stated = fit.parameters.standard_error[0] / fit.parameters.estimate[0]
    assert abs(error) < 4 * stated


def test_what_a_linear_model_cannot_have_is_refused() -> None:
    robot = plant()
    record = record_of(robot, seed=1, n_sample=100)
    with pytest.raises(ConfigurationError, match="viscous friction only"):
        StateSpaceFit(free=("friction.*.coulomb",)).run(record, robot, context())
    late = robot.with_effect("late", "sensing.delay", on="axis_1", values={})
    with pytest.raises(ConfigurationError, match="no states for"):
        StateSpaceFit(free=FREE).run(record, late, context())
    valid = record.run.valid.copy()
    valid[0, 0, 0, 0, 40] = False
    holed = record.replace(runs=(record.run.replace(valid=valid),))
    with pytest.raises(DataRejected, match=r"missing in configuration 1.*0\.0400 s"):
        StateSpaceFit(free=FREE).run(holed, robot, context())
    with pytest.raises(DataRejected, match="none is left"):
        StateSpaceFit(free=FREE, discard=1).run(record, robot, context())
