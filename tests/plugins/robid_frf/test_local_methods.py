"""frf.lpm and frf.lrm: the contract of stages, one experiment, and what a Frf of theirs says."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest

from robid_core import ConfigurationError, Context, DataRejected, PoorExcitation, Robot
from robid_core.estimation.response.local.prior import pole_frequencies
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_core.testing.estimators import check_covers_truth
from robid_core.testing.plants import LINES, MassSpringPlant, plant_record
from robid_core.testing.robots import example_robot
from robid_frf.lpm import LocalPolynomial
from robid_frf.lrm import LocalRational, nominal_poles


def context() -> Context:
    log = logging.getLogger("test.local")
    return Context(np.random.default_rng(0), map_in_process, lambda done, total, note="": None, log)


def one_experiment(record: Any) -> Any:
    """The same record with the first experiment of the first block only."""
    run = record.run
    channels = {
        name: channel.replace(values=channel.values[:, :1, :1]) for name, channel in run.channels.items()
    }
    return record.replace(runs=(run.replace(channels=channels, valid=run.valid[:, :1, :1]),))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return example_robot(2)


@pytest.mark.parametrize("approach", ["direct", pytest.param("jio", marks=pytest.mark.full)])
def test_the_contract_of_stages_is_kept_by_the_full_fraction(approach: str) -> None:
    # Coupled masses are in its class, D = K + i w C - w^2 M: recovered to the contract's own tolerance.
    check_stage(LocalRational, for_axes=(1, 2, 6) if approach == "direct" else (6,), approach=approach)


def test_the_contract_of_stages_is_kept_by_the_polynomial() -> None:
    # A parabola through three lines misses none of them.
    check_stage(LocalPolynomial, for_axes=(1, 2), window_lines=3)


@pytest.mark.full
def test_uncertainty_of_simpler_denominators_covers_the_truth_too() -> None:
    assert check_covers_truth(LocalRational(parametrization="miso", iterations=2))


def test_one_experiment_of_six_axes_gives_a_response_with_its_covariance() -> None:
    plant = MassSpringPlant.of(6)
    record = one_experiment(plant_record(plant, n_config=1))
    # Thirty lines: a polynomial of order one has twelve unknowns, and leaves eighteen degrees of freedom of a complex
    # residual for six outputs.
    frf = LocalPolynomial(numerator_order=1).run(record, context())
    assert frf.has_covariance
    assert frf.degrees_of_freedom is not None
    assert (frf.degrees_of_freedom == 18).all()
    np.linalg.cholesky(frf.covariance(0))
    assert "local fits over 30 lines of 1 experiment, 18 degrees of freedom" in frf.pooling
    # The full fraction of first order has eighteen unknowns, of second order thirty and nothing to spare.
    robot = example_robot(6)
    first = LocalRational(numerator_order=1, denominator_order=1).run(record, robot, context())
    assert first.has_covariance
    exact = LocalRational().run(record, robot, context())
    assert not exact.has_covariance
    assert "total: none stated, windows of 30 lines of 1 experiment leave too few residuals" in exact.pooling
    with pytest.raises(
        DataRejected, match=r"42 unknowns per output need a window of 42 lines .* has 30; measure 2"
    ):
        LocalRational(approach="jio").run(record, robot, context())


def test_settings_reach_the_fit_and_the_words(robot: Robot) -> None:
    plant = MassSpringPlant.of(2)
    record = plant_record(plant, n_config=1, noise=0.02)
    truth = plant.response(LINES * 1.0)

    def error(frf: Any) -> float:
        return float(np.sqrt(np.mean(np.abs(frf.response[0] - truth) ** 2)))

    default = LocalRational().run(record, robot, context())
    assert "over 7 lines of 4 experiments" in default.pooling
    assert default.noise_degrees_of_freedom is not None
    assert default.covers == default.OWN_MEAN
    chosen = LocalRational(choose="window").run(record, robot, context())
    assert "predict lines from their neighbours best" in chosen.pooling
    assert error(chosen) < error(default)
    wide = LocalRational(window_hz=24.0).run(record, robot, context())
    assert "over 12 to 13 lines" in wide.pooling or "over 13 lines" in wide.pooling
    # Noise is all there is: differences between periods show what the residuals show.
    both = [
        np.einsum("cfii->fi", c).real.mean() for c in (default.noise_covariance, default.output_covariance)
    ]
    assert both[0] == pytest.approx(both[1], rel=0.25)
    for parametrization in ("scalar", "miso"):
        frf = LocalRational(parametrization=parametrization, approach="jio", iterations=3).run(
            record, robot, context()
        )
        assert frf.has_covariance
        assert frf.estimator == f"LRM ({parametrization}, jio)"


def test_prior_poles_are_those_of_the_nominal_robot(robot: Robot) -> None:
    angle = 0.5 * (robot.drives.lower + robot.drives.upper)
    poles = pole_frequencies(np.linalg.eigvals(robot.linearize(angle).a))
    # Where the continuous response is evaluated at a pole, it is far beyond what it is elsewhere.
    second = robot.second_order(angle[None])
    for pole in poles:
        s = 2j * np.pi * pole
        stiffness = second.stiffness[0] + s * second.damping[0] + s**2 * second.mass[0]
        singular = np.linalg.svd(stiffness, compute_uv=False)
        assert singular[-1] < 1e-6 * singular[0]
    record = plant_record(MassSpringPlant.of(2), n_config=1)
    frf = LocalRational(prior_poles=True, window_lines=7).run(record, robot, context())
    assert frf.estimator == "LRM (prior poles, direct)"
    assert np.isfinite(frf.response).all()
    other = record.replace(axis_names=("a", "b"))
    with pytest.raises(ConfigurationError, match="speaks of a, b and the robot of"):
        nominal_poles(other, robot, 0)
    with pytest.raises(ConfigurationError, match="direct approach"):
        LocalRational(prior_poles=True, approach="jio").run(record, robot, context())


def test_an_axis_that_does_not_move_is_told(robot: Robot, caplog: pytest.LogCaptureFixture) -> None:
    record = plant_record(MassSpringPlant.of(2), n_config=1)
    torque = record.run.channels["motor_torque"]

    def silenced(lines: Any) -> Any:
        spectrum = np.fft.rfft(torque.values, axis=4)
        spectrum[..., lines, 1] = 0
        values = np.fft.irfft(spectrum, n=torque.values.shape[4], axis=4)
        channels = {**record.run.channels, "motor_torque": torque.replace(values=values)}
        return record.replace(runs=(record.run.replace(channels=channels),))

    # One line without it is bridged by its neighbours; eight together are masked and listed, and too many.
    assert LocalPolynomial().run(silenced(LINES[10]), context()).valid_lines.all()
    with pytest.raises(PoorExcitation, match=r"configuration 1: .* of 30 lines are masked, from"):
        LocalPolynomial().run(silenced(LINES[5:20]), context())
    assert "do not span all axes, masked: " in caplog.text
