"""The dress pack: a linear spring about its rest angle, and a damper."""

import numpy as np
import pytest

from robid_effects.cable import CableSpring

PARAMETERS = np.array([8.0, -0.5, 0.7])


def law(position: float, velocity: float) -> tuple[float, float, float]:
    return CableSpring.law(position, velocity, 0.0, np.zeros(1), np.zeros(1), PARAMETERS, 2.5e-4)


def test_it_pulls_towards_its_rest_angle() -> None:
    assert law(-0.5, 0.0) == (0.0, 8.0, 0.7)
    assert law(0.5, 0.0)[0] == pytest.approx(8.0, rel=1e-14)
    assert law(-1.5, 2.0)[0] == pytest.approx(-8.0 + 1.4, rel=1e-14)


def test_the_regressor_times_the_parameters_is_the_torque(at) -> None:
    position, velocity = np.linspace(-2, 2, 7), np.linspace(3, -3, 7)
    columns = CableSpring.regressor(position, velocity, position, PARAMETERS, at("arm"))
    torque = PARAMETERS[0] * columns["stiffness"] + PARAMETERS[2] * columns["damping"]
    np.testing.assert_allclose(
        torque, [law(q, v)[0] for q, v in zip(position, velocity, strict=True)], rtol=1e-13
    )
