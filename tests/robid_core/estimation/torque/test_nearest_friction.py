"""Free functions of speed become the numbers of a robot file, with errors that hold."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.estimation.torque.nearest_friction import nearest_friction
from robid_core.estimation.torque.speed_functions import SpeedFunctions

TIME = np.arange(4000) / 1000
SPEED = 9 * np.sin(2 * np.pi * TIME / 4) + 4 * np.sin(2 * np.pi * 6.75 * TIME)
NOISE = 0.02  # N m, of a sample


def laws_about(width: float) -> SpeedFunctions:
    return SpeedFunctions.about(np.array([width]), np.array([np.sqrt((SPEED**2).mean())]))


def columns(laws: SpeedFunctions, speed: np.ndarray = SPEED) -> np.ndarray:
    return np.stack([*(law[:, 0] for law in laws.along(speed[:, None])), np.ones_like(speed), speed], axis=1)


def file_friction(
    speed: np.ndarray, coulomb: float, width: float, viscous: float, offset: float
) -> np.ndarray:
    torque: np.ndarray = coulomb * np.tanh(speed / width) + viscous * speed + offset
    return torque


def fitted(torque: np.ndarray, laws: SpeedFunctions, ridge: float = 1e-6) -> tuple[np.ndarray, np.ndarray]:
    """Sizes of the functions by least squares, and their covariance by the noise."""
    shapes = columns(laws)
    precision = shapes.T @ shapes / NOISE**2 + ridge * np.eye(shapes.shape[1])
    covariance = np.linalg.inv(precision)
    return covariance @ shapes.T @ torque / NOISE**2, covariance


@pytest.mark.parametrize("width", [0.2, 0.5, 1.1])
def test_friction_of_a_robot_file_comes_back_whatever_width_was_told(width: float) -> None:
    """Functions about 0.5 rad/s leave 2e-4 of friction that turns round within 0.25 to 1 rad/s, 1e-3 beyond."""
    laws = laws_about(0.5)
    size, covariance = fitted(file_friction(SPEED, 0.6, width, 0.01, 0.05), laws)
    found = nearest_friction(laws, size, covariance, SPEED, 0.5)
    assert found.names == ("coulomb", "offset", "speed", "viscous")
    np.testing.assert_allclose(found.value, [0.6, 0.05, width, 0.01], rtol=0.03)
    assert found.value[0] == pytest.approx(0.6, rel=2e-3)
    true = file_friction(SPEED, 0.6, width, 0.01, 0.05)
    assert found.torque(SPEED) == pytest.approx(true, abs=0.6 * 0.02)
    assert found.size == pytest.approx(np.sqrt((true**2).mean()), rel=0.01)


def test_a_width_that_is_held_at_a_wrong_value_takes_the_level_with_it() -> None:
    laws = laws_about(0.5)
    size, covariance = fitted(file_friction(SPEED, 0.6, 1.1, 0.01, 0.05), laws)
    found = nearest_friction(laws, size, covariance, SPEED, 0.5, held=True)
    assert found.names == ("coulomb", "offset", "viscous")
    assert found.width == 0.5
    assert abs(found.value[0] / 0.6 - 1) > 0.02
    # By plain least squares over all samples, not only those that are spread over their order.
    terms = np.stack([np.tanh(SPEED / 0.5), np.ones_like(SPEED), SPEED], axis=1)
    plain = np.linalg.lstsq(terms, columns(laws) @ size, rcond=None)[0]
    np.testing.assert_allclose(found.value, plain, rtol=5e-3)


def test_the_derivatives_are_those_of_differences() -> None:
    laws = laws_about(0.5)
    size, covariance = fitted(file_friction(SPEED, 0.6, 0.55, 0.01, 0.05), laws)
    found = nearest_friction(laws, size, covariance, SPEED, 0.5)
    generator = np.random.default_rng(2)
    for _ in range(4):
        way = np.linalg.cholesky(covariance) @ generator.standard_normal(len(size))
        step = 0.1
        there, back = (
            nearest_friction(laws, size + sign * step * way, covariance, SPEED, 0.5).value for sign in (1, -1)
        )
        np.testing.assert_allclose(
            (there - back) / (2 * step), found.slope @ way, atol=0.02 * np.abs(found.slope @ way).max()
        )


def test_errors_hold_over_many_draws() -> None:
    """The rms of errors over stated ones is one for each of the four numbers, within what 300 draws scatter (4 %)."""
    laws, generator = laws_about(0.5), np.random.default_rng(3)
    true = np.array([0.6, 0.05, 0.45, 0.01])
    torque = file_friction(SPEED, 0.6, 0.45, 0.01, 0.05)
    off = []
    for _ in range(300):
        size, covariance = fitted(torque + NOISE * generator.standard_normal(len(SPEED)), laws)
        found = nearest_friction(laws, size, covariance, SPEED, 0.5)
        spread = found.slope @ covariance @ found.slope.T + found.beyond
        off.append((found.value - true) / np.sqrt(np.diag(spread)))
    ratio = np.sqrt(np.mean(np.square(off), axis=0))
    assert (ratio > 0.85).all(), ratio
    assert (ratio < 1.15).all(), ratio


def test_no_friction_leaves_the_width_at_what_was_told_and_says_so() -> None:
    laws, generator = laws_about(0.5), np.random.default_rng(4)
    size, covariance = fitted(NOISE * generator.standard_normal(len(SPEED)), laws)
    found = nearest_friction(laws, size, covariance, SPEED, 0.5)
    spread = found.slope @ covariance @ found.slope.T + found.beyond
    error = dict(zip(found.names, np.sqrt(np.diag(spread)), strict=True))
    assert error["speed"] > 0.3  # of 0.5: a prior of a factor of e, and next to nothing of the data
    assert abs(found.value[0]) < 4 * error["coulomb"]
    still = nearest_friction(laws, np.zeros(len(size)), covariance, np.zeros(100), 0.5)
    assert np.isfinite(still.slope).all()
    assert still.width == pytest.approx(0.5)


def test_another_shape_widens_the_errors_and_is_told() -> None:
    """Friction that falls with speed (Stribeck) is no robot file's: what is left of it counts as noise does."""
    laws = laws_about(0.5)
    torque = file_friction(SPEED, 0.6, 0.5, 0.01, 0.05)
    torque += 0.3 * np.exp(-np.abs(SPEED) / 3) * np.tanh(SPEED / 0.5)
    size, covariance = fitted(torque, laws)
    found = nearest_friction(laws, size, covariance, SPEED, 0.5)
    assert found.left > 10 * found.uncertainty
    assert found.left > 0.02 * found.size
    plain = found.slope @ covariance @ found.slope.T
    assert np.diag(found.beyond)[0] > 50 * np.diag(plain)[0]
