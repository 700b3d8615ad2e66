"""The grey-box fit on responses of known robots: exact without noise, honest with it, plain about the unseen."""

import logging

import numpy as np
import pytest

from robid_core import Context, Frf, Robot
from robid_core.stage import map_in_process
from robid_fit.log_response import LogResponseFit
from robid_fit.problem import LogResponseProblem, Unknowns, log_covariance

FREQUENCY = np.geomspace(4, 80, 40)


def context(seed: int = 0) -> Context:
    return Context(
        generator=np.random.Generator(np.random.PCG64(seed)),
        map=map_in_process,
        progress=lambda done, total, note="": None,
        log=logging.getLogger("test"),
    )


def measured(true: Robot, angle: np.ndarray, relative_noise: float, seed: int = 0) -> Frf:
    """Response of a linear robot with noise of known covariance: relative to each output's largest entry."""
    response = true.response(angle, FREQUENCY)
    n_config, n_freq, n, _ = response.shape
    rng = np.random.default_rng(seed)
    size = relative_noise * np.abs(response).max(axis=3)
    noise = rng.standard_normal((2, *response.shape)) * np.sqrt(0.5)
    identity = np.broadcast_to(np.eye(n, dtype=complex), (n_config, n_freq, n, n))
    return Frf(
        axis_names=true.axis_names, estimator="synthetic", pooling="known", sample_time_s=true.sample_time_s,
        torque_hold="zero_order_hold", angle=angle, frequency_hz=FREQUENCY,
        response=response + (noise[0] + 1j * noise[1]) * size[..., None],
        input_gram_inverse=identity, output_covariance=(size**2)[..., None] * identity,
        degrees_of_freedom=np.full((n_config, n_freq), 1e6),
    )  # fmt: skip


@pytest.fixture(scope="module")
def six() -> tuple[Robot, Robot, np.ndarray]:
    nominal, true = Robot.load("six_axis"), Robot.load("six_axis_true")
    # Friction is the nominal one, so that a linear robot differs by springs and dampers only.
    friction = {n: v for n, v in nominal.parameters().items() if n.startswith("friction")}
    angle = np.random.default_rng(1).uniform(-1, 1, (3, 6))
    return nominal, true.with_parameters(friction), angle


def test_all_stiffnesses_of_a_linear_robot_come_back_without_noise(
    six: tuple[Robot, Robot, np.ndarray],
) -> None:
    nominal, true, angle = six
    fit = LogResponseFit(starts=2, model_error=1e-3).run(measured(true, angle, 1e-7), nominal, context())
    truth = true.parameters()
    assert fit.model is not None
    assert Robot.of_model(fit.model) == nominal.with_parameters(fit.parameters.as_mapping())
    errors = fit.model.standard_errors()
    np.testing.assert_allclose(list(errors.values()), fit.parameters.standard_error[: len(errors)], rtol=1e-9)
    for name, estimate in fit.parameters.as_mapping().items():
        if "stiffness" in name:
            # Stops when 1e-9 of the cost is left to gain; what remains is far below the noise of any robot.
            assert estimate == pytest.approx(truth[name], rel=1e-4), name
    assert fit.converged
    assert fit.response is not None
    np.testing.assert_allclose(fit.response.modelled, fit.response.measured, rtol=1e-2)


def test_the_gradient_is_the_central_difference_of_the_cost() -> None:
    """One axis: only the sag's own derivative is left out, here none, for the arm hangs in its equilibrium."""
    nominal = Robot.load("one_axis")
    hanging = Robot(nominal.description.model_copy(update={"gravity": (0.0, 0.0, 0.0)}))
    true = hanging.with_parameters({"gear_stiffness.axis_1": 6.0e4})
    frf = measured(true, np.zeros((2, 1)), 1e-2)
    weights = np.full((2, len(FREQUENCY), 1, 1), 1e-4, dtype=complex)
    problem = LogResponseProblem(hanging, frf, weights, np.ones((2, len(FREQUENCY)), dtype=bool))
    point = np.log(problem.unknowns.start)
    _, gradient, _ = problem.equations(point)
    for i in range(len(point)):
        step = np.zeros_like(point)
        step[i] = 1e-5
        difference = (problem.cost(point + step) - problem.cost(point - step)) / 2e-5
        assert gradient[i] == pytest.approx(difference, rel=1e-5, abs=1e-6 * np.abs(gradient).max())


def test_stated_errors_cover_the_scatter_over_noise() -> None:
    """One axis, model right, noise known: 60 fits, squared standardised errors have mean 1 (5 sampling errors)."""
    nominal = Robot.load("one_axis")
    true = Robot.load("one_axis_true").with_parameters(
        {n: v for n, v in nominal.parameters().items() if n.startswith("friction")}
    )
    angle, truth = np.array([[0.3], [1.0], [-0.6]]), true.parameters()["gear_stiffness.axis_1"]
    z = []
    for seed in range(60):
        fit = LogResponseFit(starts=1).run(measured(true, angle, 0.03, seed), nominal, context())
        index = fit.parameters.names.index("gear_stiffness.axis_1")
        z.append((fit.parameters.estimate[index] - truth) / fit.parameters.standard_error[index])
    # The jackknife over three configurations makes intervals conservative: between 0.3 and 1 + 5 sqrt(2/60).
    assert 0.3 < np.mean(np.square(z)) < 1 + 5 * np.sqrt(2 / 60)
    assert abs(np.mean(z)) < 5 / np.sqrt(60)


def test_a_spring_that_nothing_sees_gets_no_number(six: tuple[Robot, Robot, np.ndarray]) -> None:
    """A bearing a million times stiffer than the rest does not bend: its standard error is not stated."""
    nominal, true, angle = six
    rigid = {"bearing_stiffness.axis_2_z": 1e12, "bearing_damping.axis_2_z": 1e5}
    fit = LogResponseFit(starts=1).run(
        measured(true.with_parameters(rigid), angle, 1e-3), nominal.with_parameters(rigid), context()
    )
    index = fit.parameters.names.index("bearing_stiffness.axis_2_z")
    assert np.isnan(fit.parameters.standard_error[index])
    assert "bearing_stiffness.axis_2_z" in fit.status
    assert [doubt.kind for doubt in fit.doubts] == ["bound"]
    assert fit.doubts[0].sentence.endswith("identified: bearing_stiffness.axis_2_z")


def test_equal_seeds_give_equal_bytes(tmp_path) -> None:
    nominal, true = Robot.load("one_axis"), Robot.load("one_axis_true")
    frf = measured(true, np.array([[0.3], [1.0]]), 0.02)
    for name in ("one", "two"):
        LogResponseFit(starts=4).run(frf, nominal, context(3)).write(tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_the_model_error_is_found_from_the_data() -> None:
    """A rough error of 3 % on a response with almost no noise: the estimated level is near it, and doubted."""
    nominal = Robot.load("one_axis")
    frf = measured(nominal, np.array([[0.3], [1.0], [-0.5]]), 1e-5)
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((2, *frf.response.shape)) * np.sqrt(0.5)
    disturbed = frf.replace(response=frf.response * np.exp(0.03 * (noise[0] + 1j * noise[1])))
    fit = LogResponseFit(starts=1, coupling_share=0.0).run(disturbed, nominal, context())
    level = float(fit.status.split("model error ")[1].split(" %")[0])
    assert level == pytest.approx(3.0, rel=0.25)
    assert fit.misfit == pytest.approx(1.0, abs=0.1)
    assert fit.model_error == pytest.approx(level / 100, rel=0.02)
    assert [doubt.kind for doubt in fit.doubts] == ["model error"]


def test_a_misfit_that_was_tuned_checks_nothing_and_one_against_a_stated_error_does() -> None:
    """A lag of half a sample that the model lacks: the model error grows, or, where it is told, the misfit."""
    nominal = Robot.load("one_axis")
    frf = measured(nominal, np.array([[0.3], [1.0], [-0.5]]), 1e-5)
    lag = np.exp(-0.5e-3j * 2 * np.pi * FREQUENCY)[:, None, None]
    tuned, told = (
        LogResponseFit(starts=1, model_error=level).run(
            frf.replace(response=frf.response * lag), nominal, context()
        )
        for level in (None, 0.01)
    )
    assert tuned.misfit_against == ""
    assert "model error" in [doubt.kind for doubt in tuned.doubts]
    assert "misfit" not in [doubt.kind for doubt in tuned.doubts]
    assert told.misfit_against == "covariance and a model error of 1 %"
    assert "misfit" in [doubt.kind for doubt in told.doubts]


def test_log_covariance_is_first_order_error_propagation() -> None:
    """Scatter of log G over small complex noise of known covariance, 20 000 draws: 5 sampling errors."""
    rng = np.random.default_rng(3)
    g = np.array([[[1.0 + 1j, -0.3], [0.2j, 2.0]]])
    a = (rng.standard_normal((4, 4)) + 1j * rng.standard_normal((4, 4))) * 1e-3
    covariance = (a @ a.conj().T)[None]
    draws = (rng.standard_normal((20000, 4)) + 1j * rng.standard_normal((20000, 4))) / np.sqrt(2) @ a.T
    vec = np.swapaxes(g, 1, 2).reshape(1, 4)
    logs = np.log1p(draws / vec)
    scatter = logs.T @ logs.conj() / len(logs)
    expected = log_covariance(g, covariance, 0.0, 0.0)[0]
    size = np.sqrt(np.outer(np.diag(expected).real, np.diag(expected).real))
    assert (np.abs(scatter - expected) / size).max() < 5 / np.sqrt(20000) * 2


def test_the_unknowns_are_springs_dampers_and_one_friction_factor_per_axis() -> None:
    unknowns = Unknowns.of_robot(Robot.load("six_axis"))
    assert unknowns.groups == ("stiffness",) * 12 + ("damping",) * 12 + ("nuisance",) * 6
    assert len(set(unknowns.names)) == 30
