"""A damping that a compensation left uncertain is part of the covariance that a response states."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Frf
from robid_core.testing import example_robot
from robid_core.testing.inputs import example_frf, example_record


@pytest.fixture
def frf() -> Frf:
    made = example_frf(example_robot(2))
    n_config, n_freq, n_axis = made.response.shape[:3]
    deviation = 0.01 * (1 + np.arange(n_axis)) * np.ones((n_config, n_freq, n_axis))
    return made.replace(damping_deviation=deviation)


def test_the_variance_is_that_of_responses_with_other_dampings(frf: Frf) -> None:
    # The exact response of a robot whose motor i has the damping d more is G (I + d e_i e_i^T G / (i w))^-1.
    chance, runs = np.random.default_rng(1), 4000
    g, omega = frf.response[0], 2 * np.pi * frf.frequency_hz
    assert frf.damping_deviation is not None
    parts = chance.standard_normal((2, runs, *frf.damping_deviation[0].shape)) / np.sqrt(2)
    small = 1e-3
    drawn = small * frf.damping_deviation[0] * (parts[0] + 1j * parts[1])
    loop = drawn[..., None] * g / (1j * omega[:, None, None])
    other = g @ np.linalg.inv(np.eye(g.shape[-1]) + loop)
    variance = np.mean(np.abs(other - g) ** 2, axis=0) / small**2
    added = frf.variance()[0] - frf.replace(damping_deviation=None).variance()[0]
    # Means of 4000 squares of sums of complex Gaussian numbers: 4 / sqrt(4000), and more for fewer terms of weight.
    assert variance == pytest.approx(added, rel=0.1)


def test_the_dense_covariance_holds_the_same_variances_column_after_column(frf: Frf) -> None:
    dense = frf.covariance(0)
    diagonal = np.einsum("fkk->fk", dense)
    n_freq = len(dense)
    assert diagonal.real == pytest.approx(frf.variance()[0].swapaxes(-1, -2).reshape(n_freq, -1), rel=1e-12)
    assert dense == pytest.approx(dense.conj().swapaxes(-1, -2))
    assert (np.linalg.eigvalsh(dense) > 0).all()


def test_deviations_of_a_record_are_read_between_its_lines() -> None:
    record = example_record(example_robot(2))
    assert record.damping_deviation_at(record.frequency_hz) is None
    n_config, n_axis = record.angle.shape
    course = np.log(record.frequency_hz)[None, :, None] * np.ones((n_config, 1, n_axis))
    found = record.replace(damping_deviation=course).damping_deviation_at(
        np.sqrt(record.frequency_hz[1:] * record.frequency_hz[:-1])
    )
    assert found == pytest.approx((course[:, 1:] + course[:, :-1]) / 2)
