"""Wrong torque constant and wrong gain of a measurement: proportions."""

import numpy as np
import pytest

from robid_core import Motion
from robid_effects.gain_error import GainError
from robid_effects.torque_constant import TorqueConstantError

SIGNAL = np.array([-3.0, 0.0, 0.5, 20.0])


@pytest.mark.parametrize(
    ("effect", "channel"),
    [(TorqueConstantError, "torque"), (GainError, "torque_measurement"), (GainError, "position")],
)
def test_output_gain_and_regressor_are_in_proportion(at, through, effect, channel: str) -> None:
    place = at(channel)
    out = through(effect, SIGNAL, place, error=-0.07)
    np.testing.assert_allclose(out, 0.93 * SIGNAL, rtol=1e-15)
    gain = effect.gain(np.array([-0.07]), place, np.array([1.0, 50.0]), Motion())
    np.testing.assert_allclose(gain, 0.93, rtol=1e-15)
    column = effect.regressor(SIGNAL, SIGNAL, SIGNAL, np.array([-0.07]), place)["error"]
    np.testing.assert_allclose(-0.07 * column, out - SIGNAL, atol=1e-14)
    assert channel in effect.channels
