"""Statistics of a rigid fit: intervals with coloured noise, instruments, robust loss, tolerances, its doubts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import scipy
from oracles.rigid_arm import ARM, STEP, loaded, record_of, recording, slide

from robid_core import Channel, DenseRun, Record, Robot
from robid_core.estimation.rigid.coloured import bandwidth, inflation, score_covariance
from robid_fit.rigid import RigidBodyFit
from robid_fit.rigid_equations import RigidEquations, Sampling

TRUE = np.array([95.0, 200.0, 20.0, -3.0])  # of the slide: mass with rotor, viscous, Coulomb, offset


def coloured(n_sample: int, memory: float, draw: np.random.Generator) -> np.ndarray:
    """Noise of unit variance with a correlation `memory` from sample to sample."""
    white = draw.standard_normal(n_sample + 1000) * np.sqrt(1 - memory**2)
    return scipy.signal.lfilter([1.0], [1.0, -memory], white)[1000:]


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_the_inflation_is_that_of_an_autoregression(memory: float) -> None:
    """Long-run variance over variance of x_k = a x_(k-1) + e_k is (1 + a) / (1 - a)."""
    noise = coloured(20000, memory, np.random.default_rng(1))[:, None]
    found = float(inflation(noise, bandwidth(noise))[0])
    assert found == pytest.approx((1 + memory) / (1 - memory), rel=0.25)


def test_the_covariance_of_scores_is_bartletts() -> None:
    """Sum over lags of (1 - lag / length) times the lagged products, written out."""
    scores = np.random.default_rng(2).standard_normal((50, 3))
    length, expected = 7, np.zeros((3, 3))
    for lag in range(-length + 1, length):
        ahead = scores[max(lag, 0) : 50 + min(lag, 0)]
        behind = scores[max(-lag, 0) : 50 + min(-lag, 0)]
        expected += (1 - abs(lag) / length) * ahead.T @ behind
    np.testing.assert_allclose(score_covariance(scores, length), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("repeats", "low", "high"), [(15, 0.78, 1.0), pytest.param(60, 0.88, 0.99, marks=pytest.mark.full)]
)
def test_intervals_hold_the_truth_where_residuals_are_coloured(
    tmp_path: Path, repeats: int, low: float, high: float
) -> None:
    robot = slide(tmp_path)
    clean = recording(robot, 5, seconds=10.0, smooth_friction=False)
    position, force = (clean.run.values(f"motor_{n}")[0, 0, 0, 0] for n in ("position", "torque"))
    settings, draw = RigidBodyFit(cutoff_hz=50.0, friction_speed=0.0), np.random.default_rng(6)
    bias = settings.run((clean,), robot).base.estimate - TRUE  # type: ignore[union-attr]
    held, remarked = [], []
    for _ in range(repeats):
        noise = 2.0 * coloured(len(force), 0.99, draw)[:, None]
        fit = settings.run((record_of(robot, position, force + noise),), robot)
        assert fit.base is not None
        off = np.abs(fit.base.estimate - TRUE - bias)
        held.append(off < 1.96 * fit.base.standard_error)
        remarked.append([(doubt.kind, doubt.degree) for doubt in fit.doubts])
    # Colour that intervals count is no reason to doubt them.
    assert remarked == [[("residual colour", "remark")]] * repeats
    # The four of a record are not independent: the share scatters by 2 to 3 % over 60 records, by up to 6 % over 15.
    assert low <= np.mean(held) <= high


def test_a_memory_that_a_record_is_too_short_for_is_doubted(tmp_path: Path) -> None:
    """Noise of 2 s in a record of 10 s: intervals of the offset hold two of three truths, and this is said."""
    robot = slide(tmp_path)
    clean = recording(robot, 5, seconds=10.0, smooth_friction=False)
    position, force = (clean.run.values(f"motor_{n}")[0, 0, 0, 0] for n in ("position", "torque"))
    settings, draw = RigidBodyFit(cutoff_hz=50.0, friction_speed=0.0), np.random.default_rng(6)
    offset, doubted = settings.run((clean,), robot).base.estimate[3], 0  # type: ignore[union-attr]
    held = []
    for _ in range(30):
        noise = 2.0 * coloured(len(force), 0.9995, draw)[:, None]
        fit = settings.run((record_of(robot, position, force + noise),), robot)
        assert fit.base is not None
        held.append(abs(fit.base.estimate[3] - offset) < 1.96 * fit.base.standard_error[3])
        doubted += fit.is_doubted
    assert np.mean(held) < 0.85  # the sandwich is wrong here
    assert doubted >= 27


@pytest.mark.parametrize(("repeats", "most"), [(5, 1.5), pytest.param(12, 1.4, marks=pytest.mark.full)])
def test_standard_errors_cover_with_axes_of_different_noise(
    tmp_path: Path, repeats: int, most: float
) -> None:
    """Each axis is weighted by its own residual: the first has a hundred times the noise of the second."""
    robot = loaded(tmp_path, ARM)
    clean = recording(robot, 1, seconds=8.0)
    position, torque = (clean.run.values(f"motor_{n}")[0, 0, 0, 0] for n in ("position", "torque"))
    settings = RigidBodyFit(cutoff_hz=50.0, decimation=10, drop_first=200, drop_last=200)
    draw, true = np.random.default_rng(4), settings.run((clean,), robot).base
    assert true is not None
    normalised = []
    for _ in range(repeats):
        noise = [0.5, 0.005, 0.5] * draw.standard_normal(torque.shape)
        base = settings.run((record_of(robot, position, torque + noise),), robot).base
        assert base is not None
        normalised.append((base.estimate - true.estimate) / base.standard_error)
    # The mean of 240 squares scatters by 0.1 where all are independent, of 100 by 0.14; tolerances keep some below one.
    assert 0.5 < np.mean(np.square(normalised)) < most


def test_a_record_of_white_noise_has_no_inflation_to_speak_of(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    fit = RigidBodyFit(cutoff_hz=50.0).run((recording(robot, 8, seconds=10.0, noise=1.0),), robot)
    assert [doubt.kind for doubt in fit.doubts] == []


def of_experiments(robot: Robot, records: list[Record]) -> Record:
    """Several records as experiments of one."""
    channels = {
        name: Channel(
            "motor", channel.unit_symbol, np.concatenate([r.run.values(name) for r in records], axis=2)
        )
        for name, channel in records[0].run.channels.items()
    }
    n_sample = records[0].run.time_s.size
    run = DenseRun(
        sample_time_s=STEP,
        channels=channels,
        time_s=records[0].run.time_s,
        valid=np.ones((1, 1, len(records), 1, n_sample), dtype=bool),
    )
    return Record(robot.axis_names, "computed", "continuous", (run,), np.zeros((1, robot.n_axis)))


def test_experiments_that_disagree_are_told(tmp_path: Path) -> None:
    """Friction that differs from run to run, as with temperature, is in no stated error."""
    robot = slide(tmp_path)
    alike = [recording(robot, seed, seconds=4.0, noise=1.0) for seed in (1, 2, 3, 4)]
    settings = RigidBodyFit(cutoff_hz=50.0)
    assert [d.kind for d in settings.run((of_experiments(robot, alike),), robot).doubts] == []
    warm = []
    for k, one in enumerate(alike):
        position, force = (one.run.values(f"motor_{n}")[0, 0, 0, 0] for n in ("position", "torque"))
        more = 2.0 * k * np.tanh(np.gradient(position, STEP, axis=0) / 1e-3)
        warm.append(record_of(robot, position, force + more))
    kinds = [d.kind for d in settings.run((of_experiments(robot, warm),), robot).doubts]
    assert "experiments disagree" in kinds
    (doubt,) = [d for d in settings.run((of_experiments(robot, warm),), robot).doubts if "disagree" in d.kind]
    assert "friction.x.coulomb " in doubt.sentence
    assert not doubt.is_remark


@pytest.mark.parametrize(("repeats", "most"), [(10, 1), pytest.param(40, 2, marks=pytest.mark.full)])
def test_experiments_that_are_alike_are_hardly_ever_said_to_disagree(
    tmp_path: Path, repeats: int, most: int
) -> None:
    """Four numbers of three experiments with coloured noise: all together have one chance in a hundred."""
    robot, draw, told = slide(tmp_path), np.random.default_rng(7), 0
    clean = [recording(robot, seed, seconds=4.0) for seed in (1, 2, 3)]
    settings = RigidBodyFit(cutoff_hz=50.0)
    for _ in range(repeats):
        noisy = []
        for one in clean:
            position, force = (one.run.values(f"motor_{n}")[0, 0, 0, 0] for n in ("position", "torque"))
            noise = 2.0 * coloured(len(force), 0.98, draw)[:, None]
            noisy.append(record_of(robot, position, force + noise))
        fit = settings.run((of_experiments(robot, noisy),), robot)
        told += "experiments disagree" in [doubt.kind for doubt in fit.doubts]
    assert told <= most  # with a chance of 0.01 more than one of 10: 0.004; more than two of 40: 0.008


def test_tolerances_widen_as_far_as_the_data_ask_and_no_further(tmp_path: Path) -> None:
    truth = loaded(tmp_path, ARM)
    settings = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=500, drop_last=500, widen=True)
    kept = settings.run((recording(truth, 1, noise=0.02),), truth)
    assert "widened" not in kept.status
    wrong = json.loads(json.dumps({**ARM, "name": "nominal"}))
    for body, factor in zip(wrong["bodies"], (3.0, 0.3, 3.0), strict=True):
        body["mass"] *= factor
    fit = settings.run((recording(truth, 1, noise=0.02),), loaded(tmp_path, wrong))
    # A third and three times: logarithms of 1.1, where a tenth was promised.
    assert 4 < float(fit.status.rpartition("widened ")[2].partition(" times")[0]) < 20
    held = settings.model_copy(update={"widen": False}).run(
        (recording(truth, 1, noise=0.02),), loaded(tmp_path, wrong)
    )
    for one in (fit, held):
        assert "tolerance" in [doubt.kind for doubt in one.doubts]


def test_knocks_do_not_move_a_robust_fit(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    clean = recording(robot, 5, seconds=10.0, noise=1.0)
    position, force = (clean.run.values(f"motor_{n}")[0, 0, 0, 0] for n in ("position", "torque"))
    knocked = force.copy()
    knocked[np.random.default_rng(3).integers(0, len(force) // 3, 60)] += (
        400.0  # all in the first third, one way
    )
    record = record_of(robot, position, knocked)
    far = {}
    for loss in ("squares", "huber"):
        base = RigidBodyFit(cutoff_hz=50.0, loss=loss).run((record,), robot).base
        assert base is not None
        far[loss] = np.abs(base.estimate - TRUE)
    assert (far["huber"] < 0.4 * far["squares"])[[2, 3]].all()


def test_instruments_take_away_what_noise_of_the_position_costs(tmp_path: Path) -> None:
    """Noise in a column makes its estimate small by the share of noise in its power (errors in variables)."""
    robot = slide(tmp_path)
    clean = recording(robot, 5, seconds=20.0, noise=0.5)
    position, force = (clean.run.values(f"motor_{n}")[0, 0, 0, 0] for n in ("position", "torque"))
    noise = 2e-4 * np.random.default_rng(1).standard_normal(position.shape)
    noisy = record_of(robot, position + noise, force)
    channels = {
        **noisy.run.channels,
        "position_reference": Channel("motor", "m", position[None, None, None, None]),
    }
    record = noisy.replace(runs=(noisy.run.replace(channels=channels),))
    found = {}
    for instruments in ("none", "reference"):
        base = RigidBodyFit(cutoff_hz=50.0, instruments=instruments).run((record,), robot).base
        assert base is not None
        found[instruments] = (float(base.estimate[0]), float(base.standard_error[0]))
    # Twice differentiated, the noise below 50 Hz outweighs the motion's acceleration several times.
    assert found["none"][0] < 0.6 * TRUE[0]
    value, error = found["reference"]
    assert abs(value - TRUE[0]) < 3 * error
    assert error < 0.1 * TRUE[0]


def test_blocks_that_are_left_out_are_predicted_by_a_fit_to_the_others(tmp_path: Path) -> None:
    """The same as a fit to a record that lacks the block, within what filters do at the new ends."""
    robot = slide(tmp_path)
    record = recording(robot, 5, seconds=12.0, noise=2.0)
    settings = RigidBodyFit(cutoff_hz=50.0, drop_first=100, drop_last=100)
    whole = settings.model_copy(update={"blocks": 2}).run((record,), robot)
    told = float(whole.status.rpartition("x ")[2].removesuffix(" %")) / 100
    position, force = (record.run.values(f"motor_{n}")[0, 0, 0, 0] for n in ("position", "torque"))
    left, power = 0.0, 0.0
    for own, other in ((slice(None, 6000), slice(6000, None)), (slice(6000, None), slice(None, 6000))):
        fit = settings.run((record_of(robot, position[other], force[other]),), robot)
        assert fit.model is not None
        model = Robot.of_model(fit.model)
        equations = RigidEquations.of_records(
            (record_of(model, position[own], force[own]),),
            model,
            model.drives.friction_speed,
            Sampling(50.0, 4, 10, 100, 100, 0),
        )
        rest = equations.torque - equations.regressor @ equations.columns.value
        left, power = left + float((rest**2).sum()), power + float((equations.torque**2).sum())
    assert told == pytest.approx(np.sqrt(left / power), rel=0.02)
