"""Orders found in a motor written down in closed form: sizes, standard errors, false alarms, ties."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from robid_core.estimation.distortion.order_analysis import KINDS, Kind, MotorData, Wave, motors_of
from robid_core.estimation.distortion.ripple_search import Found, Motor, find_ripple, gains, swept
from robid_core.estimation.distortion.ripple_significance import (
    Rows,
    chance_of_pair,
    covariance,
    stretch_sums,
)

N, STEP, N_EXP = 500, 0.004, 6
LINE, BINS = np.arange(9, 90, 4), np.arange(9, 90)
TIME, OMEGA = np.arange(N) * STEP, 2 * np.pi * np.fft.rfftfreq(N, STEP)
INERTIA, NOISE = 2e-3, 0.02
EVERY: tuple[Wave, ...] = tuple((kind, float(order)) for order in range(2, 21) for kind in KINDS)


def second_derivative(x: np.ndarray) -> np.ndarray:
    return np.asarray(np.fft.irfft(-(OMEGA**2) * np.fft.rfft(x, axis=-1), N, axis=-1))


def rigid_motor(
    seed: int,
    ripple: dict[Wave, tuple[float, float]],
    noise: float = NOISE,
    offset: float = 0.0,
    swing: float = 4.0,
) -> MotorData:
    """``J q'' = u + d``, u with white noise, p = q + e; sizes are (amplitude, phase) of a sine, swing in rad."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, (N_EXP, 1, len(LINE)))
    slow = swing * np.sin(2 * np.pi * 2 * TIME / (N * STEP) + rng.uniform(0, 2 * np.pi, (N_EXP, 1)))
    fast = np.sum(1.0 / LINE * np.cos(2 * np.pi * TIME[:, None] * LINE / (N * STEP) + phase), axis=-1)
    angle = offset + slow + fast
    measured, torque, share = angle.copy(), INERTIA * second_derivative(angle), np.zeros_like(angle)
    for (kind, order), (amplitude, start) in ripple.items():
        if kind == "resolver":
            measured += amplitude * np.sin(order * angle + start)
        elif kind == "cogging":
            torque -= amplitude * np.sin(order * angle + start)
        else:
            share += amplitude * np.sin(order * angle + start)
    torque = torque / (1 + share) + noise * rng.standard_normal(angle.shape)
    return motors_of(measured[:, None, :, None], torque[:, None, :, None], LINE, BINS, STEP, False)[0]


def by_wave(found: Found) -> dict[Wave, tuple[float, float, float]]:
    return {one.wave: (one.amplitude, one.phase, one.standard_error) for one in found.ripple}


def test_all_three_kinds_are_found_and_nothing_else() -> None:
    true = {("cogging", 4.0): (0.02, 0.5), ("current", 12.0): (0.05, -0.7), ("resolver", 5.0): (1e-3, 1.9)}
    found = find_ripple([rigid_motor(1, true)], EVERY)
    measured = by_wave(found)
    assert set(measured) == set(true)
    for wave, (amplitude, phase) in true.items():
        estimate, angle, error = measured[wave]
        assert abs(estimate - amplitude) < 4 * error < 0.4 * amplitude
        assert abs(angle - phase) < 4 * error / amplitude
    assert all(one.p_value < 1e-3 and one.chi_square > 30 for one in found.ripple)
    assert found.misfit > 1.05


def test_without_noise_the_sizes_are_exact() -> None:
    """To the products of two waves: 0.05 of the torque that the resolver's error makes is at other orders."""
    true = {("cogging", 4.0): (0.02, 0.5), ("current", 12.0): (0.05, -0.7), ("resolver", 5.0): (5e-5, 1.9)}
    measured = by_wave(find_ripple([rigid_motor(1, true, noise=0.0)], tuple(true)))
    for wave, (amplitude, phase) in true.items():
        assert measured[wave][:2] == pytest.approx((amplitude, phase), rel=0.1 * 0.05)


def test_the_standard_error_is_the_scatter_over_realisations() -> None:
    waves: tuple[Wave, ...] = (("cogging", 4.0), ("current", 12.0), ("resolver", 5.0))
    true = {waves[0]: (0.02, 0.5), waves[1]: (0.06, -0.7), waves[2]: (1e-3, 1.9)}
    runs = 60
    results = [
        by_wave(find_ripple([rigid_motor(seed, true)], waves, significance=0.5)) for seed in range(runs)
    ]
    for wave, (amplitude, _) in true.items():
        score = np.array([(r[wave][0] - amplitude) / r[wave][2] for r in results if wave in r])
        assert len(score) == runs
        # Mean and mean square of 60 standard normal numbers: deviations 0.13 and sqrt(2 / 60) = 0.18; four of each.
        # (Noise adds to the expectation of an amplitude half of its relative variance: below 0.1 here.)
        assert abs(score.mean()) < 4 * 0.13 + 0.1
        assert np.mean(score**2) == pytest.approx(1.0, abs=4 * 0.18)


def test_noise_alone_raises_alarms_as_often_as_stated() -> None:
    runs, significance = 80, 0.2
    alarms = sum(
        bool(find_ripple([rigid_motor(100 + seed, {})], EVERY, significance).ripple) for seed in range(runs)
    )
    # Bonferroni is an upper bound and, for 57 waves that are nearly orthogonal, close to it.
    assert alarms <= stats.binom.ppf(1 - 1e-4, runs, significance)
    assert alarms >= stats.binom.ppf(1e-4, runs, 0.25 * significance)


def test_an_order_between_the_candidates_is_fitted() -> None:
    true = {("cogging", 7.3): (0.03, 0.5)}
    grid: tuple[Wave, ...] = tuple(("cogging", 0.25 * step) for step in range(12, 61))
    (one,) = find_ripple([rigid_motor(3, true)], grid, refine=0.25).ripple
    # An order is a slope of phase over the angle, of standard deviation 2 rad or more: its error is at most that of
    # the phase, standard_error / amplitude, over 2 rad.
    assert abs(one.order - 7.3) < 4 * one.standard_error / one.amplitude / 2
    assert one.amplitude == pytest.approx(0.03, abs=4 * one.standard_error)
    exact = find_ripple([rigid_motor(3, true)], grid)
    assert len(exact.ripple) > 1  # a part of it at each neighbour


def test_configurations_a_hundred_turns_apart_share_a_whole_order() -> None:
    true = {("cogging", 4.0): (0.006, 0.5)}
    motors = [
        rigid_motor(seed, true, offset=offset) for seed, offset in enumerate((0.0, 640.3, -311.7, 150.0))
    ]
    (together,) = find_ripple(motors, EVERY).ripple
    assert together.wave == ("cogging", 4.0)
    alone = find_ripple(motors[:1], (("cogging", 4.0),), significance=0.999999).ripple[0]
    # Four times the data: half the standard error, which itself is known to some ten percent.
    assert together.standard_error == pytest.approx(0.5 * alone.standard_error, rel=0.35)
    assert together.amplitude == pytest.approx(0.006, abs=4 * together.standard_error)


def test_a_slow_wave_of_the_resolver_is_told_to_be_tied_with_current_ripple() -> None:
    """p'' - q'' is n e cos(n q) q'' where the wave is slow beside the lines: a share of the torque."""
    ripple = {("resolver", 2.0): (1.5e-3, 0.3)}
    (slow,) = find_ripple([rigid_motor(0, ripple, swing=0.5)], EVERY[:3]).ripple
    assert {slow.kind, *slow.ties} == {"resolver", "current"}
    # Passing many periods a turn, with four times the size: no longer.
    (fast,) = find_ripple([rigid_motor(0, {("resolver", 2.0): (6e-3, 0.3)})], EVERY[:3]).ripple
    assert (fast.kind, fast.ties) == ("resolver", ())


def test_sweeping_is_projecting() -> None:
    rng = np.random.default_rng(1)
    columns = rng.standard_normal((50, 9))
    gram = columns.T @ columns
    length = np.diag(gram)[:-1].reshape(-1, 2).sum(axis=1)
    beside = np.linalg.qr(columns[:, 2:4])[0]
    left = columns - beside @ (beside.T @ columns)
    np.testing.assert_allclose(swept(gram, 1), left.T @ left, atol=1e-12)
    explained = gains(swept(gram, 1), length)
    for pair in (0, 2, 3):
        residual = np.linalg.lstsq(left[:, 2 * pair : 2 * pair + 2], left[:, -1])[1]
        assert explained[pair] == pytest.approx(left[:, -1] @ left[:, -1] - residual[0], abs=1e-10)
    assert explained[1] == 0.0


def rows_of(rng: np.random.Generator, n_column: int, size: np.ndarray | None = None) -> Rows:
    """White noise, in time of the given size at each instant."""
    noise = rng.standard_normal((3, 200, 2)) @ np.array([1, 1j])
    target = noise if size is None else np.fft.fft(size * np.fft.ifft(noise, axis=1), axis=1)
    columns = rng.standard_normal((3, 200, n_column, 2)) @ np.array([1, 1j])
    if size is not None:
        columns = np.fft.fft(size[:, None] * np.fft.ifft(columns, axis=1), axis=1)
    return Rows(columns, target, 4.0)


def test_sums_over_stretches_add_up_to_the_gradient() -> None:
    rows = rows_of(np.random.default_rng(2), 3)
    gradient = np.einsum("ebc,eb->c", rows.columns.conj(), rows.target).real
    np.testing.assert_allclose(stretch_sums(rows, rows.target).sum(axis=0), gradient, atol=1e-10)


@pytest.mark.parametrize("bursts", [False, True])
def test_chance_is_uniform_where_there_is_nothing_even_if_noise_and_wave_come_in_bursts(bursts: bool) -> None:
    rng = np.random.default_rng(3)
    size = np.where(np.arange(200) % 50 < 10, 3.0, 0.3) if bursts else None
    chances = np.array([chance_of_pair(rows_of(rng, 4, size), 1) for _ in range(400)])
    assert stats.kstest(chances, "uniform").pvalue > 1e-4
    # The variance of a fit that believes in stationary noise is too small there; that of the stretches is not.
    scores = []
    for _ in range(200):
        rows = rows_of(rng, 2, size)
        estimate = rows.estimate()
        scores.append(estimate @ np.linalg.solve(covariance(rows, estimate), estimate))
    # Mean of 200 chi-squares of two degrees of freedom, deviation 2: five deviations of the mean. Few stretches add to
    # a Wald statistic, a factor of about 1 + 4 / n; of 48, a fifth count in bursts. A variance for stationary noise
    # would be too small by mean(size^4) / mean(size^2)^2 = 4.6, and the mean 9.
    factor = 1 + 4 / (48 * (0.2 if bursts else 1.0))
    assert np.mean(scores) == pytest.approx(2.0 * factor, abs=5 * 2 / np.sqrt(200))


def test_candidates_that_are_the_same_column_are_taken_once() -> None:
    motor = Motor(
        [rigid_motor(6, {("cogging", 4.0): (0.05, 0.1)})], (("cogging", 4.0), ("cogging", 4.0 + 1e-9))
    )
    assert len(find_ripple(motor.configurations, motor.candidates).ripple) == 1


def test_no_candidates_is_nothing_found() -> None:
    assert find_ripple([rigid_motor(7, {})], ()) == Found((), 1.0)


def test_kinds_are_the_three_that_the_package_knows() -> None:
    kinds: tuple[Kind, ...] = ("cogging", "current", "resolver")
    assert kinds == KINDS
