"""frf.ari, harmonic, jio, indirect and two_stage on closed loops known in closed form: bias, coverage, refusals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import stats

from robid_core import (
    Channel,
    ComplexArray,
    Context,
    DataRejected,
    FloatArray,
    Frf,
    PoorExcitation,
    Record,
    Robot,
)
from robid_core.estimation.excitation.multisine import experiment_factors
from robid_core.estimation.response.covariance import confidence_radius
from robid_core.estimation.response.means import harmonic_mean
from robid_core.estimation.response.spectra import divide_by_reference, divide_spectra
from robid_core.testing import (
    MassSpringPlant,
    check_recovers_plant,
    check_stage,
    example_context,
    example_robot,
    plant_record,
)
from robid_core.testing.broken import ContractBroken
from robid_frf.arithmetic import ArithmeticMean
from robid_frf.h1 import H1
from robid_frf.harmonic import HarmonicMean
from robid_frf.indirect import Indirect
from robid_frf.joint import JointInputOutput
from robid_frf.logarithmic import LogarithmicMean
from robid_frf.spectral import Spectral
from robid_frf.two_stage import TwoStage

PLAIN = [H1(), ArithmeticMean(), HarmonicMean(), LogarithmicMean(), JointInputOutput(), TwoStage()]
NAMES = [type(stage).__name__ for stage in PLAIN]


def changed(record: Record, change: Callable[[dict[str, FloatArray]], None]) -> Record:
    """The same record with the values of channels changed by `change`, which may also delete one."""
    values = {name: channel.values.copy() for name, channel in record.run.channels.items()}
    change(values)
    channels = {
        name: Channel(record.run.channels[name].side, record.run.channels[name].unit_symbol, value)
        for name, value in values.items()
    }
    return record.replace(runs=(record.run.replace(channels=channels),))


def estimate(stage: Any, record: Record, robot: Robot | None = None, context: Context | None = None) -> Frf:
    lent = {"robot": robot} if robot is not None else {}
    frf: Frf = stage.run(record=record, context=context or example_context(), **lent)
    return frf


def circular(generator: np.random.Generator, *shape: int) -> Any:
    """Circular complex Gaussian numbers of variance 1."""
    return generator.standard_normal((*shape, 2)) @ np.array([1, 1j]) / np.sqrt(2)


@pytest.mark.parametrize("cls", [ArithmeticMean, HarmonicMean, JointInputOutput, Indirect, TwoStage])
def test_the_contract_of_stages_is_kept(cls: Any) -> None:
    check_stage(cls)


@pytest.mark.parametrize("stage", PLAIN, ids=NAMES)
def test_stated_regions_cover_the_plant_with_noise_in_the_loop_and_on_the_torque(stage: Any) -> None:
    # The disturbance goes around the loop; noise of the torque sensor comes on top, as large at the input.
    trials, n = 150, 2
    plant = MassSpringPlant.of(n)
    record = plant_record(plant, n_config=trials, n_block=3, noise=0.02, seed=5)
    generator = np.random.default_rng(1)

    def noisy(values: dict[str, FloatArray]) -> None:
        values["motor_torque"] += 0.3 * generator.standard_normal(values["motor_torque"].shape)

    frf: Any = estimate(stage, changed(record, noisy))
    truth = plant.response(frf.frequency_hz)
    radius = confidence_radius(frf.variance(), frf.degrees_of_freedom[..., None, None])
    # Lines a window of five apart: independent; entries share their input's error and their output's variance.
    covered = (np.abs(frf.response - truth) <= radius)[:, 2::5].mean(axis=(0, 1))
    low, high = np.asarray(stats.binom.ppf([5e-7, 1 - 5e-7], trials * 6, 0.95)) / (trials * 6)
    assert (covered >= low).all()
    assert (covered <= high).all()
    assert np.unique(frf.degrees_of_freedom).tolist() == [4 * 5]  # six experiments for two inputs, five lines
    assert np.unique(frf.noise_degrees_of_freedom).tolist() == [6 * 2 * 5]  # three periods
    total, noise = (np.einsum("cfii->fi", c).real for c in (frf.output_covariance, frf.noise_covariance))
    assert noise == pytest.approx(total, rel=6 / np.sqrt(20 * trials))
    joint = isinstance(stage, JointInputOutput | TwoStage)
    assert frf.covers == (Frf.BEST_LINEAR_APPROXIMATION if joint else Frf.OWN_MEAN)


def test_feedback_pulls_h1_away_and_leaves_the_joint_estimator() -> None:
    # y = G u + n, u = r - F y: u = S (r - F n) with S = 1 / (1 + F G). Over many experiments H1 tends to
    # E[y u*] / E[|u|^2] = G + E[n u*] / E[|u|^2], for |r| = 1 and E|n|^2 = s^2 that is
    # G - conj(S F) s^2 / (|S|^2 (1 + |F|^2 s^2)).
    generator = np.random.default_rng(2)
    count, s = 200_000, 0.3
    g, f = 2.0 - 1.0j, 0.4 + 0.5j
    sensitivity = 1 / (1 + f * g)
    r = np.exp(2j * np.pi * generator.random(count))
    n = s * circular(generator, count)
    u = sensitivity * (r - f * n)
    y = g * u + n
    u, y, r = (x[:, None, None, None] for x in (u, y, r))  # blocks of one experiment
    power = abs(sensitivity) ** 2 * (1 + abs(f) ** 2 * s**2)
    expected = g - np.conj(sensitivity * f) * s**2 / power
    deviation = s / np.sqrt(power * count)
    h1 = divide_spectra(u, y, joined=True).value[0, 0, 0]
    assert abs(h1 - expected) < 6 * deviation
    assert abs(expected - g) > 50 * deviation
    assert abs(divide_by_reference(u, y, r).value[0, 0, 0] - g) < 6 * s / abs(sensitivity) / np.sqrt(count)


def test_arithmetic_and_harmonic_means_err_to_opposite_sides() -> None:
    # E[1 / (1 + n)] = 1 - exp(-S) for circular noise of power 1 / S: the mean of an analytic function over a circle
    # |n| = rho is its value in the middle where rho < 1, and zero beyond the pole. Hence noise of the input makes
    # the arithmetic mean too small by the share exp(-S) and leaves the harmonic mean; noise of the output the
    # other way round. 1 / (1 + n) has no variance (its tail goes with 1 / |x|^3): means of 4e5 scatter by about
    # sqrt(log(4e5) / 4e5 * pi / 2) = 0.007 near a pole of density S exp(-S) / pi; five of these.
    generator = np.random.default_rng(3)
    count, snr, g = 400_000, 1.5, 0.7 - 0.4j
    u = np.exp(2j * np.pi * generator.random(count))[:, None, None, None]
    clean, loud = np.ones_like(u), 1 + circular(generator, count)[:, None, None, None] / np.sqrt(snr)

    def means(at_input: ComplexArray, at_output: ComplexArray) -> tuple[complex, complex]:
        x, y = u * at_input, g * u * at_output
        return (
            divide_spectra(x, y).value.mean(axis=0)[0, 0, 0] / g,
            harmonic_mean(divide_spectra(y, x).value)[0, 0, 0] / g,
        )

    less = 1 - np.exp(-snr)
    assert means(loud, clean) == pytest.approx((less, 1.0), abs=0.035)
    assert means(clean, loud) == pytest.approx((1.0, 1 / less), abs=0.06)


def test_two_stages_without_smoothing_are_the_joint_estimator() -> None:
    record = plant_record(MassSpringPlant.of(3), noise=0.05, n_block=3)
    joint, two = estimate(JointInputOutput(), record), estimate(TwoStage(), record)
    names = ("response", "block_response", "input_gram_inverse", "output_covariance", "noise_covariance")
    for name in names:
        ours, theirs = getattr(two, name), getattr(joint, name)
        assert np.abs(ours - theirs).max() < 1e-11 * np.abs(theirs).max()
    smooth = estimate(TwoStage(smoothing_lines=2), record)
    assert smooth.covers == Frf.OWN_MEAN
    assert np.abs(smooth.response - joint.response).max() > 1e-3 * np.abs(joint.response).max()


def test_smoothing_is_near_the_plant_and_not_exact() -> None:
    # Half-power widths of the resonances are 3 to 14 Hz, the window 8 Hz wide: a bias at the resonances.
    stage = TwoStage(smoothing_lines=2)
    check_recovers_plant(stage, 2, tolerance=0.2)
    with pytest.raises(ContractBroken, match="without noise the response of 2 coupled masses is wrong"):
        check_recovers_plant(stage, 2)


def test_regions_of_two_stages_with_smoothing_cover_their_own_mean() -> None:
    trials = 200
    record = plant_record(MassSpringPlant.of(2), n_config=trials, n_block=3, noise=0.02, seed=9)
    frf: Any = estimate(TwoStage(smoothing_lines=2), record)
    own_mean = frf.response.mean(axis=0)
    radius = confidence_radius(frf.variance(), frf.degrees_of_freedom[..., None, None])
    covered = (np.abs(frf.response - own_mean) <= radius)[:, 2::5].mean(axis=(0, 1))
    # The mean of 200 has 7 % of the deviation: worth 0.1 % of coverage.
    low, high = np.asarray(stats.binom.ppf([5e-7, 1 - 5e-7], trials * 6, 0.95)) / (trials * 6)
    assert (covered >= low).all()
    assert (covered <= high + 0.002).all()


def test_a_controller_that_is_not_the_real_one_makes_the_indirect_estimate_wrong_by_as_much(
    caplog: pytest.LogCaptureFixture,
) -> None:
    plant, robot = MassSpringPlant.of(2), example_robot(2)
    record = plant_record(plant, robot=robot)
    exact = estimate(Indirect(), record, robot)
    truth = plant.response(exact.frequency_hz)
    assert np.abs(exact.response - truth).max() < 1e-9 * np.abs(truth).max()
    assert "differs" not in caplog.text
    name = robot.axis_names[1]
    axes = dict(robot.description.axes)
    gains = axes[name].controller
    loud = gains.model_copy(
        update={"speed_gain": 1.2 * gains.speed_gain, "integral_gain": 1.2 * gains.integral_gain}
    )
    axes[name] = axes[name].model_copy(update={"controller": loud})
    other = Robot(robot.description.model_copy(update={"axes": axes}))
    wrong = estimate(Indirect(), record, other)
    # With gains D times the real ones the torque asked for seems D times the real one: the response is G D^-1.
    expected = np.broadcast_to(truth / np.array([1.0, 1.2]), wrong.response.shape)
    assert wrong.response == pytest.approx(expected, rel=1e-8)
    assert f"{name}: the torque that the nominal controller asks for differs" in caplog.text
    assert "by 20 %" in caplog.text


def with_experiments(record: Record, n_exp: int, common: ComplexArray | float = 0.0) -> Record:
    """A record of the same plant with n + 1 experiments of common phases, and a disturbance that is in all of them."""
    plant = MassSpringPlant.of(2)
    n_sample, line = len(record.run.time_s), np.asarray(record.line)
    omega = 2 * np.pi * record.frequency_hz
    generator = np.random.default_rng(6)
    phase = np.exp(2j * np.pi * generator.random((1, 2, 1, len(line), 2)))
    factors = experiment_factors(n_exp, 2)[:, None, :]
    r = phase * factors
    response, gain = plant.response(record.frequency_hz), 0.05
    # u = r - k v with the disturbance d of the torque acting and not measured: y = G (u + d).
    loop = np.linalg.inv(np.eye(2) + gain * response / (1j * omega[:, None, None]))
    d = common * np.ones((1, 2, n_exp, len(line), 2))
    y = ((response @ loop) @ (r + d)[..., None])[..., 0]
    u = r - gain * y / (1j * omega[:, None])
    spectra = {"motor_position": -y / omega[:, None] ** 2, "motor_torque": u, "speed_reference": r}
    channels = {}
    for name, coefficient in spectra.items():
        whole = np.zeros((*coefficient.shape[:3], n_sample // 2 + 1, 2), dtype=complex)
        whole[..., line, :] = coefficient
        samples = np.fft.irfft(whole, n_sample, axis=3) * n_sample
        channels[name] = record.run.channels[name].replace(values=np.stack([samples] * 2, axis=3))
    valid = np.ones((1, 2, n_exp, 2, n_sample), bool)
    run = record.run.replace(channels=channels, valid=valid)
    return record.replace(runs=(run,), angle=np.zeros((1, 2)))


@pytest.mark.parametrize("stage", PLAIN, ids=NAMES)
def test_n_plus_one_experiments_reject_what_does_not_depend_on_the_phases(stage: Any) -> None:
    like = plant_record(MassSpringPlant.of(2))
    truth = MassSpringPlant.of(2).response(like.frequency_hz)
    disturbed = estimate(stage, with_experiments(like, 3, common=0.2 - 0.1j))
    assert np.abs(disturbed.response - truth).max() < 1e-9 * np.abs(truth).max()
    assert "what does not depend on the phases was estimated" in disturbed.pooling
    # Six experiments less one a block are four for two inputs: two to spare, over nine lines.
    assert np.unique(np.asarray(disturbed.degrees_of_freedom)).tolist() == [2 * 5]
    # With n experiments it falls on one column of the response.
    plain = estimate(stage, with_experiments(like, 2, common=0.2 - 0.1j))
    assert np.abs(plain.response - truth).max() > 1e-2 * np.abs(truth).max()


def test_blocks_with_experiments_to_spare_and_with_too_few() -> None:
    plant = MassSpringPlant.of(2)
    record = plant_record(plant, n_block=4, noise=0.01)

    def blocks_of(n_exp: int) -> Record:
        def regroup(values: FloatArray) -> FloatArray:
            joined = values.reshape(2, 8, *values.shape[3:])
            return joined[:, : 8 // n_exp * n_exp].reshape(2, 8 // n_exp, n_exp, *values.shape[3:])

        run = record.run
        channels = {k: c.replace(values=regroup(c.values)) for k, c in run.channels.items()}
        return record.replace(runs=(run.replace(channels=channels, valid=regroup(run.valid)),))

    truth = plant.response(record.frequency_hz)
    for stage in PLAIN:
        spare = estimate(stage, blocks_of(4))
        assert np.abs(spare.response - truth).max() < 0.05 * np.abs(truth).max()
        assert np.unique(np.asarray(spare.degrees_of_freedom)).tolist() == [6 * 5]
    for whole in (H1(), JointInputOutput(), TwoStage()):
        single = estimate(whole, blocks_of(1))
        assert single.block_response is None
        assert np.abs(single.response - truth).max() < 0.05 * np.abs(truth).max()
    for each in (ArithmeticMean(), HarmonicMean(), LogarithmicMean()):
        with pytest.raises(PoorExcitation, match="1 experiment cannot separate 2 inputs"):
            estimate(each, blocks_of(1))


def test_a_transient_is_cut_and_told_where_it_is_kept(caplog: pytest.LogCaptureFixture) -> None:
    plant = MassSpringPlant.of(2)
    record = plant_record(plant, n_period=4, noise=0.001)

    def settle(values: dict[str, FloatArray]) -> None:
        ringing = np.exp(-np.arange(1000) / 60) * np.cos(0.3 * np.arange(1000))
        values["motor_position"][:, :, :, 0, :, 0] += 1e-3 * ringing

    settling = changed(record, settle)
    kept = estimate(H1(discard=0), settling)
    assert "1 of 4 periods kept are not in steady state; set discard: 1" in caplog.text
    assert "1 of 4 periods kept are not in steady state" in kept.pooling
    cut, asked = estimate(H1(), settling), estimate(H1(discard=1), settling)
    assert "1 of 4 periods cut as transient" in cut.pooling
    assert (cut.response == asked.response).all()
    assert (
        np.abs(kept.response - asked.response).max()
        > 10 * np.abs(asked.response - plant.response(record.frequency_hz)).max()
    )
    segments = Spectral(segment_s=0.5)
    assert "1 of 4 periods left out" in estimate(segments, settling).pooling
    assert "left out" not in estimate(segments, record).pooling
    clean = estimate(H1(), record)
    assert "0 of 4 periods cut as transient" in clean.pooling
    assert (clean.response == estimate(H1(discard=0), record).response).all()


def test_distortion_is_stated_where_detection_lines_were_left_out() -> None:
    # A square and a cube of the torque at the output, between and on the lines; even bins were never excited.
    record = plant_record(MassSpringPlant.of(2), n_block=2)
    omega = 2 * np.pi * np.fft.rfftfreq(1000, 0.001)[:, None]

    def distort(values: dict[str, FloatArray]) -> None:
        spectrum = np.fft.rfft(values["motor_torque"] ** 2, axis=4)
        spectrum[..., 1:, :] /= -(omega[1:] ** 2)
        spectrum[..., 0, :] = 0
        values["motor_position"] += 1e-2 * np.fft.irfft(spectrum, 1000, axis=4)

    frf = estimate(H1(), changed(record, distort))
    assert frf.odd_distortion is None  # every odd bin of the band is excited
    # Products of L = 30 lines of size 1: at an even bin 2 d apart from none to 30 pairs meet, sums by random walk.
    square = np.fft.rfft(record.run.values("motor_torque") ** 2, axis=4)[:, :, :, 0, 22:79:2] / 1000
    expected = 1e-2 * np.sqrt(np.mean(np.abs(square) ** 2, axis=(1, 2, 3)))
    even = np.asarray(frf.even_distortion)
    assert np.sqrt(np.mean(even**2, axis=1)) == pytest.approx(expected, rel=0.15)
    assert np.abs(np.asarray(estimate(H1(), record).even_distortion)).max() < 1e-9


def test_what_a_record_lacks_is_named() -> None:
    record = plant_record(MassSpringPlant.of(2))
    robot = example_robot(2)

    def without(name: str) -> Record:
        def drop(values: dict[str, FloatArray]) -> None:
            del values[name]

        return changed(record, drop)

    for stage in (JointInputOutput(), TwoStage()):
        with pytest.raises(DataRejected, match="no reference channel"):
            estimate(stage, without("speed_reference"))
    with pytest.raises(DataRejected, match="no channel speed_reference"):
        estimate(Indirect(), without("speed_reference"), robot)
    with pytest.raises(DataRejected, match="no channel motor_torque"):
        estimate(H1(), without("motor_torque"))
    with pytest.raises(DataRejected, match="the record is of the axes axis_1, axis_2, the robot"):
        estimate(Indirect(), record, Robot.load("six_axis"))
    with pytest.raises(DataRejected, match="30 usable lines are fewer than the 41"):
        estimate(TwoStage(smoothing_lines=20), record)
    for line in (None, np.array([], dtype=np.int64)):
        with pytest.raises(DataRejected, match="no excited lines"):
            estimate(H1(), record.replace(line=line))


def test_half_periods_missing_samples_and_nan_are_named() -> None:
    record = plant_record(MassSpringPlant.of(2))

    def halve(values: FloatArray) -> FloatArray:
        return values.reshape(*values.shape[:3], 6, 500, *values.shape[5:])

    run = record.run
    channels = {k: c.replace(values=halve(c.values)) for k, c in run.channels.items()}
    halves = record.replace(
        runs=(run.replace(channels=channels, valid=halve(run.valid), time_s=run.time_s[:500]),)
    )
    with pytest.raises(DataRejected, match="what was recorded as a period is not one"):
        estimate(H1(), halves)
    valid = run.valid.copy()
    valid[1, 0, 1, 2, 500:] = False
    with pytest.raises(
        DataRejected, match="missing in configuration 2, block 1, experiment 2, period 3, at 0.5000 s"
    ):
        estimate(H1(), record.replace(runs=(run.replace(valid=valid),)))

    def spoil(values: dict[str, FloatArray]) -> None:
        values["speed_reference"][0, 1, 0, 1, 3, 1] = np.nan

    with pytest.raises(DataRejected, match="speed_reference of axis_2 is NaN"):
        estimate(JointInputOutput(), changed(record, spoil))
    assert estimate(H1(), changed(record, spoil)).valid_lines.all()  # which does not look at the reference
