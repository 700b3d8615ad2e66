"""Smallest visible sizes: what they are for laws of known power, and how often noise lets them be found."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Robot
from robid_core.residual import effect_class
from robid_diagnosis.candidates import Candidate, Spot, place_at
from robid_diagnosis.columns import WHOLE
from robid_diagnosis.projection import Projection
from robid_diagnosis.visible import NINE_OF_TEN, power_of, threshold, visible_sizes

NEEDED = (np.sqrt(100.0) + NINE_OF_TEN) ** 2


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("one_axis")


def candidate(robot: Robot, use: str, side: str, **values: float) -> Candidate:
    effect, spot = effect_class(use), Spot("axis_1", side)
    told = {row.name: row.default for row in effect.parameters} | values
    return Candidate(use, spot, effect, told, place_at(robot, spot), ("gap",) if "gap" in values else ())


def test_a_linear_size_is_seen_where_its_square_times_the_power_is_needed(robot: Robot) -> None:
    """Of two shapes the worse one counts; a parameter that the fit can do itself is not told."""
    own = candidate(robot, "friction.stribeck", "motor")
    powers = []
    for factor in (1.0, 0.5):
        square, left = np.full(2, factor**2), np.diag([factor**2, 1e-9])
        powers.append(power_of(own, ("breakaway", "coulomb"), square, left, 1e-4))
    (found,) = visible_sizes({own.key: powers}, lambda one: (), lambda one: 100.0, 1.0)
    assert (found.effect, found.parameter, found.unit_symbol) == ("friction.stribeck", "breakaway", "N m")
    assert found.size == pytest.approx(np.sqrt(NEEDED) / 0.5)


def test_a_wave_is_seen_at_its_worst_phase(robot: Robot) -> None:
    own = candidate(robot, "drive.cogging", "torque")
    power = power_of(own, ("amplitude", "amplitude"), np.ones(2), np.diag([1.0, 0.25]), 1e-4)
    (found,) = visible_sizes({own.key: [power]}, lambda one: (), lambda one: 100.0, 1.0)
    assert found.size == pytest.approx(np.sqrt(NEEDED / 0.25))


def test_a_gap_is_seen_from_where_its_power_is_enough(robot: Robot) -> None:
    """Power that grows with the square of the gap: needed at the gap where it says so, exactly."""
    gaps = np.array([1e-5, 1e-4, 1e-3])
    powers = []
    for gap in gaps:
        own = candidate(robot, "transmission.backlash", "gear", gap=gap)
        square = np.full(1, (1e6 * gap) ** 2)
        powers.append(power_of(own, (WHOLE,), square, np.diag(square), 1e-4))
    (found,) = visible_sizes({own.key: powers}, lambda one: (), lambda one: 100.0, 1.0)
    assert found.size == pytest.approx(np.sqrt(NEEDED) / 1e6)


@pytest.mark.parametrize("falling", [False, True])
def test_what_is_seen_everywhere_or_nowhere(falling: bool) -> None:
    values, powers = np.array([1.0, 10.0]), np.array([50.0, 5000.0])
    powers = powers[::-1] if falling else powers
    assert threshold(values, powers, 10.0, falling) == pytest.approx(10.0 if falling else 1.0)
    assert np.isnan(threshold(values, powers, 1e4, falling))
    assert threshold(values, powers, 500.0, falling) == pytest.approx(10**0.5)


def test_a_law_of_that_size_is_found_in_nine_of_ten_records(robot: Robot) -> None:
    """Fits with noise and a law of the told size: its gain is enough in 90 % of 400 draws, within three deviations."""
    generator = np.random.default_rng(3)
    n_row, n_draw = 80, 400
    fitted, column = generator.standard_normal((n_row, 5)), generator.standard_normal((1, n_row))
    own = candidate(robot, "friction.stribeck", "motor")
    size, enough = 0.0, 0
    for _ in range(n_draw):
        residual = generator.standard_normal(n_row) + size * column[0]
        residual -= fitted @ np.linalg.lstsq(fitted, residual, rcond=None)[0]
        projection = Projection(fitted, residual, fitted.T @ fitted, np.zeros(5), [slice(0, n_row)])
        sums = projection.sums(column)
        if not size:
            square = np.diag(sums.own.sum(axis=0))
            power = power_of(own, ("breakaway",), square, projection.normal(sums)[0], 1e-4)
            (found,) = visible_sizes({own.key: [power]}, lambda one: (), lambda one: 100.0, 1.0)
            size = found.size
            continue
        enough += projection.gain(sums, [False], 1e-4).total > 100.0
    assert enough / (n_draw - 1) == pytest.approx(0.9, abs=3 * np.sqrt(0.09 / n_draw))
