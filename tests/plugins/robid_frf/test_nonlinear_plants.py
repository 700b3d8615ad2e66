"""Stated total variance against the scatter over realisations, for plants that are not linear.

The covariance is that of the estimator about its own mean: the best linear approximation, not the linearised
model.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest
from scipy import stats

from robid_core import (
    Channel,
    Configurations,
    Context,
    DenseRun,
    Excitation,
    FloatArray,
    IntArray,
    Record,
    Robot,
)
from robid_core.estimation.excitation.multisine import logarithmic_odd_lines, multisine
from robid_core.estimation.response.covariance import confidence_radius
from robid_core.stage import map_in_process
from robid_excitation.multisine import Multisine
from robid_frf.h1 import H1
from robid_frf.logarithmic import LogarithmicMean


def context() -> Context:
    log = logging.getLogger("test.nonlinear")
    return Context(np.random.default_rng(0), map_in_process, lambda done, total, note="": None, log)


def record_of(position: FloatArray, torque: FloatArray, step: float, line: IntArray) -> Record:
    """Arrays (n_config, n_block, n_exp, n_sample, n_axis) of one period as a record."""
    n_config, n_sample, n_axis = position.shape[0], *position.shape[-2:]
    channels = {
        "motor_position": Channel("motor", "rad", position[:, :, :, None]),
        "motor_torque": Channel("motor", "N m", torque[:, :, :, None]),
    }
    valid = np.ones((*position.shape[:3], 1, n_sample), dtype=bool)
    run = DenseRun(step, channels, np.arange(n_sample) * np.float64(step), valid)
    names = tuple(f"axis_{a + 1}" for a in range(n_axis))
    return Record(names, "synthetic", "zero_order_hold", (run,), np.zeros((n_config, n_axis)), line)


def simulated(robot: Robot, excitation: Excitation, standing: Configurations) -> Record:
    """Two periods in closed loop, without sensor noise; the second is kept."""
    n_config, shape = standing.n_config, excitation.reference.shape
    reference = excitation.reference.reshape(-1, *shape[-2:])
    offset = np.stack([excitation.start_offset(i) for i in range(n_config)]).reshape(-1, shape[-1])
    start = robot.motor_angle(standing.angle).repeat(shape[1] * shape[2], axis=0) - offset
    result = robot.simulate(np.concatenate([reference, reference], axis=1), robot.joint_angle(start))
    n_sample = shape[-2]
    position, torque = (
        x[:, n_sample:].reshape(n_config, *shape[1:]) for x in (result.position, result.torque)
    )
    return record_of(position, torque, excitation.sample_time_s, excitation.line)


@pytest.mark.parametrize("estimator", [H1(), LogarithmicMean()], ids=["h1", "log"])
def test_a_motor_with_coulomb_friction_scatters_as_stated(estimator: H1 | LogarithmicMean) -> None:
    trials = 60
    nominal, true = Robot.load("one_axis"), Robot.load("one_axis_true")
    standing = Configurations(nominal.axis_names, np.full((trials, 1), 0.3))
    stage = Multisine(
        band_hz=(4.0, 80.0), lines=20, period_s=1.0, blocks=4, slow_sine_rad_s=9.0, torque_share=0.4, draws=1
    )
    frf: Any = estimator.run(simulated(true, stage.run(standing, nominal, context()), standing), context())
    scatter = frf.response[..., 0, 0].var(axis=0, ddof=1)
    # Friction is what scatters: there is no noise. (A tenth of the torque and more.)
    assert np.median(np.sqrt(scatter) / np.abs(frf.response[..., 0, 0].mean(axis=0))) > 0.003
    stated = frf.variance()[..., 0, 0].mean(axis=0)
    # A sample variance over T realisations of a complex number has the relative deviation 1 / sqrt(T); the mean
    # of log ratios over 20 lines 1 / sqrt(20 T) = 0.03, were the scatter exactly Gaussian. Five of these.
    assert np.log(stated / scatter).mean() == pytest.approx(0.0, abs=0.15)
    # Of each line: T / scatter is a chi-square of 2 (T - 1), and the course over the lines is a model.
    low, high = np.asarray(stats.chi2.ppf([1e-5, 1 - 1e-5], 2 * (trials - 1))) / (2 * (trials - 1))
    assert (stated / scatter > 0.7 / high).all()
    assert (stated / scatter < 1.4 / low).all()


def test_distortion_of_each_motor_is_covered_in_every_entry() -> None:
    # Static friction of each motor in front of a linear mechanism: torque u - f(u) acts, u is measured. All
    # experiments of a block are realisations of their own, so that the scatter is the same for every input and
    # the Kronecker form holds; with experiments that only differ by constant phases, the diagonal entries
    # would be covered in two thirds of the cases (next test).
    covered = coverage_of_static_friction(own_phases=True)
    low, high = np.asarray(stats.binom.ppf([5e-7, 1 - 5e-7], 400, 0.95)) / 400
    assert (covered >= low).all()
    assert (covered <= high).all()


def test_experiments_without_phases_of_their_own_would_not_be_covered() -> None:
    covered = coverage_of_static_friction(own_phases=False)
    assert np.diag(covered).min() < 0.85


def coverage_of_static_friction(own_phases: bool) -> FloatArray:
    """Share of realisations whose stated region holds the estimator's own mean, shape (n_axis, n_axis)."""
    n, n_sample, trials, period_s = 3, 400, 400, 2.0
    generator = np.random.default_rng(5)
    line = logarithmic_odd_lines((4.0, 80.0), 40, period_s)
    omega = 2 * np.pi * line / period_s
    mechanism = np.array([[5.0, 1.0, -0.5], [1.0, 4.0, 0.8], [-0.5, 0.8, 3.0]])
    torque = np.empty((trials, 2, n, n_sample, n))
    for i in range(trials):
        for m in range(2):
            phase, own = generator.uniform(0, 2 * np.pi, (2, len(line), n))
            torque[i, m] = multisine(np.ones((len(line), n)), phase, own_phases * own, line, n_sample)
    acting = torque - 2.0 * np.tanh(torque / 2.0)
    spectrum = np.fft.rfft(acting, axis=3)[:, :, :, line] @ mechanism.T / -(omega[:, None] ** 2)
    whole = np.zeros((*torque.shape[:3], n_sample // 2 + 1, n), dtype=complex)
    whole[:, :, :, line] = spectrum
    position = np.fft.irfft(whole, n=n_sample, axis=3)
    frf: Any = H1().run(record_of(position, torque, period_s / n_sample, line), context())
    own_mean = frf.response.mean(axis=0)
    radius = confidence_radius(frf.variance(), frf.degrees_of_freedom[..., None, None])
    # A line in the middle of the band; the mean over 400 realisations is not exact, but nearly.
    share: FloatArray = (np.abs(frf.response - own_mean) <= radius)[:, 20].mean(axis=0)
    return share
