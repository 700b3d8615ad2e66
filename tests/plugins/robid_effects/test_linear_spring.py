"""An additional spring and damper: linear in every respect."""

import numpy as np
import pytest

from robid_effects.linear_spring import SpringDamper

PARAMETERS = np.array([4e4, 25.0])


def test_the_law_is_a_spring_and_a_damper() -> None:
    for position, velocity in ((1e-3, 0.0), (0.0, -0.3), (-2e-3, 0.1)):
        force, in_position, in_velocity = SpringDamper.law(
            position, velocity, 0.0, np.zeros(1), np.zeros(1), PARAMETERS, 2.5e-4
        )
        assert force == pytest.approx(4e4 * position + 25.0 * velocity, rel=1e-14)
        assert (in_position, in_velocity) == (4e4, 25.0)


def test_the_regressor_times_the_parameters_is_the_force(at) -> None:
    rng = np.random.default_rng(0)
    position, velocity = rng.normal(0, 1e-3, 20), rng.normal(0, 0.1, 20)
    columns = SpringDamper.regressor(position, velocity, np.zeros(20), PARAMETERS, at("gear"))
    force = PARAMETERS[0] * columns["stiffness"] + PARAMETERS[1] * columns["damping"]
    laws = [
        SpringDamper.law(x, v, 0.0, np.zeros(1), np.zeros(1), PARAMETERS, 0.0)[0]
        for x, v in zip(position, velocity, strict=True)
    ]
    np.testing.assert_allclose(force, laws, rtol=1e-12, atol=1e-12)
