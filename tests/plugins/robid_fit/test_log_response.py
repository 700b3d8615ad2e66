"""The grey-box fit on responses of known robots: exact without noise, honest with it, plain about the unseen."""

import logging
from pathlib import Path

import numpy as np
import pytest

from robid_core import ConfigurationError, Context, FreeParameters, Frf, Robot, chosen_names
from robid_core.stage import map_in_process
from robid_fit.log_response import LogResponseFit
from robid_fit.problem import LogResponseProblem
from robid_fit.response_weights import inverse_excess, log_covariance

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
    """Springs, dampers, bodies and friction of six axes without gravity, where the sag's own derivative is none."""
    nominal = Robot.load("six_axis")
    hanging = Robot(nominal.description.model_copy(update={"gravity": (0.0, 0.0, 0.0)}))
    frf = measured(hanging, np.random.default_rng(5).uniform(-1, 1, (2, 6)), 1e-2)
    frf = frf.select("n_freq", slice(None, None, 8))
    patterns = ["gear_*", "bearing_stiffness.*", "mass.axis_3", "inertia.axis_3.*", "rotor_inertia.axis_2"]
    free = FreeParameters.of_robot(hanging, chosen_names(list(hanging.layout), patterns))
    n_freq = len(frf.frequency_hz)
    weights = np.broadcast_to(1e-4 * np.eye(36, dtype=complex), (2, n_freq, 36, 36))
    problem = LogResponseProblem(free, frf, weights, np.ones((2, n_freq), dtype=bool))
    point = problem.start + np.random.default_rng(6).normal(0, 0.05, len(problem.start)) * problem.prior
    _, gradient, matrix = problem.equations(point)
    scale = np.sqrt(np.diag(matrix))  # a step that moves the residual by so much
    for i in range(len(point)):
        step = np.zeros_like(point)
        step[i] = 1e-2 / scale[i]
        difference = (problem.cost(point + step) - problem.cost(point - step)) / (2 * step[i])
        # Differences of models (bodies) err by half a step of 1e-4 times the curvature at resonances.
        assert gradient[i] == pytest.approx(difference, abs=3e-3 * np.abs(gradient / scale).max() * scale[i])


def test_between_the_lines_the_model_is_that_of_more_lines() -> None:
    """At the lines the same numbers; between them those of the problem that has lines there.

    The two grids put the knee of friction's gain, the median of their lines, up to 5 % apart: 2 % of the response.
    """
    robot = Robot.load("six_axis")
    fine = measured(robot, np.array([[0.3, -0.4, 0.5, 0.2, 0.6, -0.1]]), 1e-2)
    fine = fine.select("n_freq", slice(0, 2 * (len(fine.frequency_hz) // 2) - 1))
    coarse = fine.select("n_freq", slice(None, None, 2))
    free = FreeParameters.of_robot(robot, ["gear_stiffness.axis_2"])
    problems = [
        LogResponseProblem(
            free, frf, np.broadcast_to(np.eye(36) + 0j, (1, n, 36, 36)), np.ones((1, n), dtype=bool)
        )
        for frf in (coarse, fine)
        for n in (len(frf.frequency_hz),)
    ]
    point = problems[0].start + 0.3 * problems[0].prior
    np.testing.assert_allclose(
        problems[0].between_lines(point, coarse.frequency_hz), problems[0].model(point), rtol=1e-9
    )
    assert np.median(coarse.frequency_hz) == pytest.approx(np.median(fine.frequency_hz), rel=0.05)
    found, wanted = problems[0].between_lines(point, fine.frequency_hz), problems[1].model(point)
    assert np.abs(found / wanted - 1).max() < 0.02


@pytest.mark.parametrize(("repeats", "least"), [(15, 0.23), pytest.param(60, 0.3, marks=pytest.mark.full)])
def test_stated_errors_cover_the_scatter_over_noise(repeats: int, least: float) -> None:
    """One axis, model right, noise known: squared standardised errors have mean 1 (5 sampling errors)."""
    nominal = Robot.load("one_axis")
    true = Robot.load("one_axis_true").with_parameters(
        {n: v for n, v in nominal.parameters().items() if n.startswith("friction")}
    )
    angle, truth = np.array([[0.3], [1.0], [-0.6]]), true.parameters()["gear_stiffness.axis_1"]
    z = []
    for seed in range(repeats):
        fit = LogResponseFit(starts=1).run(measured(true, angle, 0.03, seed), nominal, context())
        index = fit.parameters.names.index("gear_stiffness.axis_1")
        z.append((fit.parameters.estimate[index] - truth) / fit.parameters.standard_error[index])
    # The jackknife over three configurations makes intervals conservative: between 0.3 and 1 + 5 sqrt(2/60);
    # one mean of 15 squares in a thousand is below 0.23.
    assert least < np.mean(np.square(z)) < 1 + 5 * np.sqrt(2 / repeats)
    assert abs(np.mean(z)) < 5 / np.sqrt(repeats)


def test_a_spring_that_nothing_sees_keeps_what_was_known(six: tuple[Robot, Robot, np.ndarray]) -> None:
    """A bearing a million times stiffer than the rest does not bend: its prior is left, and the fit is doubted."""
    nominal, true, angle = six
    rigid = {"bearing_stiffness.axis_2_z": 1e12, "bearing_damping.axis_2_z": 1e5}
    fit = LogResponseFit(starts=1).run(
        measured(true.with_parameters(rigid), angle, 1e-3), nominal.with_parameters(rigid), context()
    )
    table = fit.parameters
    index = table.names.index("bearing_stiffness.axis_2_z")
    assert table.prior is not None
    assert table.standard_error[index] == pytest.approx(table.prior[index], rel=0.05)
    assert [doubt.kind for doubt in fit.doubts] == ["weak spring"]
    assert "bearing_stiffness.axis_2_z" in fit.doubts[0].sentence


def test_bodies_told_wrong_spoil_springs_unless_they_are_free(six: tuple[Robot, Robot, np.ndarray]) -> None:
    """Masses 1 % off, held: springs off by half a percent and told by the misfit; free within 1 %: as seen."""
    nominal, true, angle = six
    rng = np.random.default_rng(8)
    masses = {
        n: v * (1 + 0.01 * rng.standard_normal())
        for n, v in true.parameters().items()
        if n.startswith("mass.")
    }
    frf = measured(true.with_parameters(masses), angle, 1e-3)
    held, free = (
        LogResponseFit(starts=1, free=patterns).run(frf, nominal, context())
        for patterns in (None, ("*_stiffness.*", "*_damping.*", "mass.*"))
    )
    z = {}
    for name, fit in (("held", held), ("free", free)):
        table = fit.parameters
        rows = [table.names.index(n) for n in nominal.stiffness_names]
        truth = np.array([true.parameter(n) for n in nominal.stiffness_names])
        z[name] = (table.estimate[rows] - truth) / table.standard_error[rows]
        error = np.sqrt(np.mean((table.estimate[rows] / truth - 1) ** 2))
        assert (error > 3e-3) == (name == "held")
    assert [doubt.kind for doubt in held.doubts] == ["misfit"]
    assert not free.doubts
    # Twelve squared standardised errors, mean 1 +- 5 sqrt(2 / 12).
    assert np.mean(z["free"] ** 2) < 1 + 5 * np.sqrt(2 / 12)


@pytest.mark.parametrize(
    ("free", "said"),
    [
        (("friction.*",), r"free: 'friction.\*' means friction.axis_1.coulomb: three unknowns"),
        (("controller.*",), "the response does not depend on it"),
        (("gear_stifness.*",), "did you mean 'gear_stiffness"),
    ],
)
def test_what_cannot_be_free_is_refused_by_name(free: tuple[str, ...], said: str) -> None:
    nominal = Robot.load("one_axis")
    stage = LogResponseFit(free=free)
    with pytest.raises(ConfigurationError, match=said):
        stage.run(measured(nominal, np.zeros((2, 1)), 1e-2), nominal, context())
    assert list(stage.problems_with(nominal)) == [("free", 0)]


def test_equal_seeds_give_equal_bytes(tmp_path) -> None:
    nominal, true = Robot.load("one_axis"), Robot.load("one_axis_true")
    frf = measured(true, np.array([[0.3], [1.0]]), 0.02)
    for name in ("one", "two"):
        LogResponseFit(starts=4).run(frf, nominal, context(3)).write(tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_the_misfit_is_one_where_covariance_and_model_error_are_right() -> None:
    """Noise of known size and a rough model error of just the size that is granted, told apart by nothing else.

    720 real residuals: mean 1 +- 5 sqrt(2 / 720).
    """
    nominal = Robot.load("one_axis")
    frf = measured(nominal, np.random.default_rng(4).uniform(-1, 1, (9, 1)), 0.01)
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((2, *frf.response.shape)) * np.sqrt(0.5)
    disturbed = frf.replace(response=frf.response * np.exp(0.02 * (noise[0] + 1j * noise[1])))
    fit = LogResponseFit(starts=1, coupling_share=0.0, model_error=0.02).run(disturbed, nominal, context())
    assert fit.misfit == pytest.approx(1.0, abs=5 * np.sqrt(2 / 720))
    assert not fit.doubts


def test_what_the_model_lacks_shows_in_the_misfit() -> None:
    """A lag of half a sample, which no spring and no friction explains."""
    nominal = Robot.load("one_axis")
    frf = measured(nominal, np.array([[0.3], [1.0], [-0.5]]), 1e-5)
    lag = np.exp(-0.5e-3j * 2 * np.pi * FREQUENCY)[:, None, None]
    fit = LogResponseFit(starts=1).run(frf.replace(response=frf.response * lag), nominal, context())
    assert fit.misfit_against == "covariance and a model error of 0.2 %"
    assert "misfit" in [doubt.kind for doubt in fit.doubts]


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


@pytest.mark.parametrize(("n_out", "freedom"), [(1, 5), (2, 9)])
def test_the_inverse_of_an_estimated_covariance_is_too_large_by_the_stated_factor(
    n_out: int, freedom: int
) -> None:
    """40 000 scatter matrices of unit noise; the mean of their inverses within five sampling errors of the factor."""
    rng = np.random.default_rng(7)
    drawn = rng.standard_normal((40_000, n_out, freedom, 2)) @ np.array([1, 1j]) / np.sqrt(2)
    inverse = np.linalg.inv(drawn @ drawn.conj().swapaxes(1, 2) / freedom)
    traces = np.einsum("kii->k", inverse).real / n_out
    factor = inverse_excess(np.array([float(freedom)]), n_out).item()
    assert abs(traces.mean() - factor) < 5 * traces.std() / np.sqrt(len(traces))


def test_a_right_model_has_a_misfit_of_one_though_its_covariance_was_estimated() -> None:
    """One axis, 6000 values, each weighted by a scatter of five degrees of freedom of its own.

    Power over scatter is F(2, 10), of variance 2.6 about 1.25: a standard error of 0.017 of the mean, and five of them.
    """
    robot = Robot.load("one_axis")
    frf = measured(robot, np.linspace(-1, 1, 150)[:, None], 1e-2)
    scatter = np.random.default_rng(5).gamma(5.0, 0.2, frf.response.shape)
    assert frf.output_covariance is not None
    frf = frf.replace(
        output_covariance=frf.output_covariance * scatter,
        degrees_of_freedom=np.full(frf.response.shape[:2], 5.0),
    )
    fit = LogResponseFit(starts=1, model_error=1e-6).run(frf, robot, context())
    assert abs(fit.misfit - 1) < 5 * np.sqrt(2.6 / scatter.size) / 1.25


def test_the_unknowns_are_springs_dampers_and_three_numbers_of_friction_per_axis(
    six: tuple[Robot, Robot, np.ndarray],
) -> None:
    nominal, true, angle = six
    table = LogResponseFit(starts=1).run(measured(true, angle, 1e-2), nominal, context()).parameters
    assert [table.groups.count(group) for group in ("stiffness", "damping", "nuisance")] == [12, 12, 18]
    assert len(set(table.names)) == 42
    assert set(table.as_mapping()) == {*nominal.stiffness_names, *nominal.damping_names}


def test_an_effect_can_be_free_beside_the_springs() -> None:
    """A late position report, told half as long as it is: delay and spring come back within five standard errors."""
    nominal = Robot.load("one_axis").with_effect(
        "lag", "sensing.delay", "axis_1", "position", {"delay": 5e-4}
    )
    true = nominal.with_parameters({"effect.lag.delay": 1.0e-3, "gear_stiffness.axis_1": 5.0e4})
    frf = measured(true, np.array([[0.3], [1.0], [-0.5]]), 1e-2)
    fit = LogResponseFit(starts=2, free=("*_stiffness.*", "*_damping.*", "effect.lag.*")).run(
        frf, nominal, context()
    )
    table = fit.parameters
    for name in ("effect.lag.delay", "gear_stiffness.axis_1"):
        error = table.standard_error[table.names.index(name)]
        assert abs(table.value(name) - true.parameter(name)) < 5 * error
        assert error < 0.05 * true.parameter(name)
    assert fit.misfit < 1.08


def test_a_gain_of_the_torque_is_not_free_with_springs_and_bodies() -> None:
    nominal = Robot.load("one_axis").with_effect("warm", "sensing.gain_error", "axis_1", "torque_measurement")
    stage = LogResponseFit(free=("gear_stiffness.*", "mass.*", "effect.warm.*"))
    assert "common scale" in stage.problems_with(nominal)[("free",)]
    alone = LogResponseFit(free=("gear_stiffness.*", "effect.warm.*"))
    assert not alone.problems_with(nominal)


GANTRY = """robid_robot: 1
name: gantry
bodies:
  - {joint: x, type: prismatic, axis: [1, 0, 0], mass: 60}
  - {joint: y, parent: x, type: prismatic, axis: [0, 1, 0], mass: 25}
axes:
  x: {gear_ratio: 300, rotor_inertia: 3.0e-4, gear: {stiffness: 5.0e+6, damping: 3.0e+3}, friction: {viscous: 1.0e-3},
    controller: {speed_gain: 0.15}}
  y: {gear_ratio: 600, rotor_inertia: 1.0e-4, gear: {stiffness: 3.0e+6, damping: 1.0e+3}, friction: {viscous: 1.0e-3},
    controller: {speed_gain: 0.04}}
"""


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_axes_that_do_not_act_on_one_another_are_fitted_by_the_diagonal(tmp_path: Path, noise: float) -> None:
    """The slides of a gantry: responses off the diagonal are zero, or noise alone, and have no logarithm to fit."""
    (tmp_path / "gantry.yaml").write_text(GANTRY)
    nominal = Robot.load(str(tmp_path / "gantry.yaml"))
    truth = {"gear_stiffness.x": 6.5e6, "gear_stiffness.y": 2.4e6}
    frf = measured(nominal.with_parameters(truth), np.zeros((2, 2)), max(noise, 1e-9))
    frf = frf.replace(travel_covariance=np.broadcast_to(1e-4 * np.eye(2), (2, 2, 2)))
    if not noise:
        frf = frf.replace(response=frf.response * np.eye(2))
    fit = LogResponseFit(starts=2, model_error=1e-3).run(frf, nominal, context())
    assert fit.converged
    # Two numbers of each entry of the diagonal are the data; of 320, the misfit of a right model scatters by 8 %.
    assert fit.misfit < 1.3
    if noise:
        assert fit.misfit > 0.4  # some 1e-3 of noise beside 1e-3 of model error that is not there
    for name, value in truth.items():
        table = fit.parameters
        error = table.standard_error[table.names.index(name)]
        assert abs(table.as_mapping()[name] - value) < 4 * error + 1e-4 * value
        assert error < 0.01 * value
