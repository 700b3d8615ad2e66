"""Phases and signals of the excitation against their definitions."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import ComplexArray, FloatArray
from robid_core.errors import ConfigurationError
from robid_core.estimation.excitation import multisine as ms


@pytest.mark.parametrize(("n_exp", "n_axis"), [(1, 1), (2, 2), (6, 6), (7, 6), (7, 7)])
def test_columns_of_the_orthogonal_matrix_are_orthogonal(n_exp: int, n_axis: int) -> None:
    t = ms.orthogonal_matrix(n_exp, n_axis)
    assert t.shape == (n_exp, n_axis)
    # 2 n roundings of numbers of size 1 in each of the sums of n products.
    assert np.abs(t.conj().T @ t - n_exp * np.eye(n_axis)).max() < 4 * n_exp**2 * np.finfo(float).eps
    for e in range(n_exp):
        for c in range(n_axis):
            assert t[e, c] == pytest.approx(
                np.cos(2 * np.pi * e * c / n_exp) + 1j * np.sin(2 * np.pi * e * c / n_exp)
            )


@pytest.mark.parametrize("n_exp", [6, 7])
@pytest.mark.parametrize("common", [False, True])
def test_inputs_of_a_block_are_orthogonal_at_every_line(n_exp: int, common: bool) -> None:
    line = ms.logarithmic_odd_lines((4.0, 80.0), 30, 2.0)
    size = np.linspace(0.3, 1.7, 6)  # each axis its own
    amplitude = np.broadcast_to(size, (30, 6))
    phases = ms.draw_phases(30, 6, n_exp, common, np.random.default_rng(1))
    signal = ms.multisine(amplitude, *phases, line, 2000)
    u = np.moveaxis(np.fft.fft(signal, axis=1)[:, line, :] / 2000, 0, -1)  # (n_freq, n_axis, n_exp)
    gram = u @ u.conj().swapaxes(-1, -2)
    assert np.abs(gram - n_exp * np.diag(size**2) / 4).max() < 1e-13
    # Nothing between the lines.
    rest = np.delete(np.fft.rfft(signal, axis=1) / 2000, line, axis=1)
    assert np.abs(rest).max() < 1e-13


def test_phases_follow_the_sign_of_the_fourier_transform() -> None:
    amplitude, phase = np.array([[2.0, 3.0]]), np.array([[0.4, -1.1]])
    experiment_phase = np.array([[0.9, 2.0]])
    signal = ms.multisine(amplitude, phase, experiment_phase, np.array([5]), 64)
    time = np.arange(64) / 64
    for experiment in range(2):
        for axis in range(2):
            # (4.1) and (4.2) written out: a cosine whose phase gains 2 pi e c / n, and the experiment's own.
            shifted = phase[0, axis] + 2 * np.pi * experiment * axis / 2 + experiment_phase[0, experiment]
            expected = amplitude[0, axis] * np.cos(2 * np.pi * 5 * time + shifted)
            assert np.abs(signal[experiment, :, axis] - expected).max() < 1e-13
            # X(k) = sum x exp(-i w t): the phase of a cosine is the phase of its line, not the opposite.
            line = np.fft.fft(signal[experiment, :, axis])[5] / 64
            assert line == pytest.approx(amplitude[0, axis] / 2 * np.exp(1j * shifted))


def test_columns_beside_the_free_one_sum_to_zero() -> None:
    # 7 roundings of numbers of size 1.
    assert np.abs(ms.experiment_factors(7, 6).sum(axis=0)).max() < 7 * np.finfo(float).eps
    assert np.array_equal(ms.experiment_factors(7, 6), ms.orthogonal_matrix(7)[:, 1:])
    assert np.array_equal(ms.experiment_factors(6, 6), ms.orthogonal_matrix(6))
    # More experiments than axes by more than one leave it free too; fewer take the first columns.
    assert np.array_equal(ms.experiment_factors(5, 2), ms.orthogonal_matrix(5)[:, 1:3])
    assert np.array_equal(ms.experiment_factors(1, 2), ms.orthogonal_matrix(1, 2))


def test_one_experiment_more_rejects_what_does_not_depend_on_the_phases_exactly() -> None:
    # A known plant with a ripple that is the same in every experiment, as strong as the response itself.
    generator = np.random.default_rng(2)
    line, n = ms.logarithmic_odd_lines((4.0, 80.0), 20, 2.0), 3
    plant, ripple = (
        generator.normal(size=(20, n, m)) + 1j * generator.normal(size=(20, n, m)) for m in (n, 1)
    )

    def response(n_exp: int, common: bool) -> tuple[ComplexArray, ComplexArray]:
        phases = ms.draw_phases(20, n, n_exp, common, generator)
        signal = ms.multisine(np.ones((20, n)), *phases, line, 2000)
        u = np.moveaxis(np.fft.rfft(signal, axis=1)[:, line] / 2000, 0, -1)
        y = plant @ u + ripple
        h1 = y @ u.conj().swapaxes(-1, -2) @ np.linalg.inv(u @ u.conj().swapaxes(-1, -2))
        return h1, y

    h1, y = response(n + 1, common=True)
    # Sums of 4 terms of size 4 over an input of 1/2 squared: tens of roundings.
    assert np.abs(h1 - plant).max() < 1e-13
    assert np.abs(y.mean(axis=-1) - ripple[..., 0]).max() < 1e-13
    # Without the free column, or with phases of the experiments' own, it stays: 1 / sqrt(n_exp) of it over 1/2.
    assert np.abs(response(n, common=True)[0] - plant).max() > 0.5
    assert np.abs(response(n + 1, common=False)[0] - plant).max() > 0.5


def friction(speed: FloatArray) -> FloatArray:
    """Asymmetric friction of a motor: Coulomb, viscous, and stronger one way."""
    return np.where(speed > 0, 1.3, 0.8) * np.tanh(speed / 0.2) + 0.1 * speed


def test_friction_harmonics_of_an_even_bin_never_reach_an_excited_line() -> None:
    line = ms.logarithmic_odd_lines((4.0, 80.0), 100, 8.0)
    for sine_bin, reaches in [(2, False), (4, False), (3, True)]:
        speed = ms.sine(np.array([9.0]), np.array([0.7]), sine_bin, 8000)
        spectrum = np.abs(np.fft.rfft(friction(speed), axis=0)[line, 0]) / 8000
        # Rounding of 8000 numbers of size 2.2 averages to 1e-16; the twentieth harmonic is near 1 / 20.
        assert (spectrum.max() > 1e-3) == reaches
        assert reaches or spectrum.max() < 1e-14


def test_torque_of_a_motor_under_a_speed_loop_is_the_same_at_every_line() -> None:
    frequency = np.geomspace(4, 80, 25)
    inertia, gain = np.array([0.004, 0.0003]), np.array([0.2, 0.02])
    speed_rms = np.array([3.0, 5.0])
    amplitude = ms.flat_torque_amplitude(frequency, gain / inertia / (2 * np.pi), speed_rms)
    s = 2j * np.pi * frequency[:, None]
    torque = gain / (1 + gain / (inertia * s)) * amplitude  # K (r - v), v = torque / (J s)
    assert np.abs(torque) == pytest.approx(np.broadcast_to(np.abs(torque[0]), torque.shape), rel=1e-12)
    speed = np.abs(torque / (inertia * s))
    assert np.sqrt(0.5 * (speed**2).sum(axis=0)) == pytest.approx(speed_rms, rel=1e-12)


def test_more_draws_lower_the_crest_factor_and_keep_the_spectrum() -> None:
    line = ms.logarithmic_odd_lines((4.0, 80.0), 40, 2.0)
    amplitude = ms.flat_torque_amplitude(line / 2.0, np.array([6.0, 9.0]), np.array([2.0, 1.0]))
    one, many = (ms.low_crest_multisine(amplitude, line, 2000, n, np.random.default_rng(3)) for n in (1, 30))
    assert ms.crest_factor(many) < ms.crest_factor(one)
    spectra = [np.abs(np.fft.rfft(signal, axis=1)[:, line]) * 2 / 2000 for signal in (one, many)]
    for spectrum in spectra:
        assert np.abs(spectrum - amplitude).max() < 1e-12
    assert ms.crest_factor(np.cos(2 * np.pi * np.arange(400) / 400)[None, :, None]) == pytest.approx(
        np.sqrt(2)
    )


def test_draws_of_a_plain_block_keep_their_order() -> None:
    # Results of earlier versions stay what they were: phases of axes first, then of experiments, from one stream.
    both = np.random.default_rng(5).uniform(0, 2 * np.pi, (2, 7, 3))
    phase, experiment_phase = ms.draw_phases(7, 3, 3, False, np.random.default_rng(5))
    assert np.array_equal(np.stack([phase, experiment_phase]), both)


def test_no_draw_at_all_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="at least one"):
        ms.low_crest_multisine(np.ones((1, 1)), np.array([3]), 32, 0, np.random.default_rng(0))


def test_distortion_of_one_motor_is_new_in_every_experiment() -> None:
    # A nonlinearity of each motor alone, as friction is. Most of it turns with the multisine's phase and comes
    # back in all experiments of a block, unless every experiment has phases of its own. (First axis: T is one
    # there, and its signal the same in every experiment.) Chance: 1 / sqrt(140) = 0.085.
    generator = np.random.default_rng(7)
    line, n = ms.logarithmic_odd_lines((4.0, 80.0), 140, 4.0), 3
    phase, experiment_phase = generator.uniform(0, 2 * np.pi, (2, 140, n))
    coherence = []
    for own in (0.0, 1.0):
        signal = ms.multisine(np.ones((140, n)), phase, own * experiment_phase, line, 4000)
        u = np.fft.rfft(signal, axis=1)[:, line]
        relative = np.fft.rfft(np.abs(signal) * signal, axis=1)[:, line] / u
        relative -= relative.mean(axis=1, keepdims=True)  # the linear part
        cross = np.abs(np.mean(relative[0] * relative[1].conj(), axis=0))
        coherence.append(cross / np.mean(np.abs(relative) ** 2, axis=(0, 1)))
    assert coherence[0][0] == pytest.approx(1.0)
    assert (coherence[0][1:] > 0.3).all()
    assert (coherence[1] < 0.2).all()
