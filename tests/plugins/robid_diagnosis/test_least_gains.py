"""What a cause must gain: more than chance, what laws named before leave, and a model error alike in all bins."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from robid_core import Channel, DenseRun, Record, Robot
from robid_diagnosis.hypothesis import Case, Fitted, Hypothesis
from robid_diagnosis.least_gains import ALIKE, LEAST, LeastGains
from robid_diagnosis.search import Hit

PERIOD, T, MODEL_ERROR = 2000, 1e-3, 1e-3
LINES = np.array([7, 13, 29, 53, 91, 151])


@pytest.fixture(scope="module")
def fitted() -> Fitted:
    robot, generator = Robot.load("one_axis"), np.random.default_rng(1)
    time, poses = T * np.arange(PERIOD), np.array([[0.4], [0.4], [-0.7], [-0.7]])
    phase = generator.uniform(0, 2 * np.pi, (4, len(LINES), 1))
    wave = np.cos(2 * np.pi * LINES[:, None] * time / (PERIOD * T) + phase).sum(axis=1)
    run = robot.simulate(np.tile(3 * wave[..., None], (1, 3, 1)), poses, seed=1)
    shape = (2, 1, 2, 2, PERIOD, 1)
    channels = {
        "motor_position": Channel("motor", "rad", run.position[:, PERIOD:].reshape(shape)),
        "motor_torque": Channel("motor", "N m", run.torque[:, PERIOD:].reshape(shape)),
    }
    dense = DenseRun(T, channels, time, np.ones(shape[:5], dtype=bool))
    record = Record(robot.axis_names, "simulated", "zero_order_hold", (dense,), poses[::2], line=LINES)
    return Case((record,), robot, {}, 80.0, 0, 6, MODEL_ERROR).fit(Hypothesis(), lambda *_: None)


def test_an_error_alike_in_all_bins_gains_its_square_in_standard_deviations(fitted: Fitted) -> None:
    """Against the noise between periods and the model error, put together here once more.

    What samples do not resolve of friction counts whole.
    """
    (block,) = fitted.problem.blocks
    gains = LeastGains.beside(fitted, [])  # linearises, and with that evaluates friction anew
    size = fitted.problem.friction_size(fitted.point)
    noise = block.noise(fitted.robot, size)[1:, 0, 0].real
    torque = np.abs(block.motion.torque_spectrum[:, :, 1:, 0]) ** 2
    level = torque.mean(axis=(0, 1))
    smooth = [level[max(i - 8, 0) : i + 9].mean() for i in range(len(level))]
    alike = torque * (ALIKE * MODEL_ERROR) ** 2 + block.unresolved[1:, 0, 0].real
    expected = 2 * (alike / (noise + MODEL_ERROR**2 * np.array(smooth))).sum()
    assert gains.errors[0] == pytest.approx(expected, rel=1e-6)
    assert gains.at(0) == gains.at(None) == gains.beside_chance + gains.errors[0]


def test_what_was_named_leaves_at_most_ten_percent_of_itself(fitted: Fitted) -> None:
    """A hundredth of a small gain, of a large one a hundred, later a thousandth; where care is asked a thousandth."""
    for named, left in (([500.0], 5.0), ([3e4], 100.0), ([5e5, 5e5], 1000.0)):
        gains = LeastGains.beside(fitted, named)
        assert gains.beside_chance == pytest.approx(LEAST * fitted.excess + left)
        careful = LeastGains.beside(fitted, named, careful=True)
        assert careful.beside_chance == pytest.approx(LEAST * max(1.0, fitted.misfit) + 1e-3 * sum(named))


def test_what_is_left_is_counted_in_noise_and_model_error(fitted: Fitted) -> None:
    """By the residual and the weights as they are written out; with the model error it is less than the misfit."""
    whole = 0.0
    count = 0
    for residual, block in zip(fitted.problem.residuals(fitted.point), fitted.problem.blocks, strict=True):
        size = fitted.problem.friction_size(fitted.point)
        matrix = block.weight(fitted.robot, size, fitted.model_error)
        power = np.abs(np.einsum("fab,cefb->cefa", matrix, residual)) ** 2
        whole += power[:, :, 0].sum() + 2 * power[:, :, 1:].sum()
        count += 2 * power.size
    assert fitted.excess == pytest.approx(max(1.0, whole / count), rel=1e-6)
    assert fitted.excess <= max(1.0, fitted.misfit)


def test_a_reason_names_the_error_of_the_model_where_that_is_most_of_it() -> None:
    """Friction between the samples that may gain 9000 is why 2700 are not enough, not the thirty of any cause."""
    hit, candidate = object.__new__(Hit), SimpleNamespace(place=SimpleNamespace(axis=1), is_scale=False)
    object.__setattr__(hit, "candidate", candidate)
    gains = LeastGains(30.0, np.array([2.0, 9000.0]), ("axis_1", "axis_2"))
    assert "could gain 9e+03" in gains.why_not(hit)
    candidate.place.axis = 0
    assert gains.why_not(hit) == "a cause has to gain 32 here"
