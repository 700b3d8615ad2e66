"""What friction and ripple put on which bins, against Fourier transforms of the signals themselves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import j0, jv

from robid_core.estimation.excitation import reach


def ripple_carriers(order: float, sine_angle: float, n_harmonic: int, kept: float = 1.0) -> np.ndarray:
    """Amplitudes of a ripple at the harmonics 1..n of the slow sine, relative to its own, shape (n_harmonic,).

    sin(n (c + a sin x)) has the harmonic ``2 J_k(n a) cos(n c) sin(k x)`` for odd k, and for even k ``2 J_k(n a)
    sin(n c) cos(k x)``. Given is ``2 |J_k(n a)|``: the pose c where it is largest.

    Parameters
    ----------
    order
        Periods per turn of the motor, n.
    sine_angle
        Amplitude a of the motor angle, rad: amplitude of the speed over the sine's angular frequency.
    n_harmonic
        Harmonics.
    kept
        What a multisine leaves of the carriers (`carrier_share`).
    """
    result = 2 * np.abs(kept * jv(np.arange(1, n_harmonic + 1), order * sine_angle))
    return result


def carrier_share(order: float, angle: np.ndarray) -> float:
    """What a random-phase multisine of angle leaves of the ripple's carriers: ``prod_l J_0(n a_l)``.

    `angle` holds the amplitudes a_l of the motor angle in rad, shape (n_freq,). For many small lines this is
    ``exp(-(n sigma)^2 / 2)``, sigma the root mean square of the angle.
    """
    return float(np.prod(j0(order * angle)))


def test_harmonics_of_an_even_sine_reach_no_odd_line() -> None:
    line = np.arange(5, 200, 2)
    assert len(reach.harmonics_on_lines(line, 2)) == 0
    assert reach.harmonics_on_lines(line, 3).tolist() == list(range(9, 200, 6))
    assert reach.harmonics_on_lines(line, 3, n_harmonic=9).tolist() == [9, 15, 21, 27]


def test_carriers_of_a_ripple_are_bessel_functions_exactly() -> None:
    order, angle, n, sine_bin = 12.0, 0.7, 1024, 2
    swing = angle * np.sin(2 * np.pi * sine_bin * np.arange(n) / n + 0.4)
    predicted = ripple_carriers(order, angle, 30)
    for pose, first in ((0.0, 0), (np.pi / (2 * order), 1)):  # largest odd, and largest even harmonics
        harmonics = np.abs(np.fft.rfft(np.sin(order * (pose + swing))))[sine_bin::sine_bin] * 2 / n
        # Harmonics above 512 / 2, whose Bessel functions are far below rounding, are all that folds back.
        assert harmonics[first:30:2] == pytest.approx(predicted[first::2], abs=1e-13)
        assert harmonics[1 - first : 30 : 2].max() < 1e-13
    # The carriers with which a multisine of 0.05 rad rms leaves it.
    kept = carrier_share(order, np.array([0.05 * np.sqrt(2)]))
    assert ripple_carriers(order, angle, 30, kept) == pytest.approx(abs(kept) * predicted)


def test_a_ripple_ends_where_order_times_speed_over_a_turn_ends() -> None:
    order, speed, period = 72.0, 9.0, 8.0
    sine_angle = speed * period / (2 * np.pi * 2)
    band = reach.ripple_band_hz(order, speed)
    assert band == pytest.approx(72 * 9 / 6.283185307)
    n = 8000
    level = reach.ripple_level(order, 2, sine_angle, np.zeros(0, dtype=np.int64), np.zeros(0), n)
    # Near the edge, J_k(z) = (2 / z)^(1/3) Ai(x) with k = z + x (z / 2)^(1/3) (Abramowitz and Stegun 9.3.23). With the
    # integral of Ai^2 above 0, Ai'(0)^2 = 0.0670, a share 2 (2 / z)^(1/3) 0.0670 of the power lies above the band.
    z = order * sine_angle
    above = np.arange(len(level)) > band * period
    assert np.sum(level[above] ** 2) == pytest.approx(2 * (2 / z) ** (1 / 3) * 0.0670, rel=0.1)
    # Eight widths further on Ai has fallen to 5e-8.
    beyond = np.arange(len(level)) > 2 * (z + 8 * (z / 2) ** (1 / 3))
    assert level[beyond].max() < 1e-6


def test_the_level_without_a_multisine_is_that_of_the_carriers() -> None:
    level = reach.ripple_level(6.0, 4, 0.9, np.zeros(0, dtype=np.int64), np.zeros(0), 512)
    # Root mean square over poses of 2 |J_k| |cos|.
    assert level[4:100:4] == pytest.approx(ripple_carriers(6.0, 0.9, 24) / np.sqrt(2), abs=1e-7)
    off = np.delete(level, np.arange(0, len(level), 4))
    # A power of 1e-16 from rounding is an amplitude of 1e-8.
    assert off.max() < 1e-7


def test_the_expected_level_is_the_mean_over_phases_and_poses() -> None:
    generator = np.random.default_rng(6)
    order, sine_bin, sine_angle, n = 12.0, 2, 0.5, 256
    line, angle = np.array([7, 11, 19, 23]), np.array([0.08, 0.03, 0.01, 0.05])
    level = reach.ripple_level(order, sine_bin, sine_angle, line, angle, n)
    draws = 4000
    time = 2 * np.pi * np.arange(n) / n
    bins, size = np.append(line, sine_bin), np.append(angle, sine_angle)
    phase = generator.uniform(0, 2 * np.pi, (draws, 5, 1))
    swing = np.einsum("k,dkn->dn", size, np.cos(bins[:, None] * time + phase))
    pose = generator.uniform(0, 2 * np.pi, (draws, 1))
    power = np.abs(np.fft.rfft(np.sin(order * swing + pose), axis=1) / n) ** 2 * 4
    # The mean of 4000 draws within five of its standard errors, at 129 bins.
    error = power.std(axis=0, ddof=1) / np.sqrt(draws)
    assert (np.abs(power.mean(axis=0) - level**2) < 5 * error + 1e-14).all()
    # All of the ripple's power, 1/2, is somewhere: half a square of each amplitude, mean and last bin once.
    total = 0.5 * np.sum(level[1:-1] ** 2) + 0.25 * (level[0] ** 2 + level[-1] ** 2)
    assert total == pytest.approx(0.5, abs=1e-12)


def test_an_odd_number_of_samples_is_a_period_too() -> None:
    line, angle = np.array([3, 5]), np.array([0.2, 0.1])
    even, odd = (reach.ripple_level(3.0, 2, 0.5, line, angle, n) for n in (256, 255))
    # Far below half the sampling rate both are the same continuous signal.
    assert odd[:60] == pytest.approx(even[:60], abs=1e-7)


def test_a_multisine_takes_from_the_carriers_as_a_gaussian_does() -> None:
    angle = np.full(200, 0.006)
    sigma = np.sqrt(np.sum(angle**2) / 2)
    share = carrier_share(12.0, angle)
    # log J_0(x) = - x^2 / 4 - x^4 / 64 - ...; the first terms make the Gaussian, the second 200 (0.072)^4 / 64 = 8e-5.
    assert share == pytest.approx(np.exp(-((12.0 * sigma) ** 2) / 2), rel=2e-4)
    assert share < 0.78


def test_lines_are_reached_where_the_level_is_above() -> None:
    amplitude = np.array([9.0, 0.2, 0.0, 0.05, 9.0, 0.3])
    assert reach.lines_reached(np.array([1, 3, 5]), amplitude, 0.1).tolist() == [1, 5]
