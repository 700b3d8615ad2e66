"""Transients found at the stated rate of false alarms, and measurements that do not repeat."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from robid_core.errors import DataRejected
from robid_core.estimation.response import steady_state as ss


def spectra(generator: np.random.Generator, n_period: int, noise: Any = 1.0) -> Any:
    """Two channels of periodic spectra in noise, (n_config, n_block, n_freq, n_axis, n_exp, n_period)."""
    shape = (1, 2, 12, 2, 2)
    signal = 10 * (generator.standard_normal((2, *shape)) + 1j * generator.standard_normal((2, *shape)))
    added = generator.standard_normal((2, *shape, n_period)) + 1j * generator.standard_normal(
        (2, *shape, n_period)
    )
    return list(signal[..., None] + noise * added)


@pytest.mark.parametrize("n_period", [3, 5])
def test_a_record_in_steady_state_loses_a_period_at_most_as_often_as_stated(n_period: int) -> None:
    # Noise of very different size over lines and axes, as position noise in acceleration is. Four tests of an
    # axis and channel each are independent here, so that Bonferroni's bound is nearly reached: 1 - (1 - 0.1 / 4)^4
    # = 0.096 with three periods. Bounds of chance at odds of 1e-5.
    generator = np.random.default_rng(n_period)
    noise = np.geomspace(1e-3, 1, 12)[:, None, None, None] * np.array([1.0, 30.0])[:, None, None]
    trials, level = 600, 0.1
    lost = sum(bool(ss.transient_periods(spectra(generator, n_period, noise), level)) for _ in range(trials))
    low, high = stats.binom.ppf([1e-5, 1 - 1e-5], trials, [0.05, level])
    assert low <= lost <= high


def test_a_decaying_transient_is_cut_and_no_more() -> None:
    # Leakage of exp(-t / tau) at line k is proportional to 1 / (1 / tau + i w_k): largest at low frequency, and
    # smaller by a constant factor in each period. Factor 30 and 8 times the noise at first: gone after two periods.
    generator = np.random.default_rng(7)
    leak = 8 * 3 / (1 + 0.5j * np.arange(12))
    decay = 30.0 ** -np.arange(6.0)
    cut = []
    for _ in range(20):
        u, q = spectra(generator, 6)
        q = q + leak[:, None, None, None] * decay * np.array([0.0, 1.0])[:, None, None]
        cut.append(ss.transient_periods([u, q]))
    # The second period holds 0.8 times the standard deviation of the noise at one line: seen or not.
    assert set(cut) <= {1, 2}
    assert cut.count(1) > 10


def test_a_transient_without_noise_is_cut_where_it_matters() -> None:
    generator = np.random.default_rng(8)
    u, q = spectra(generator, 6, noise=0.0)
    assert ss.transient_periods([u, q]) == 0
    # 1e-3 of the motion, a hundredth of it in each period: below a millionth from the third on.
    q = q + 1e-2 * 0.01 ** np.arange(6.0)
    assert ss.transient_periods([u, q]) == 2


def test_two_periods_cannot_tell() -> None:
    generator = np.random.default_rng(9)
    assert ss.transient_periods(spectra(generator, 2)) is None
    assert ss.transient_periods(spectra(generator, 1)) is None


def test_a_reference_that_does_not_repeat_is_named() -> None:
    time = np.arange(100) / 100
    period = np.sin(2 * np.pi * 3 * time)[:, None] * np.ones(2)
    reference = np.broadcast_to(period, (1, 2, 1, 3, 100, 2)).copy()
    ss.refuse_other_reference(reference, ("a", "b"))
    ss.refuse_other_reference(reference.astype(np.float32).astype(float), ("a", "b"))  # a logger's rounding
    reference[0, 1, 0, 1, :, 1] *= -1  # half a period of odd lines
    with pytest.raises(DataRejected, match=r"of b in period 2 .* by 200 % \(configuration 1, block 2"):
        ss.refuse_other_reference(reference, ("a", "b"))


def test_halves_of_a_period_are_refused_by_the_torque() -> None:
    u, _ = spectra(np.random.default_rng(1), 4)
    ss.refuse_unlike_periods(u)
    ss.refuse_unlike_periods(u[..., :1])
    with pytest.raises(DataRejected, match="configuration 1: the torque .* a half perhaps"):
        ss.refuse_unlike_periods(u * (-1) ** np.arange(4))


def drift_leakage(position: np.ndarray, line: np.ndarray) -> np.ndarray:
    """How much a drift of the position disturbs the lines: largest ratio of its leakage to what is there.

    A motor angle that gains D in each period is a periodic one plus a ramp, and the ramp has the spectrum
    ``D / (2 pi k)`` at bin k (DFT scaled by 1 / n_sample), the same in every period: the differences between
    periods do not show it. Lines where it stays below the noise, which these differences do show, count zero.

    Takes the position, (n_block, n_exp, n_period, n_sample, n_axis), with two periods or more; returns (n_axis,).
    """
    n_period, n_sample, n_axis = position.shape[-3:]
    periods = position.reshape(-1, n_period, n_sample, n_axis)
    gain = (periods[:, -1] - periods[:, 0]).mean(axis=1) / (n_period - 1)
    leakage = np.sqrt(np.mean(gain**2, axis=0)) / (2 * np.pi * line[:, None])
    spectrum = np.fft.rfft(periods, axis=2)[:, :, line] / n_sample
    size = np.sqrt(np.mean(np.abs(spectrum.mean(axis=1)) ** 2, axis=0))
    noise = np.sqrt(np.mean(spectrum.var(axis=1, ddof=1), axis=0) / n_period)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio: np.ndarray = np.where(leakage > noise, leakage / size, 0.0).max(axis=0)
    return ratio


def test_drift_is_told_as_from_the_samples() -> None:
    generator = np.random.default_rng(2)
    n_sample, line = 200, np.arange(3, 30, 2)
    coefficient = np.zeros((2, 3, 1, n_sample // 2 + 1, 2), dtype=complex)
    coefficient[..., line, :] = generator.standard_normal((2, 3, 1, len(line), 2))
    period = np.fft.irfft(coefficient, n_sample, axis=-2) * n_sample
    motion = np.broadcast_to(period, (2, 3, 4, n_sample, 2)) + 1e-3 * generator.standard_normal(
        (2, 3, 4, n_sample, 2)
    )
    motion[..., 1] += 2e-4 * np.arange(4 * n_sample).reshape(4, n_sample)
    position = motion[None]  # (n_config, n_block, n_exp, n_period, n_sample, n_axis)
    transform = np.fft.rfft(position, axis=4)[:, :, :, :, line] / n_sample
    # The transform of a ramp is 1 / (2 n sin(pi k / n)), and x / sin(x) below 1 + x^2 / 5 up to x = 0.5.
    ramp = np.abs(np.fft.rfft(np.arange(n_sample) / n_sample)[line]) / n_sample
    assert (np.abs(ramp * 2 * np.pi * line - 1) < (np.pi * line / n_sample) ** 2 / 5).all()
    share = ss.drift_share(
        position.mean(axis=4), np.moveaxis(transform, (2, 3), (-2, -1)), line.astype(float)
    )
    assert share[0] == pytest.approx(drift_leakage(motion, line), rel=1e-6)
    assert share[0, 1] > 1e-3 > share[0, 0]
