"""Friction of a motor that a fast sine turns back and forth is that of dither."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.estimation.rigid.reversals import Reversals

STEP, CUTOFF, FREQUENCY = 1e-3, 5.0, 25.0


@pytest.mark.parametrize("slow", [0.0, 2.0, -7.0, 15.0])
def test_dither_leaves_its_mean_of_coulomb_friction(slow: float) -> None:
    """The mean of sign(V + A sin) is 2/pi asin(V/A) below A and the whole friction above.

    Within 2 f T: each of two reversals in a period is misplaced by half a sample at most, and a sign counts twice.
    """
    time = STEP * np.arange(4000)
    omega = 2 * np.pi * FREQUENCY
    angle = slow * time - 10.0 / omega * np.cos(omega * time)
    kept = slice(500, -500, 10)
    direction = Reversals.of_angles([angle[:, None]], STEP, CUTOFF, [kept]).direction(np.zeros(1))
    expected = 2 / np.pi * np.arcsin(np.clip(slow / 10.0, -1, 1))
    assert direction.shape == (300, 1)
    assert direction == pytest.approx(np.full((300, 1), expected), abs=2 * FREQUENCY * STEP)


def test_turned_round_it_is_the_same_friction_the_other_way() -> None:
    angle = np.cumsum(np.random.default_rng(1).standard_normal((2000, 2)), axis=0) * 1e-3
    kept = slice(200, -200)
    reversals = Reversals.of_angles([angle], STEP, CUTOFF, [kept])
    through = np.array([[0.0, -1.0], [1.0, 0.0]])
    steep = np.full(2, 0.3)
    assert reversals.through(through).direction(steep) == pytest.approx(
        reversals.direction(steep) @ through.T
    )
