"""frf.h1 and frf.log on synthetic recordings with a plant known in closed form."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import stats

from robid_core import (
    Channel,
    Context,
    DataRejected,
    DenseRun,
    FloatArray,
    Frf,
    PluginError,
    PoorExcitation,
    Record,
)
from robid_core.estimation.excitation.multisine import logarithmic_odd_lines, multisine, sine
from robid_core.estimation.response.covariance import confidence_radius
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_frf.h1 import H1
from robid_frf.logarithmic import LogarithmicMean

PERIOD_S, N_SAMPLE = 2.0, 400
ESTIMATORS = [H1(), LogarithmicMean(), LogarithmicMean(form="element")]


def context() -> Context:
    log = logging.getLogger("test.frf")
    return Context(np.random.default_rng(0), map_in_process, lambda done, total, note="": None, log)


def plant(n: int, frequency_hz: FloatArray) -> Any:
    """Symmetric response with entries of both signs: (i w)^2 (K + i w D - w^2 M)^-1 of two coupled chains."""
    root = np.random.default_rng(n).standard_normal((n, n))
    arm = 2 * np.eye(n) + 0.5 * root @ root.T / n + 0.8 * (np.eye(n, k=1) + np.eye(n, k=-1))
    stiffness, zero = np.diag(np.linspace(2e3, 4e4, n)), np.zeros((n, n))
    mass = np.block([[np.diag(np.linspace(1.0, 0.5, n)), zero], [zero, arm]])
    spring = np.block([[stiffness, -stiffness], [-stiffness, stiffness]])
    s = 2j * np.pi * frequency_hz[:, None, None]
    return (s**2 * np.linalg.inv(s**2 * mass + (1 + 2e-3 * s) * spring))[:, :n, :n]


def recording(
    n: int = 2,
    n_config: int = 1,
    n_block: int = 2,
    n_exp: int | None = None,
    n_period: int = 2,
    count: int = 30,
    position_noise: float = 0.0,
    torque_noise: float = 0.0,
    seed: int = 0,
) -> Any:
    """A record of periodic experiments on the plant, torque multisines plus a slow sine on bin 2."""
    generator = np.random.default_rng(seed)
    n_exp = n if n_exp is None else n_exp
    line = logarithmic_odd_lines((4.0, 80.0), count, PERIOD_S)
    response = plant(n, line / PERIOD_S)
    torque = np.zeros((n_config, n_block, n_exp, N_SAMPLE, n))
    amplitude = np.full((count, n), 0.5)
    for c in range(n_config):
        for m in range(n_block):
            for first in range(0, n_exp, n):
                phase, own = generator.uniform(0, 2 * np.pi, (2, count, n))
                block = multisine(amplitude, phase, own, line, N_SAMPLE)
                torque[c, m, first : first + n] = block[: n_exp - first]
    spectrum = np.fft.rfft(torque, axis=3)
    position_spectrum = np.zeros_like(spectrum)
    omega = 2 * np.pi * line / PERIOD_S
    position_spectrum[:, :, :, line] = np.einsum("kij,cmekj->cmeki", response, spectrum[:, :, :, line])
    position_spectrum[:, :, :, line] /= -(omega[:, None] ** 2)
    position = np.fft.irfft(position_spectrum, n=N_SAMPLE, axis=3)
    position = position + sine(np.linspace(2.0, 1.0, n), np.full(n, 0.3), 2, N_SAMPLE)
    repeat = (n_config, n_block, n_exp, n_period, N_SAMPLE, n)
    position = np.broadcast_to(position[:, :, :, None], repeat)
    torque = np.broadcast_to(torque[:, :, :, None], repeat)
    channels = {
        "motor_position": position + position_noise * generator.standard_normal(repeat),
        "motor_torque": torque + torque_noise * generator.standard_normal(repeat),
    }
    step = PERIOD_S / N_SAMPLE
    run = DenseRun(
        sample_time_s=step,
        channels={
            k: Channel("motor", {"motor_position": "rad", "motor_torque": "N m"}[k], v)
            for k, v in channels.items()
        },
        time_s=np.arange(N_SAMPLE) * np.float64(step),
        valid=np.ones(repeat[:-1], dtype=bool),
    )
    names = tuple(f"axis_{a + 1}" for a in range(n))
    record = Record(names, "synthetic", "zero_order_hold", (run,), np.zeros((n_config, n)), line)
    return record, response


def changed(record: Any, channel: str, change: Callable[[FloatArray], None]) -> Any:
    """The same record with one channel's values changed in place by `change`."""
    values = record.run.values(channel).copy()
    change(values)
    old = record.run.channels[channel]
    channels = {**record.run.channels, channel: Channel(old.side, old.unit_symbol, values)}
    return record.replace(runs=(record.run.replace(channels=channels),))


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=["h1", "log", "log-element"])
@pytest.mark.parametrize("n", [1, 2, 6])
def test_known_plant_is_recovered(estimator: Any, n: int) -> None:
    record, truth = recording(n=n, n_config=2)
    frf: Any = estimator.run(record, context())
    size = np.abs(truth).max(axis=(-2, -1), keepdims=True)
    assert (np.abs(frf.response - truth) / size).max() < 1e-10
    assert frf.valid.all()
    assert frf.block_response.shape == (2, 2, 30, n, n)
    assert frf.torque_hold == "zero_order_hold"
    for i in range(2):
        np.linalg.cholesky(frf.covariance(i))


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=["h1", "log", "log-element"])
def test_stated_uncertainty_covers_the_truth_with_two_blocks_of_six_axes(estimator: Any) -> None:
    # Every configuration is a trial; noise on both channels. Bounds of chance at odds of one to a million.
    trials = 160
    record, truth = recording(n=6, n_config=trials, count=12, position_noise=2e-6, torque_noise=2e-4, seed=1)
    frf: Any = estimator.run(record, context())
    assert np.unique(frf.degrees_of_freedom).tolist() == [30]  # 6 to spare a line, five lines
    error = np.abs(frf.response - truth)
    assert np.median(error / np.abs(truth)) < 0.02
    covered = (error <= confidence_radius(frf.variance(), frf.degrees_of_freedom[..., None, None])).mean(
        axis=(0, 1)
    )
    # Lines of one window share C_V but not the error: 12 lines count as at least 12 / 5 independent trials.
    low, high = np.asarray(stats.binom.ppf([5e-7, 1 - 5e-7], trials * 12 // 5, 0.95)) / (trials * 12 // 5)
    assert (covered >= low).all()
    assert (covered <= high).all()
    # Noise is all there is here: differences between periods show the same as the residuals.
    diagonal = [np.einsum("cfii->fi", c).real for c in (frf.noise_covariance, frf.output_covariance)]
    assert diagonal[0] == pytest.approx(diagonal[1], rel=6 / np.sqrt(30 * trials))


def test_total_covariance_holds_what_repeats_and_noise_does_not() -> None:
    record, _ = recording(n=2, n_block=3, n_period=2, position_noise=1e-6, seed=2)
    disturbed = np.random.default_rng(1)
    periodic = 1e-4 * disturbed.standard_normal(
        (1, 3, 2, 1, N_SAMPLE, 2)
    )  # as a nonlinearity: new in each experiment

    def add(values: FloatArray) -> None:
        values += periodic

    quiet, loud = (H1().run(r, context()) for r in (record, changed(record, "motor_position", add)))
    total, noise = (
        np.einsum("cfii->cfi", getattr(loud, name)).real / np.einsum("cfii->cfi", getattr(quiet, name)).real
        for name in ("output_covariance", "noise_covariance")
    )
    assert np.median(total) > 1000
    assert np.median(noise) == pytest.approx(1.0, rel=1e-3)


def test_motion_of_the_motors_is_reported_with_and_without_a_slow_sine() -> None:
    record, truth = recording(n=2, n_config=1)
    frf: Any = H1().run(record, context())
    # Slow sine: amplitudes 2 and 1 rad on bin 2 of 2 s.
    assert frf.slow_sine_speed[0] == pytest.approx(2 * np.pi * np.array([2.0, 1.0]), rel=1e-9)
    omega = 2 * np.pi * record.frequency_hz
    # Orthogonal inputs of amplitude 0.5: over experiments the powers of the two inputs add.
    amplitude = 0.5 / omega[:, None] * np.sqrt((np.abs(truth) ** 2).sum(axis=-1))
    assert frf.speed_rms[0] == pytest.approx(np.sqrt(0.5 * (amplitude**2).sum(axis=0)), rel=1e-9)

    # The slow sines have one phase; what the lines add is the mean of squares of the angle, not of the speed.
    quick = np.sqrt(0.5 * ((amplitude / omega[:, None]) ** 2).sum(axis=0))
    variance = np.diag(frf.travel_covariance[0])
    assert variance == pytest.approx(0.5 * np.array([2.0, 1.0]) ** 2 + quick**2, rel=1e-9)
    assert frf.travel_covariance[0, 0, 1] == pytest.approx(0.5 * 2.0 * 1.0, rel=0.05)

    def still(values: FloatArray) -> None:
        values -= sine(np.array([2.0, 1.0]), np.full(2, 0.3), 2, N_SAMPLE)

    without: Any = H1().run(changed(record, "motor_position", still), context())
    assert (without.slow_sine_speed == 0).all()
    assert without.speed_rms == pytest.approx(frf.speed_rms, rel=1e-9)


def silence(record: Any, lines: list[int], axis: int) -> Any:
    """Take the torque of one axis away at some excited lines."""

    def change(values: FloatArray) -> None:
        spectrum = np.fft.rfft(values[..., axis], axis=4)
        spectrum[..., record.line[lines]] = 0
        values[..., axis] = np.fft.irfft(spectrum, n=N_SAMPLE, axis=4)

    return changed(record, "motor_torque", change)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=["h1", "log", "log-element"])
def test_lines_that_one_axis_does_not_excite_are_masked_and_listed(
    estimator: Any, caplog: pytest.LogCaptureFixture
) -> None:
    record, truth = recording(n=2, n_config=2)
    frf: Any = estimator.run(silence(record, [4, 11], 1), context())
    expected = np.ones(30, dtype=bool)
    expected[[4, 11]] = False
    assert (frf.valid == expected).all()
    size = np.abs(truth).max(axis=(-2, -1), keepdims=True)
    assert (np.abs(frf.response - truth) / size)[:, expected].max() < 1e-10
    assert np.isnan(frf.response[:, ~expected]).all()
    assert (frf.degrees_of_freedom[:, ~expected] == 0).all()
    for hertz in record.frequency_hz[[4, 11]]:
        assert f"{hertz:.4g}" in caplog.text
    with pytest.raises(PoorExcitation, match="configuration 1: 4 of 30 lines"):
        estimator.run(silence(record, [4, 11, 12, 13], 1), context())


def test_an_axis_that_never_moves_is_poor_excitation() -> None:
    record, _ = recording(n=2)
    with pytest.raises(PoorExcitation, match="30 of 30 lines"):
        H1().run(silence(record, list(range(30)), 0), context())


def test_what_cannot_be_stated_is_said() -> None:
    one, truth = recording(n=2, n_block=1, n_period=1)
    for estimator in ESTIMATORS:
        frf = estimator.run(one, context())
        assert not frf.has_covariance
        assert frf.noise_covariance is None
        assert "total: none stated, 1 block of 2 experiments for 2 inputs" in frf.pooling
        assert "noise: none stated, a single period was kept; steady state not checked" in frf.pooling
    # One block with an experiment to spare states it.
    spare, _ = recording(n=2, n_block=1, n_exp=3, position_noise=1e-6)
    frf = H1().run(spare, context())
    assert frf.has_covariance
    assert "3 experiments for 2 inputs, 1 degree of freedom at a line, pooled over 9 lines" in frf.pooling
    # Blocks without an experiment per input have no response of their own; together they do.
    halves, _ = recording(n=2, n_block=4, n_exp=1)
    frf = H1().run(halves, context())
    assert frf.block_response is None
    assert np.abs(frf.response - truth).max() < 1e-9 * np.abs(truth).max()
    with pytest.raises(PoorExcitation, match="1 experiment cannot separate 2 inputs"):
        LogarithmicMean().run(halves, context())


def test_bad_samples_and_missing_periods_are_named() -> None:
    record, _ = recording(n=2, n_period=3)

    def spoil(values: FloatArray) -> None:
        values[0, 1, 0, 2, 37, 1] = np.nan

    bad = changed(record, "motor_torque", spoil)
    message = "motor_torque of axis_2 is NaN .* 1 samples, first in configuration 1, block 2, experiment 1, period 3"
    with pytest.raises(DataRejected, match=message):
        H1(discard=1).run(bad, context())
    with pytest.raises(DataRejected, match="3 periods were measured and 3 are to be dropped"):
        H1(discard=3).run(record, context())


def test_leading_periods_can_be_dropped() -> None:
    record, truth = recording(n=2, n_period=3)

    def transient(values: FloatArray) -> None:
        values[:, :, :, 0] += np.exp(-np.arange(N_SAMPLE) / 40)[:, None]

    started = changed(record, "motor_position", transient)
    assert np.abs(H1(discard=0).run(started, context()).response - truth).max() > 1e-3 * np.abs(truth).max()
    assert np.abs(H1(discard=1).run(started, context()).response - truth).max() < 1e-9 * np.abs(truth).max()


def test_a_drift_from_period_to_period_is_told(caplog: pytest.LogCaptureFixture) -> None:
    record, _ = recording(n=2, n_period=3)
    H1().run(record, context())
    assert "drifts" not in caplog.text

    def drift(values: FloatArray) -> None:
        values[..., 1] += 1e-3 * np.arange(3 * N_SAMPLE).reshape(3, N_SAMPLE)

    H1().run(changed(record, "motor_position", drift), context())
    assert "axis_2 drifts from period to period" in caplog.text
    assert "axis_1 drifts" not in caplog.text


@pytest.mark.parametrize("form", [None, "matrix", "element"])
def test_the_contract_of_stages_is_kept(form: str | None) -> None:
    if form is None:
        check_stage(H1, for_axes=(1, 2))
    else:
        check_stage(LogarithmicMean, for_axes=(1, 2, 6) if form == "matrix" else (2,), form=form)


def test_same_record_gives_the_same_bytes() -> None:
    record, _ = recording(n=3, position_noise=1e-6)
    for estimator in ESTIMATORS:
        first, second = (estimator.run(record, context()) for _ in range(2))
        for name in ("response", "output_covariance", "noise_covariance", "input_gram_inverse", "speed_rms"):
            assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


def test_block_responses_of_a_stranger_become_a_response_with_the_same_covariance() -> None:
    record, truth = recording(n=2, n_block=4, n_period=3, position_noise=1e-5, torque_noise=1e-3, seed=3)
    u, y = record.spectra(discard=1)
    frf: Any = Frf.from_blocks(record, y @ np.linalg.inv(u), discard=1)
    # With as many experiments as inputs in a block, the scatter of blocks is the least-squares residual up to
    # the noise of the inputs, which makes the blocks a little unequal.
    ours: Any = H1(discard=1).run(record, context())
    ratio = (
        np.einsum("cfii->cfi", frf.output_covariance).real
        / np.einsum("cfii->cfi", ours.output_covariance).real
    )
    assert ratio == pytest.approx(1.0, abs=0.02)
    assert frf.input_gram_inverse == pytest.approx(ours.input_gram_inverse, rel=0.02)
    assert (frf.degrees_of_freedom == ours.degrees_of_freedom).all()
    assert np.abs(frf.response - ours.response).max() < 0.05 * np.abs(truth).max()
    assert frf.speed_rms.shape == (1, 2)
    np.linalg.cholesky(frf.covariance(0))


def test_block_responses_of_a_stranger_may_lack_lines_or_a_covariance() -> None:
    record, truth = recording(n=2, n_block=2)
    blocks = np.broadcast_to(truth, (1, 2, 30, 2, 2)).copy()
    blocks[0, 1, 5] = np.nan
    frf: Any = Frf.from_blocks(record, blocks)
    assert np.flatnonzero(~frf.valid[0]).tolist() == [5]
    assert frf.has_covariance
    one, _ = recording(n=2, n_block=1)
    assert not Frf.from_blocks(one, blocks[:, :1]).has_covariance
    local, _ = recording(n=2, n_block=2, n_exp=1)  # a local model needs one experiment only
    assert "none stated" in Frf.from_blocks(local, blocks).pooling
    with pytest.raises(PluginError, match="do not belong to a record of 1 configurations, 1 blocks"):
        Frf.from_blocks(one, blocks)
    blocks[0, 0, :4] = np.nan
    with pytest.raises(
        PluginError, match="mean of blocks: configuration 1: NaN or infinite at 5 of 30 lines"
    ):
        Frf.from_blocks(record, blocks)
