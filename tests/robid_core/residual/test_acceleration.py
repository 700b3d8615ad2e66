"""Acceleration: a linear iteration ends after as many steps as it has slow directions, whatever their contraction."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.residual.acceleration import History


@pytest.mark.parametrize("slow", [0.97, -0.9, 1.2])
def test_a_slow_direction_is_seen_and_left(slow: float) -> None:
    """Plain, 40 steps at 0.97 leave 0.3 of the way, and 1.2 diverges; accelerated, four steps reach 1e-6."""
    generator = np.random.default_rng(1)
    vectors = np.linalg.qr(generator.standard_normal((5, 5)))[0]
    matrix = vectors @ np.diag([slow, 0.3, 0.0, 0.0, 0.0]) @ vectors.T
    target, metric = generator.standard_normal(5), np.diag([1.0, 4.0, 100.0, 1e4, 0.1])
    point, history = np.zeros(5), History(4)
    for _ in range(5):
        history.add(point, target + matrix @ (point - target))
        point = history.next_point(metric)
    assert np.abs(point - target).max() < 1e-6


def test_the_contraction_is_that_of_the_last_step() -> None:
    history = History(3)
    assert np.isnan(history.contraction(np.eye(1)))
    for x in (1.0, 0.25):
        history.add(np.array([x]), np.array([0.4 * x]))
    assert history.contraction(np.eye(1)) == pytest.approx(0.4)
