"""Weights over time, against sums that are written out, and what they do to noise."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.estimation.standstill import rests_of
from robid_core.estimation.torque.windowed import windowed_motion_of
from robid_core.residual import Weighting
from robid_core.residual.moving_samples import EDGE_S, PERIODS, MovingSamples, moving_samples

STEP, N = 0.002, 3000
HIGHEST_HZ = 40.0


def moves(generator: np.random.Generator) -> np.ndarray:
    """Two axes, (1, 2, N, 2): quintic moves and rests, the second axis at rest in the second experiment's middle."""
    angle = np.zeros((1, 2, N, 2))
    for e in range(2):
        for a in range(2):
            for first, n in ((100, 700), (1100, 500), (2000, 800)):
                if e == a == 1 and first == 1100:
                    continue
                x = np.clip((np.arange(N) - first) / n, 0, 1)
                angle[0, e, :, a] += generator.uniform(2, 20) * (10 * x**3 - 15 * x**4 + 6 * x**5)
    return angle + 1e-5 * generator.normal(size=angle.shape)


def weights(generator: np.random.Generator) -> tuple[MovingSamples, int, np.ndarray]:
    angle = moves(generator)
    motion = windowed_motion_of(angle, np.zeros_like(angle), STEP, HIGHEST_HZ)
    (found,) = moving_samples([motion])
    assert found is not None
    return found, len(motion.bin), angle


def drawn(generator: np.random.Generator, n_bin: int) -> np.ndarray:
    """Spectra of three signals in each row, (1, 2, n_bin, 2, 3), real in the mean."""
    real, imaginary = generator.normal(size=(2, 1, 2, n_bin, 2, 3))
    imaginary[:, :, 0] = 0.0
    return np.asarray(real + 1j * imaginary)


def over_time(spectrum: np.ndarray, n_time: int) -> np.ndarray:
    """Values of spectra (n_bin, ...) by a sum over bins and their mirror images."""
    turn = np.exp(2j * np.pi * np.outer(np.arange(n_time), np.arange(len(spectrum))) / n_time)
    return np.tensordot(turn[:, 1:], 2 * spectrum[1:], 1).real + spectrum[0].real


def test_weights_are_zero_at_rest_and_one_where_an_axis_moves() -> None:
    """Rests are those of the speed that was made; their edges are known to what is stated."""
    found, _, angle = weights(np.random.default_rng(1))
    rests = np.stack(rests_of(list(angle[0]), [STEP, STEP]))[None]
    at = np.round(np.arange(found.weight.shape[2]) * N / found.weight.shape[2]).astype(int)
    margin = round((PERIODS / HIGHEST_HZ + 2 * EDGE_S) / STEP)
    far_from_rest = ~np.array(
        [[np.convolve(own, np.ones(2 * margin + 1), "same") > 0 for own in one.T] for one in rests[0]]
    ).swapaxes(1, 2)
    assert (found.weight[0][rests[0, :, at].swapaxes(0, 1)] == 0).all()
    assert (found.weight[0][far_from_rest[:, at]] == 1).all()
    share = found.weight.mean(axis=2)
    assert 0.1 < share[0, 1, 1] < share[0, 0, 1] < 0.9


def test_spectra_are_those_of_weighted_values() -> None:
    """Products over time by sums over all bins, for residuals and for derivatives with another axis."""
    generator = np.random.default_rng(2)
    found, n_bin, _ = weights(generator)
    spectra = drawn(generator, n_bin)
    n_time = found.weight.shape[2]
    back = np.exp(-2j * np.pi * np.outer(np.arange(n_bin), np.arange(n_time)) / n_time) / n_time
    values = over_time(found.band[:, None, None] * spectra[0, 1], n_time) * found.weight[0, 1, :, :, None]
    whole = found.of(spectra)
    np.testing.assert_allclose(whole[0, 1], np.tensordot(back, values, 1), atol=1e-12)
    np.testing.assert_array_equal(found.of(spectra[..., 0]), whole[..., 0])


def test_noise_has_the_share_of_power_that_is_stated() -> None:
    """300 draws of white noise: mean power by share to 4 of its deviations; at full power as without weights."""
    generator = np.random.default_rng(3)
    found, n_bin, _ = weights(generator)
    power, full = np.zeros((2, 300, 2, 2))
    for k in range(len(power)):
        noise = generator.normal(size=(2, 1, 2, n_bin, 2)) / np.sqrt(2)
        spectra = noise[0] + 1j * noise[1]
        spectra[:, :, 0] = spectra[:, :, 0].real
        power[k] = (np.abs(found.of(spectra)) ** 2).mean(axis=(0, 2))
        full[k] = (np.abs(found.at_full_power(spectra)) ** 2).mean(axis=(0, 2))
    share = found.share[0].mean(axis=1)
    error = power.std(axis=0) / np.sqrt(len(power))
    assert (np.abs(power.mean(axis=0) - share) < 4 * error).all()
    # Bins that count for next to nothing are not made large.
    assert np.abs(full.mean(axis=(0, 1)) - 1).max() < 0.1


def test_columns_and_free_vibration_get_the_weights_of_the_residual() -> None:
    """A residual that is a sum of columns has their weighted rows; one that is free vibration has none."""
    generator = np.random.default_rng(4)
    found, n_bin, _ = weights(generator)
    spectra = drawn(generator, n_bin)
    size = np.array([1.0, -2.0, 0.5])
    matrix = np.tile(np.array([[1.0, 0.2], [0.0, 0.7]], dtype=complex), (n_bin, 1, 1))
    plain = Weighting.of_block(matrix, None, moving=found)
    runs = np.moveaxis(spectra[0], 1, 0)
    columns = plain.columns(0, iter([runs[:50], runs[50:]]))
    residual = plain.residual(spectra @ size)
    np.testing.assert_allclose(columns @ size, residual.ravel(), rtol=0, atol=1e-12 * np.abs(residual).max())
    assert plain.count(residual) == pytest.approx(2 * found.share.sum())
    ringing = Weighting.of_block(matrix, spectra[..., :2], moving=found)
    left = ringing.residual(spectra[..., :2] @ size[:2])
    assert np.abs(left).max() < 1e-10 * np.abs(residual).max()


def test_an_experiment_at_rest_has_rows_of_zeros_and_no_free_vibration() -> None:
    generator = np.random.default_rng(6)
    found, n_bin, _ = weights(generator)
    still = MovingSamples(found.weight * np.array([1.0, 0.0])[:, None, None], found.band)
    spectra = generator.normal(size=(1, 2, n_bin, 2, 2)) + 0j
    weighting = Weighting.of_block(np.tile(np.eye(2, dtype=complex), (n_bin, 1, 1)), spectra, moving=still)
    assert [basis.shape[1] for basis in weighting.free_vibration[0]] == [2, 0]
    rows = weighting.residual(spectra[..., 0] + 1j)
    assert not rows[0, 1].any()
    assert rows[0, 0].any()
    assert weighting.count(rows) == pytest.approx(2 * found.share[:, :1].sum())


def test_motions_without_rests_have_no_weights() -> None:
    time = STEP * np.arange(N)
    angle = np.stack([np.sin(3 * time), np.cos(5 * time)], axis=1)[None, None]
    assert moving_samples([windowed_motion_of(angle, np.zeros_like(angle), STEP, HIGHEST_HZ)]) == [None]


def test_what_is_at_rest_is_not_seen_from_motion() -> None:
    """A torque at rest, which a band without highest bins spreads: a hundredth of it at most is left."""
    angle = moves(np.random.default_rng(5))
    torque = np.stack(rests_of(list(angle[0]), [STEP, STEP]))[None].astype(float)
    motion = windowed_motion_of(angle, torque, STEP, HIGHEST_HZ)
    (found,) = moving_samples([motion])
    assert found is not None
    left = motion.over_time(found.of(motion.torque_spectrum))
    assert np.abs(motion.over_time(motion.torque_spectrum)).max() > 1
    assert np.abs(left).max() < 0.015
