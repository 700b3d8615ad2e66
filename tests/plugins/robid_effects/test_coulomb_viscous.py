"""One law, three uses: the effect's law, its slope, its linearisation and its regressor agree."""

import numpy as np
import pytest

from robid_core.mechanics import friction_torque
from robid_core.registry import registry
from robid_effects.coulomb_viscous import CoulombViscous

PARAMETERS = np.array([0.8, 0.004, 0.5])


def test_the_law_is_the_one_that_the_simulator_uses() -> None:
    law = CoulombViscous.law()
    for speed in np.linspace(-30, 30, 41):
        force, in_position, _, _ = law(0.0, speed, 0.0, 0.0, PARAMETERS, 1e-3)
        assert force == pytest.approx(float(friction_torque(speed, *PARAMETERS)), rel=1e-12, abs=1e-15)
        assert in_position == 0.0


def test_the_slope_is_the_central_difference_of_the_force() -> None:
    law, h = CoulombViscous.law(), 1e-5
    for speed in (-3.0, -0.2, 0.0, 0.1, 0.7, 12.0):
        up, down = (law(0.0, speed + d, 0.0, 0.0, PARAMETERS, 1e-3)[0] for d in (h, -h))
        slope = law(0.0, speed, 0.0, 0.0, PARAMETERS, 1e-3)[2]
        # Third derivative below 2 tau_C / v_s^3 = 13: error h^2 / 6 * 13, and rounding eps / h.
        assert slope == pytest.approx((up - down) / (2 * h), abs=1e-9)


def test_the_linearisation_is_the_mean_slope_over_the_motion() -> None:
    """Monte Carlo over Gaussian plus sine, 400 000 draws: within 5 standard errors of the mean."""
    rng = np.random.default_rng(1)
    speed = 4.0 * rng.standard_normal(400_000) + 9.0 * np.sin(2 * np.pi * rng.random(400_000))
    level = np.tanh(speed / PARAMETERS[2])
    slopes = PARAMETERS[0] * (1 - level**2) / PARAMETERS[2] + PARAMETERS[1]
    expected = CoulombViscous.equivalent_damping(PARAMETERS, np.array(4.0), np.array(9.0))
    assert float(expected) == pytest.approx(slopes.mean(), abs=5 * slopes.std() / np.sqrt(len(slopes)))


def test_the_regressor_times_the_parameters_is_the_force() -> None:
    speed = np.linspace(-5, 5, 11)
    columns = CoulombViscous.regressor(speed, PARAMETERS)
    force = PARAMETERS[0] * columns["coulomb"] + PARAMETERS[1] * columns["viscous"]
    np.testing.assert_allclose(force, friction_torque(speed, *PARAMETERS), rtol=1e-12)


def test_it_stands_in_the_registry_with_bounds_that_hold_its_defaults() -> None:
    assert registry().load("robid.effects", "friction.coulomb_viscous") is CoulombViscous
    for parameter, value in zip(CoulombViscous.parameters, CoulombViscous.defaults(), strict=True):
        assert parameter.lower <= value <= parameter.upper
