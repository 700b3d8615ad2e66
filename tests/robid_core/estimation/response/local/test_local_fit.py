"""Local fits on plants in closed form: what is in the model class is found, what is not errs as it must."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core import ConfigurationError, DataRejected
from robid_core.estimation.response.local import task
from robid_core.estimation.response.local.compiled import compiled_fit
from robid_core.estimation.response.local.fit import FEW, local_rational
from robid_core.estimation.response.local.model import LocalModel
from robid_core.testing.plants import MassSpringPlant

FREQUENCY = np.sort(np.random.default_rng(5).uniform(20, 80, 60))  # irregular on purpose


def phases(seed: int, *shape: int) -> Any:
    return np.exp(2j * np.pi * np.random.default_rng(seed).random(shape))


def error(fit: Any, truth: Any) -> Any:
    return np.abs(fit.response - truth).max(axis=(1, 2)) / np.abs(truth).max(axis=(1, 2))


def plant_of(parametrization: str, n_axis: int) -> Any:
    """Response at FREQUENCY that the parametrisation holds exactly with orders 2/2, and no smaller one."""
    f = FREQUENCY[:, None, None]
    generator = np.random.default_rng(n_axis)
    residue = generator.standard_normal((3, n_axis, n_axis)) + 1j * generator.standard_normal(
        (3, n_axis, n_axis)
    )
    if parametrization == "mimo":
        return MassSpringPlant.of(n_axis).response(FREQUENCY)  # D = K + i w C - w^2 M, N = -w^2 B
    poles = np.array([35 + 0.7j, 60 + 1.2j])
    if parametrization == "scalar":
        return residue[0] + 5 * residue[1] / (f - poles[0]) + 5 * residue[2] / (f - poles[1])
    own = np.linspace(0, 8, n_axis)[:, None]
    return residue[0] + 5 * residue[1] / (f - poles[0] - own) + 5 * residue[2] / (f - poles[1] + own)


@pytest.mark.parametrize("compiled", [True, False], ids=["kernel", "plain"])
@pytest.mark.parametrize("approach", ["direct", "jio"])
@pytest.mark.parametrize("parametrization", ["scalar", "miso", "mimo"])
@pytest.mark.parametrize(("n_axis", "n_exp"), [(1, 1), (2, 1), (2, 5), (3, 2), (6, 6)])
def test_a_plant_in_the_model_class_is_recovered(
    parametrization: Any, n_axis: int, n_exp: int, approach: str, compiled: bool
) -> None:
    # A constant feedback leaves the poles' number as it is: G_rz = [G; I] (I + F G)^-1 has the left fraction
    # (D + N F), of order two, for a full matrix only; so the joint approach is tried on that and on open loops.
    truth = plant_of(parametrization, n_axis)
    reference = phases(1, len(FREQUENCY), n_axis, n_exp)
    feedback = 0.3 / np.abs(truth).max() * np.eye(n_axis) * (parametrization == "mimo" and approach == "jio")
    u = np.linalg.solve(np.eye(n_axis) + feedback @ truth, reference)
    fit = local_rational(
        u,
        truth @ u,
        FREQUENCY,
        LocalModel(parametrization),
        reference=reference if approach == "jio" else None,
        compiled=compiled,
    )
    assert fit.valid.all()
    # Least squares of condition 1e4 to 1e6 in rounding errors of 1e-16.
    assert error(fit, truth).max() < 1e-9
    for line in (0, 30, 59):  # ends of the band and the middle
        around = fit.around(line, FREQUENCY[fit.first[line] : fit.last[line] + 1])
        assert np.abs(around - truth[fit.first[line] : fit.last[line] + 1]).max() < 1e-6 * np.abs(truth).max()
    if fit.output_covariance is not None:
        np.linalg.cholesky(fit.output_covariance)
        np.linalg.cholesky(fit.gram_inverse)


def test_the_polynomial_errs_at_a_resonance_as_a_polynomial_does_and_the_rational_function_does_not() -> None:
    # One input of size one: the local polynomial is the parabola through G of the window's lines by least squares.
    truth = (1 + 8 / (FREQUENCY - 45 - 1.5j))[:, None, None]
    u = phases(2, len(FREQUENCY), 1, 1)
    polynomial, rational = (
        local_rational(u, truth @ u, FREQUENCY, LocalModel("miso", 2, order), window_lines=9)
        for order in (0, 2)
    )
    expected = []
    for line, (first, last) in enumerate(zip(polynomial.first, polynomial.last, strict=True)):
        offset = FREQUENCY[first : last + 1] - FREQUENCY[line]
        values = truth[first : last + 1, 0, 0]
        expected.append(np.polyfit(offset, values.real, 2)[-1] + 1j * np.polyfit(offset, values.imag, 2)[-1])
    assert polynomial.response[:, 0, 0] == pytest.approx(np.array(expected), rel=1e-9)
    assert error(polynomial, truth).max() > 0.2
    assert error(rational, truth).max() < 1e-10


def test_residuals_of_equations_have_the_stated_mean() -> None:
    # A polynomial that holds the plant: C_V is the noise, without bias, and of the right transposition: E v v^H.
    n_axis, n_exp, mixing = 2, 6, np.array([[1.0, 0.0], [0.6j, 0.8]])
    generator = np.random.default_rng(4)
    truth = np.array([[1.0, 0.3], [-0.2, 2.0]]) + 0.01 * FREQUENCY[:, None, None]
    total, count = np.zeros((2, 2), dtype=complex), 0
    for _ in range(40):
        u = np.exp(2j * np.pi * generator.random((len(FREQUENCY), n_axis, n_exp)))
        parts = generator.standard_normal((2, len(FREQUENCY), n_axis, n_exp))
        noise = 0.05 * mixing @ (parts[0] + 1j * parts[1]) / np.sqrt(2)
        fit = local_rational(u, truth @ u + noise, FREQUENCY, LocalModel("miso", 1, 0), window_lines=6)
        assert fit.output_covariance is not None
        total += fit.output_covariance[3::6].sum(axis=0)
        count += len(fit.output_covariance[3::6])
    # 400 windows of 6 x 6 - 4 = 32 degrees of freedom: 1 / sqrt(12800) = 0.9 %; four standard errors.
    expected = 0.05**2 * mixing @ mixing.conj().T
    assert np.abs(total / count - expected).max() < 0.036 * expected.real.max()


def test_a_transient_is_taken_up_by_its_polynomial() -> None:
    plant = MassSpringPlant.of(2)
    truth = plant.response(FREQUENCY)
    s = 2j * np.pi * FREQUENCY[:, None, None]
    dynamic = plant.mass * s**2 + plant.damping * s + plant.stiffness
    # A free motion has the same poles: D T is a polynomial, here of order one, another for each experiment.
    generator = np.random.default_rng(6)
    start = generator.standard_normal((2, 2, 3)) * np.abs(truth).max()
    leakage = np.linalg.solve(dynamic, start[0] * 1e4 + 60 * s * start[1])
    u = phases(7, len(FREQUENCY), 2, 3)
    y = truth @ u + leakage
    with_it = local_rational(u, y, FREQUENCY, LocalModel("mimo", transient_order=1))
    without = local_rational(u, y, FREQUENCY, LocalModel("mimo"))
    assert error(with_it, truth).max() < 1e-9
    assert np.median(error(without, truth)) > 1e-2
    # Two unknowns per experiment and output less.
    assert with_it.degrees_of_freedom[0] == 3 * (with_it.windows.size[0] - 2) - 10


def test_feedback_biases_the_direct_approach_as_derived_and_not_the_joint_one() -> None:
    # u = r - F y, y = G u + v with constant G and F, |r| = 1 and variance s^2 of v. Then
    # E y u* / E |u|^2 = (G - F* s^2) / (1 + |F|^2 s^2): the direct approach tends to it, the joint one to G.
    gain, feedback, deviation = 2.0 - 1.0j, 0.8 + 0.3j, 0.7
    generator = np.random.default_rng(8)
    n_exp = 60
    reference = phases(9, len(FREQUENCY), 1, n_exp)
    parts = generator.standard_normal((2, len(FREQUENCY), 1, n_exp))
    noise = deviation * (parts[0] + 1j * parts[1]) / np.sqrt(2)
    u = (reference - feedback * noise) / (1 + feedback * gain)
    y = gain * u + noise
    model = LocalModel("miso", 0, 0)
    direct = local_rational(u, y, FREQUENCY, model, window_lines=60)
    joint = local_rational(u, y, FREQUENCY, model, window_lines=60, reference=reference)
    biased = (gain - np.conj(feedback) * deviation**2) / (1 + abs(feedback) ** 2 * deviation**2)
    assert abs(biased - gain) > 0.5
    # 3600 rows: standard error of G is |1 + F G| s / 60 = 0.03 for the joint approach, less for the other;
    # four of them.
    assert abs(joint.response[30, 0, 0] - gain) < 0.13
    assert abs(direct.response[30, 0, 0] - biased) < 0.13
    assert joint.output_covariance is not None
    stated = np.sqrt((joint.output_covariance * joint.gram_inverse).real[30, 0, 0])
    assert stated == pytest.approx(abs(1 + feedback * gain) * deviation / 60, rel=0.1)


def test_lines_around_which_an_axis_does_not_move_are_masked() -> None:
    truth = MassSpringPlant.of(2).response(FREQUENCY)
    u = phases(10, len(FREQUENCY), 2, 2)
    u[10:30, 1] = 0
    fit = local_rational(u, truth @ u, FREQUENCY, LocalModel("mimo"), window_lines=9)
    # Windows 10..18 to 21..29 lie inside the gap: those of lines 14 to 25.
    assert np.flatnonzero(~fit.valid).tolist() == list(range(14, 26)) or not fit.valid[14:26].any()
    assert np.isnan(fit.response[~fit.valid]).all()
    assert (fit.degrees_of_freedom[~fit.valid] == 0).all()
    assert error(fit, truth)[fit.valid][[0, -1]].max() < 1e-8


def test_what_cannot_be_used_is_named() -> None:
    truth = MassSpringPlant.of(2).response(FREQUENCY)
    u = phases(11, len(FREQUENCY), 2, 2)
    y = truth @ u
    bad = y.copy()
    bad[7, 1, 0] = np.nan
    with pytest.raises(
        DataRejected, match=rf"output spectrum .* {FREQUENCY[7]:.4g} Hz, axis 2, experiment 1"
    ):
        local_rational(u, bad, FREQUENCY, LocalModel())
    with pytest.raises(DataRejected, match="reference has 1 axes and the input 2"):
        local_rational(u, y, FREQUENCY, LocalModel(), reference=u[:, :1])
    with pytest.raises(ConfigurationError, match="direct approach"):
        local_rational(u, y, FREQUENCY, LocalModel(), reference=u, poles_hz=np.array([40 + 1j]))


def test_a_window_with_nothing_to_spare_gives_a_response_without_covariance() -> None:
    truth = MassSpringPlant.of(2).response(FREQUENCY)
    u = phases(12, len(FREQUENCY), 2, 1)
    fit = local_rational(
        u, truth @ u, FREQUENCY, LocalModel("mimo"), window_lines=11
    )  # 10 unknowns: one to spare
    assert fit.output_covariance is None
    assert error(fit, truth).max() < 1e-6
    assert (fit.degrees_of_freedom == 0).all()


@pytest.mark.parametrize("n_freq", [FEW // 2 - 10, FEW // 2 + 10])
def test_a_kernel_is_compiled_only_for_many_lines(n_freq: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two experiments; both ways find the plant."""
    asked = list[int]()

    def counted(*given: Any, **named: Any) -> Any:
        asked.append(n_freq)
        return compiled_fit(*given, **named)

    monkeypatch.setattr(task, "compiled_fit", counted)
    frequency = np.linspace(20, 80, n_freq)
    truth = MassSpringPlant.of(2).response(frequency)
    u = phases(7, n_freq, 2, 2)
    fit = local_rational(u, truth @ u, frequency, LocalModel("mimo", 2, 2), window_lines=15)
    assert bool(asked) == (2 * n_freq >= FEW)
    assert np.quantile(error(fit, truth), 0.9) < 1e-6
