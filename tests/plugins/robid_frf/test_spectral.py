"""frf.spectral on recordings of a sampled linear plant, periodic and not, simulated in the time domain."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy import signal

from robid_core import (
    Channel,
    ConfigurationError,
    Context,
    DataRejected,
    DenseRun,
    Frf,
    PoorExcitation,
    Record,
)
from robid_core.estimation.response.covariance import confidence_radius
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_core.testing.plants import MassSpringPlant, plant_record
from robid_frf.spectral import Spectral

STEP = 0.002


def context() -> Context:
    log = logging.getLogger("test.spectral")
    return Context(np.random.default_rng(0), map_in_process, lambda done, total, note="": None, log)


def plant(n: int) -> tuple[Any, Any, Any]:
    """Masses that hang together by well damped springs, sampled exactly under torque that is held: (a, b, c)."""
    spring = 4e3 * (np.eye(n) - 0.3 * np.eye(n, k=1) - 0.3 * np.eye(n, k=-1))
    zero, one = np.zeros((n, n)), np.eye(n)
    a = np.block([[zero, one], [-spring, -0.006 * spring]])
    b = np.vstack([zero, one + 0.3 * np.eye(n, k=-1)])
    sampled = signal.cont2discrete((a, b, np.hstack([one, zero]), np.zeros((n, n))), STEP)
    return sampled[0], sampled[1], sampled[2]


def response(n: int, frequency_hz: Any) -> Any:
    """(i w)^2 times the sampled position response."""
    a, b, c = plant(n)
    z = np.exp(2j * np.pi * frequency_hz * STEP)[:, None, None]
    return (2j * np.pi * frequency_hz[:, None, None]) ** 2 * (
        c @ np.linalg.solve(z * np.eye(2 * n) - a, b[None])
    )


def smoothed(n: int, frequency_hz: Any, segment_s: float) -> Any:
    """What Hann's window makes of the response under white torque: its mean over |W|^2, W the window's transform.

    W is 1 / (1 - x^2) sinc x, x in bins; with the curvature, G + G'' / (6 segment_s^2).
    """
    x = np.linspace(-8, 8, 1601) + 1e-6
    weight = (np.sinc(x) / (1 - x**2)) ** 2
    spread = np.stack([response(n, frequency_hz + offset / segment_s) for offset in x])
    return np.tensordot(weight / weight.sum(), spread, 1)


def motion(torque: Any) -> Any:
    """Position under a torque (..., n_sample, n_axis), from rest; mode by mode, each a filter of first order."""
    a, b, c = plant(torque.shape[-1])
    value, vector = np.linalg.eig(a)
    forced = torque @ (np.linalg.inv(vector) @ b).T
    modes = np.stack(
        [signal.lfilter([0, 1], [1, -value[i]], forced[..., i], axis=-1) for i in range(len(value))], axis=-1
    )
    return (modes @ (c @ vector).T).real


def record(torque: Any, position: Any, line: Any = None, reference: Any = None, valid: Any = None) -> Record:
    """Channels of shape (n_config, n_block, n_exp, n_period, n_sample, n_axis)."""
    channels = {
        "motor_torque": Channel("motor", "N m", torque),
        "motor_position": Channel("motor", "rad", position),
    }
    if reference is not None:
        channels["speed_reference"] = Channel("motor", "rad/s", reference)
    n_axis = torque.shape[-1]
    valid = np.ones(torque.shape[:-1], dtype=bool) if valid is None else valid
    run = DenseRun(STEP, channels, np.arange(torque.shape[-2]) * STEP, valid)
    names = tuple(f"axis_{k + 1}" for k in range(n_axis))
    return Record(
        names,
        "test",
        "zero_order_hold",
        (run,),
        np.zeros((len(torque), n_axis)),
        None if line is None else line,
    )


def noisy(n: int, n_config: int, n_sample: int, noise: float, seed: int, unmeasured: float = 0.0) -> Record:
    """White torque in every configuration, white noise on the position, and white torque that is not measured."""
    generator = np.random.default_rng(seed)
    torque = generator.standard_normal((n_config, 1, 1, 1, n_sample, n))
    position = motion(torque + unmeasured * generator.standard_normal(torque.shape))
    return record(torque, position + noise * generator.standard_normal(torque.shape))


def estimate(recording: Record, **given: Any) -> Frf:
    return Spectral(**given).run(recording, context())


def test_spectral_keeps_the_contract() -> None:
    check_stage(Spectral, for_axes=(1, 2))


def test_whole_periods_give_the_plant_at_the_lines() -> None:
    recording = plant_record(MassSpringPlant.of(2), n_block=3)
    frf = estimate(recording, approach="instrument")
    # Exact signals: rounding 1e-16 in position, 1e4 times that in the weakest entry (`robid_core.testing.estimators`).
    truth = MassSpringPlant.of(2).response(frf.frequency_hz)
    assert np.abs(frf.response - truth).max() < 1e-8 * np.abs(truth).max()
    assert frf.covers == Frf.OWN_MEAN


def test_the_joint_approach_gives_the_plant_in_closed_loop_and_says_what_it_covers() -> None:
    record = plant_record(MassSpringPlant.of(2), n_block=4, noise=0.02)
    joint, both = (
        estimate(record, approach="jio"),
        estimate(record, approach="instrument", instruments=("reference", "other_period")),
    )
    truth = MassSpringPlant.of(2).response(joint.frequency_hz)
    assert joint.covers == Frf.BEST_LINEAR_APPROXIMATION
    assert both.covers == Frf.OWN_MEAN
    for frf in (joint, both):
        radius = confidence_radius(frf.variance(), frf.degrees_of_freedom[..., None, None])
        # 240 entries, some four together: 95 +- 4 %.
        assert np.mean(np.abs(frf.response - truth) <= radius) > 0.87
    # A noise as large as the signal: the reference is not heard, and nothing is claimed.
    deaf = estimate(plant_record(MassSpringPlant.of(2), noise=5.0), approach="jio", condition_limit=1e9)
    assert deaf.covers == Frf.OWN_MEAN


def test_instruments_that_agree_without_noise_count_once() -> None:
    record = plant_record(MassSpringPlant.of(2))
    frf = estimate(record, approach="instrument", instruments=("reference", "other_period"))
    truth = MassSpringPlant.of(2).response(frf.frequency_hz)
    assert np.abs(frf.response - truth).max() < 1e-8 * np.abs(truth).max()


def test_noise_on_the_measured_torque_pulls_the_direct_response_down_and_other_periods_do_not() -> None:
    # One axis, one spectrum: Welch's direct form tends to G S / (S + s): each period's noise counts. 40 lines of 8
    # experiments x 4 periods, mean over lines: noise of |G| sqrt(s / S / (40 * 32)) = 0.014 |G|; four of that.
    generator = np.random.default_rng(1)
    n_sample, n_period, n_exp, line = 500, 4, 8, np.arange(11, 91, 2)
    spectrum = np.zeros((1, 1, n_exp, 1, n_sample // 2 + 1, 1), dtype=complex)
    spectrum[..., line, :] = np.exp(2j * np.pi * generator.uniform(size=(1, 1, n_exp, 1, len(line), 1)))
    torque = np.tile(np.fft.irfft(spectrum * n_sample, axis=-2), (1, 1, 1, n_period + 1, 1, 1))
    position = motion(torque.reshape(n_exp, -1, 1)).reshape(torque.shape)
    size = np.sqrt(n_sample * 0.25)  # in torque; a bin gets 0.25 of it, S = 1
    measured = torque + size * generator.standard_normal(torque.shape)
    recording = record(measured[:, :, :, 1:], position[:, :, :, 1:], line)
    truth = response(1, line / (n_sample * STEP))
    for approach, expected in (("direct", 1 / 1.25), ("instrument", 1.0)):
        frf = estimate(recording, approach=approach)
        assert np.mean(frf.response[0] / truth).real == pytest.approx(expected, abs=0.06)


def test_one_long_experiment_of_noise_gives_the_response_of_two_axes_smoothed_by_the_window() -> None:
    frf = estimate(noisy(2, 1, 30000, 1e-6, 2), segment_s=1.0, band_hz=(3, 40))
    assert frf.response.shape == (1, 38, 2, 2)
    mean = smoothed(2, frf.frequency_hz, 1.0)
    error = np.abs(frf.response[0] - mean)
    # 152 entries: one in 1e4 may be outside; and 2e-3 of the largest for the parts of |W|^2 beyond eight bins.
    allowed = confidence_radius(frf.variance()[0], frf.degrees_of_freedom[0][:, None, None], 0.9999)
    assert (error < allowed + 2e-3 * np.abs(mean).max()).all()
    assert np.median(error) < 0.02 * np.abs(mean).max()


def test_a_chirp_gives_the_response_of_one_axis() -> None:
    n_sample = 10000
    t = np.arange(n_sample) * STEP
    chirp = signal.chirp(t, 1.0, t[-1], 60.0) * np.minimum(1, np.minimum(t, t[-1] - t))
    torque = chirp[None, None, None, None, :, None]
    frf = estimate(record(torque, motion(torque)), segment_s=2.0, overlap=0.75, band_hz=(6, 50))
    truth = response(1, frf.frequency_hz)
    # No noise: smoothing by G'' / 24 at 2 s, |G''| = 2 |G| / (zeta f)^2 with zeta 0.19 and 10 Hz, so 2.3 % of the peak,
    # and leakage of the same kind while the chirp passes; twice that in all.
    assert np.abs(frf.response[0] - truth).max() < 0.046 * np.abs(truth).max()


@pytest.mark.parametrize(
    "given, noise, unmeasured, n_sample",
    [
        ({}, 3e-4, 0.0, 3000),
        ({}, 3e-3, 0.0, 750),
        ({}, 0.0, 0.3, 1000),
        ({"lines": 10}, 3e-4, 0.0, 3000),
        ({"window": "rectangular", "overlap": 0.0}, 0.0, 1.0, 3000),
    ],
    ids=["bins", "few", "few_torque", "bands", "rectangular"],
)
def test_regions_of_windowed_segments_cover_the_estimators_own_mean(
    given: dict[str, Any], noise: float, unmeasured: float, n_sample: int
) -> None:
    # 120 configurations with noise of their own, every fourth line (none in Hann's reach of another) or every second
    # band, and one entry a line. Their own mean stands for the expectation: its error takes 1 / 120 off the variance.
    # At least 5 lines x 120: binomial standard deviation 0.9 %, and 1.5 % for the approximations: leakage is not quite
    # noise. (Without Hann's window there is much of it, which cancels between neighbouring segments: the regions come
    # out too wide, unless something larger is in the way that does not leak, a torque that was not measured.)
    frf = estimate(noisy(2, 120, n_sample, noise, 3, unmeasured), segment_s=0.5, band_hz=(4, 60), **given)
    assert frf.has_covariance
    assert frf.covers == Frf.OWN_MEAN
    error = np.abs(frf.response - frf.response.mean(axis=0))
    radius = confidence_radius(frf.variance(), frf.degrees_of_freedom[..., None, None])
    lines = np.arange(1, frf.response.shape[1], 2 if "lines" in given else 4)
    assert len(lines) >= 5
    inside = [(error <= radius)[:, k, i % 2, (i // 2) % 2] for i, k in enumerate(lines)]
    assert abs(np.mean(inside) - 0.95) < 3 * 0.009 + 0.015
    # Estimates of a variance with nu degrees of freedom scatter by 1 / nu of their square. From 120 configurations each
    # is good to 13 %, their median over lines and axes to less; 30 % for what leakage and pooling add.
    level = np.einsum("cfii->cfi", frf.output_covariance).real[:, lines]
    ratio = (
        level.var(axis=0) / level.mean(axis=0) ** 2 * frf.degrees_of_freedom[:, lines].mean(axis=0)[:, None]
    )
    assert np.median(ratio) == pytest.approx(1.0, abs=0.3)


def test_one_periodic_experiment_in_segments_separates_two_axes() -> None:
    # A dense multisine of 20 s with 20 lines in the width of a segment's bin: neighbouring lines stand for the
    # experiments that were not made. Steady state, so segments may go round.
    generator = np.random.default_rng(5)
    n_sample = 10000
    line = np.arange(61, 900)
    spectrum = np.zeros((1, 1, 1, 1, n_sample // 2 + 1, 2), dtype=complex)
    spectrum[..., line, :] = np.exp(2j * np.pi * generator.uniform(size=(len(line), 2)))
    period = np.fft.irfft(spectrum * n_sample, axis=-2)
    torque = np.tile(period, (1, 1, 1, 3, 1, 1))
    position = motion(torque.reshape(1, -1, 2)).reshape(torque.shape)
    position = position + 1e-7 * generator.standard_normal(position.shape)
    recording = record(torque[:, :, :, 1:], position[:, :, :, 1:], line)
    frf = estimate(recording, segment_s=1.0, band_hz=(5, 40))
    mean = smoothed(2, frf.frequency_hz, 1.0)
    error = np.abs(frf.response[0] - mean)
    allowed = confidence_radius(frf.variance()[0], frf.degrees_of_freedom[0][:, None, None], 0.9999)
    assert (error < allowed + 2e-3 * np.abs(mean).max()).all()
    assert frf.noise_covariance is not None
    # The noise of the acceleration, w^4 s^2 sum(h^2) / sum(h)^2 / 2 periods; estimated with some 35 degrees of freedom,
    # the mean over lines and axes within 20 %.
    omega, hann = 2 * np.pi * frf.frequency_hz, 1.5 / (1.0 / STEP)
    noise = np.einsum("fii->fi", frf.noise_covariance[0]).real / (omega**4 * 1e-14 * hann / 2)[:, None]
    assert noise.mean() == pytest.approx(1.0, abs=0.2)


def test_a_steady_drift_of_the_position_changes_nothing() -> None:
    recording = noisy(1, 1, 6000, 1e-6, 7)
    run = recording.run
    drifting = run.values("motor_position") + 3.0 * run.time_s[:, None] + 10.0
    moved = record(run.values("motor_torque"), drifting)
    a, b = (estimate(one, segment_s=1.0, band_hz=(3, 40)).response for one in (recording, moved))
    # Rounding of 20 rad, differenced: 1e-15 * 20 / STEP^2 = 1e-8 rad/s^2 white, against acceleration of size 1.
    np.testing.assert_allclose(a, b, atol=1e-7 * np.abs(a).max())


def test_a_drift_from_period_to_period_changes_nothing() -> None:
    generator = np.random.default_rng(23)
    n_sample, n_period, line = 2000, 3, np.arange(13, 300)
    spectrum = np.zeros((1, 1, 1, 1, n_sample // 2 + 1, 1), dtype=complex)
    spectrum[..., line, :] = np.exp(2j * np.pi * generator.uniform(size=(len(line), 1)))
    torque = np.tile(np.fft.irfft(spectrum * n_sample, axis=-2), (1, 1, 1, n_period + 1, 1, 1))
    position = motion(torque.reshape(1, -1, 1)).reshape(torque.shape)[:, :, :, 1:]
    time = (np.arange(n_period * n_sample) * STEP).reshape(n_period, n_sample, 1)
    given: dict[str, Any] = {"segment_s": 0.5, "band_hz": (5, 60)}
    still, drifting = (
        estimate(record(torque[:, :, :, 1:], position + rate * time, line), **given) for rate in (0.0, 0.5)
    )
    # A ramp of 2 rad a period against a motion of 1e-3: what the estimate of its slope leaves, rounding only.
    np.testing.assert_allclose(drifting.response, still.response, atol=1e-6 * np.abs(still.response).max())


def feedback(n_exp: int, noise: float, seed: int) -> Record:
    """One axis in a loop: torque = reference - 40 x position as it is measured, noise and all."""
    generator = np.random.default_rng(seed)
    a, b, c = plant(1)
    closed = a - 4000 * b @ c
    n_sample = 15000
    reference, v = generator.standard_normal((2, 1, 1, n_exp, 1, n_sample, 1))
    v = noise * v
    value, vector = np.linalg.eig(closed)
    forced = (reference - 4000 * v) @ (np.linalg.inv(vector) @ b).T
    modes = np.stack([signal.lfilter([0, 1], [1, -value[i]], forced[..., i]) for i in range(2)], axis=-1)
    position = (modes @ (c @ vector).T).real + v
    return record(reference - 4000 * position, position, reference=reference)


def test_feedback_biases_the_direct_approach_as_it_must_and_not_the_joint_one() -> None:
    # Position response P, torque = r - K y: direct limit (P S_r - K S_v) / (S_r + K^2 S_v), here S_r = 1 and
    # S_v = noise^2; the same for the smoothed P, the rest being white. Stated regions tell how near each comes.
    noise = 3e-4
    recording = feedback(8, noise, 11)
    given: dict[str, Any] = {"segment_s": 1.0, "band_hz": (4, 40)}
    direct, joint = estimate(recording, **given), estimate(recording, approach="jio", **given)
    frequency = direct.frequency_hz
    square = -((2 * np.pi * frequency) ** 2)
    truth, smooth = response(1, frequency)[:, 0, 0], smoothed(1, frequency, 1.0)[:, 0, 0]
    limit = square * (smooth / square - 4000 * noise**2) / (1 + 4000**2 * noise**2)

    def outside(frf: Frf, expected: Any) -> Any:
        radius = confidence_radius(frf.variance()[0, :, 0, 0], frf.degrees_of_freedom[0])
        return np.mean(np.abs(frf.response[0, :, 0, 0] - expected) > radius)

    # 37 lines at 95 %, about half of them independent: a fifth outside has a chance below 1e-3.
    assert outside(direct, limit) < 0.2
    assert outside(direct, truth) > 0.8
    assert outside(joint, smooth) < 0.2


def test_segments_with_missing_samples_are_left_out() -> None:
    recording = noisy(1, 1, 10000, 1e-6, 13)
    run = recording.run
    valid = np.ones(run.valid.shape, dtype=bool)
    valid[..., 2000:2100] = False
    torque = run.values("motor_torque").copy()
    torque[..., 2000:2100, :] = np.nan
    holed = record(torque, run.values("motor_position"), valid=valid)
    frf = estimate(holed, segment_s=1.0, band_hz=(4, 40))
    whole = estimate(recording, segment_s=1.0, band_hz=(4, 40))
    # No noise: what remains is Hann's smoothing and the leakage of 16 segments.
    smooth = smoothed(1, frf.frequency_hz, 1.0)
    assert np.abs(frf.response[0] - smooth).max() < 0.05 * np.abs(smooth).max()
    assert (frf.degrees_of_freedom < whole.degrees_of_freedom).all()
    valid[..., 2000:2001] = True
    with pytest.raises(DataRejected, match=r"motor_torque of axis_1 is NaN .* period 1, at 4\.0000 s"):
        estimate(record(torque, run.values("motor_position"), valid=valid), segment_s=1.0, band_hz=(4, 40))


def test_what_a_record_cannot_give_is_refused() -> None:
    recording = noisy(2, 1, 3000, 0.0, 17)
    with pytest.raises(ConfigurationError, match="segment_s: the record of 6 s has no excited lines"):
        estimate(recording)
    with pytest.raises(ConfigurationError, match="band_hz: the record has no excited lines"):
        estimate(recording, segment_s=1.0)
    with pytest.raises(DataRejected, match="A06: .* joint input-output"):
        estimate(recording, approach="jio", segment_s=1.0, band_hz=(4, 40))
    with pytest.raises(DataRejected, match="1 period is kept and other_period needs two"):
        estimate(recording, approach="instrument", segment_s=1.0, band_hz=(4, 40))
    with pytest.raises(
        PoorExcitation, match="configuration 1: 1 independent segments .* cannot separate 2 axes"
    ):
        estimate(recording, segment_s=5.0, band_hz=(4, 40))
    with pytest.raises(ValidationError, match="set segment_s too"):
        Spectral(lines=10)
    with pytest.raises(ValidationError, match="give one of them"):
        Spectral(segment_s=1.0, lines=10, frequency_hz=(4.0, 5.0))


def test_an_axis_that_did_not_move_by_itself_is_refused() -> None:
    recording = noisy(2, 1, 6000, 1e-6, 19)
    torque = recording.run.values("motor_torque").copy()
    torque[..., 1] = 2.0 * torque[..., 0]
    with pytest.raises(PoorExcitation, match="inputs do not span all axes"):
        estimate(record(torque, recording.run.values("motor_position")), segment_s=0.5, band_hz=(4, 40))
