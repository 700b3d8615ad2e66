"""What a motor's iron takes from its torque: by the torque squared, against the motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robid_core import Place
from robid_effects.core_loss import CoreLoss

TORQUE = np.array([-40.0, -3.0, 0.0, 0.5, 20.0, 200.0])


def test_a_loss_takes_power_whichever_way_the_motor_drives(
    at: Callable[..., Place], through: Callable[..., np.ndarray]
) -> None:
    for speed in (-60.0, 60.0):
        out = through(CoreLoss, TORQUE, at("torque"), speed=speed, hysteresis=1e-3, eddy=1e-5)
        lost = (TORQUE - out) * speed
        np.testing.assert_allclose(lost, 60.0 * (1e-3 + 6e-4) * TORQUE**2, rtol=1e-9, atol=1e-12)


def test_a_loss_acts_by_the_square_and_not_at_rest(
    at: Callable[..., Place], through: Callable[..., np.ndarray]
) -> None:
    twice = [TORQUE * k - through(CoreLoss, TORQUE * k, at("torque"), speed=9.0) for k in (1, 2)]
    np.testing.assert_allclose(twice[1], 4 * twice[0], atol=1e-12)
    np.testing.assert_array_equal(through(CoreLoss, TORQUE, at("torque"), speed=0.0), TORQUE)
