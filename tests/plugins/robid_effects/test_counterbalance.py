"""Counterbalance: torque as the derivative of the energy that spring and gas store."""

import numpy as np
import pytest

from robid_core import ConfigurationError
from robid_effects.counterbalance import SMALLEST_COLUMN, Counterbalance

# anchor, attachment, mounting angle, preload, stiffness, gas length, exponent
METAL = np.array([0.6, 0.15, 0.4, 3000.0, 2e4, 1.0, 0.0])
PULLING_GAS = np.array([0.6, 0.15, 0.4, 5000.0, 0.0, 0.5, 1.3])
PUSHING_GAS = np.array([0.5, 0.2, 2.5, -4000.0, 0.0, 0.7, 1.0])
BOTH = np.array([0.2, 0.5, -1.0, 2000.0, 8e3, 1.2, 1.2])
CASES = [METAL, PULLING_GAS, PUSHING_GAS, BOTH]


def law(parameters: np.ndarray, angle: float, place) -> tuple[float, float, float]:
    arguments = Counterbalance.arguments(parameters, place)
    return Counterbalance.law(angle, 0.3, 0.0, np.zeros(1), np.zeros(1), arguments, 2.5e-4)


def length(parameters: np.ndarray, angle: float) -> float:
    """Distance of the two ends, from their coordinates."""
    a, b, mounting = parameters[:3]
    return float(np.hypot(a - b * np.cos(angle + mounting), b * np.sin(angle + mounting)))


def energy(parameters: np.ndarray, angle: float) -> float:
    """Work done on spring and gas from joint angle zero, integrated by hand."""
    preload, stiffness, gas_length, n = parameters[3:]
    u = length(parameters, angle) - length(parameters, 0.0)
    column = 1 - np.sign(preload) * u / gas_length
    gas = -np.log(column) if n == 1 else (column ** (1 - n) - 1) / (n - 1)
    return abs(preload) * gas_length * gas + 0.5 * stiffness * u * u


@pytest.mark.parametrize("parameters", CASES)
@pytest.mark.parametrize("angle", [-2.5, -0.6, 0.0, 0.05, 1.1, 3.0])
def test_the_torque_is_the_derivative_of_the_energy(at, parameters: np.ndarray, angle: float) -> None:
    h = 1e-4
    e = [energy(parameters, angle + k * h) for k in (-2, -1, 1, 2)]
    derivative = (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h)
    # Fourth order: h^4 / 30 of a fifth derivative of some 1e5 N m; rounding eps 3000 J / h = 7e-9.
    assert law(parameters, angle, at("arm"))[0] == pytest.approx(derivative, abs=1e-6)


@pytest.mark.parametrize("parameters", CASES)
def test_the_slope_is_the_derivative_of_the_torque(at, parameters: np.ndarray) -> None:
    h = 1e-5
    for angle in (-2.5, -0.6, 0.0, 1.1, 3.0):
        up, down = (law(parameters, angle + d, at("arm"))[0] for d in (h, -h))
        # h^2 / 6 of a third derivative of some 1e5; rounding eps 1e3 / h = 2e-8.
        assert law(parameters, angle, at("arm"))[1] == pytest.approx((up - down) / (2 * h), abs=1e-4)
        assert law(parameters, angle, at("arm"))[2] == 0.0


def test_a_spring_of_zero_free_length_balances_a_pendulum(at) -> None:
    """k a b = m g l: the weight's torque and the spring's cancel at every angle."""
    a, b, weight_moment = 0.6, 0.15, 400.0
    stiffness = weight_moment / (a * b)
    parameters = np.array([a, b, 0.0, stiffness * (a - b), stiffness, 1.0, 0.0])
    for angle in np.linspace(-3, 3, 13):
        gravity = -weight_moment * np.sin(angle)  # of a mass above the joint, as a torque to be held
        assert law(parameters, angle, at("arm"))[0] + gravity == pytest.approx(0.0, abs=1e-10)


def test_the_pull_at_joint_angle_zero_is_the_preload(at) -> None:
    a, b, mounting, preload = PULLING_GAS[:4]
    lever = a * b * np.sin(mounting) / length(PULLING_GAS, 0.0)
    assert law(PULLING_GAS, 0.0, at("arm"))[0] == pytest.approx(preload * lever, rel=1e-12)


def test_gas_that_is_compressed_pulls_and_pushes_harder(at) -> None:
    constant = np.array(PULLING_GAS)
    constant[6] = 0.0
    assert law(PULLING_GAS, 1.5, at("arm"))[0] > law(constant, 1.5, at("arm"))[0] > 0
    constant = np.array(PUSHING_GAS)
    constant[6] = 0.0
    shorter = -1.5  # this brings the ends together
    assert length(PUSHING_GAS, shorter) < length(PUSHING_GAS, 0.0)
    assert abs(law(PUSHING_GAS, shorter, at("arm"))[0]) > abs(law(constant, shorter, at("arm"))[0])


def test_gas_without_a_column_keeps_its_pull(at) -> None:
    parameters = np.array(PULLING_GAS)
    parameters[5] = 0.1  # the stroke is up to 0.3 m
    force, slope, _ = law(parameters, 2.0, at("arm"))
    lever = 0.6 * 0.15 * np.sin(2.4) / length(parameters, 2.0)
    assert force == pytest.approx(5000.0 * SMALLEST_COLUMN**-1.3 * lever, rel=1e-12)
    h = 1e-6
    by_difference = (law(parameters, 2.0 + h, at("arm"))[0] - law(parameters, 2.0 - h, at("arm"))[0]) / (
        2 * h
    )
    assert slope == pytest.approx(by_difference, rel=1e-6)


def test_the_regressor_times_the_parameters_is_the_torque(at) -> None:
    angle = np.linspace(-2.0, 2.0, 9)
    for parameters in CASES:
        columns = Counterbalance.regressor(angle, angle, angle, parameters, at("arm"))
        torque = parameters[3] * columns["preload"] + parameters[4] * columns["stiffness"]
        np.testing.assert_allclose(
            torque, [law(parameters, q, at("arm"))[0] for q in angle], rtol=1e-10, atol=1e-9
        )


def test_ends_that_would_meet_are_refused(at) -> None:
    parameters = np.array(METAL)
    parameters[1] = parameters[0]
    with pytest.raises(
        ConfigurationError, match="tried: anchor_distance and attachment_distance are both 0.6 m"
    ):
        Counterbalance.arguments(parameters, at("arm"))
