"""How effects are searched: values to begin from that belong to the motion, within bounds, at every place."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from robid_core import ForceEffect, Parameter, Robot, SignalEffect
from robid_core.residual import effect_class as load
from robid_diagnosis.candidates import (
    ORDERS,
    Candidate,
    Scales,
    Spot,
    catalogue,
    grid,
    place_at,
    scales_at,
    shape_of,
    spots,
)

SCALES = Scales(
    speed=10.0, position=2.0, deflection=1e-3, signal=0.0, level=0.4, friction_speed=0.7, sample_time=1e-3
)
SEARCHED = [name for name in catalogue() if issubclass(load(name), ForceEffect | SignalEffect)]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("six_axis")


@pytest.mark.parametrize("use", SEARCHED)
def test_every_effect_on_forces_and_signals_can_be_bound_where_it_is_searched(robot: Robot, use: str) -> None:
    """At each axis or bearing, with every value of its grid, all of them within the table's bounds."""
    effect = load(use)
    places = [(spot, place_at(robot, spot)) for spot in spots(robot, effect)]
    assert len(places) >= robot.n_axis
    scales = dataclasses.replace(SCALES, signal=5.0) if issubclass(effect, SignalEffect) else SCALES
    values = grid(effect, (), scales)
    assert 1 <= len(values) <= 60
    for row in effect.parameters:
        assert all(row.lower <= one[row.name] <= row.upper for one in values)
    for spot, place in places:
        assert place is not None
        for one in values:
            bound = Candidate(use, spot, effect, one, place).bound()
            assert effect.bind(bound.parameters, bound.place)  # type: ignore[union-attr]


def test_shapes_are_scaled_by_the_motion() -> None:
    """Speeds by the rms speed, gaps by the deflection both ways, a sign's width as the fit found it, orders counted."""
    stribeck = grid(load("friction.stribeck"), ("coulomb", "breakaway", "viscous"), SCALES)
    assert [one["stribeck_speed"] for one in stribeck] == [1.5, 5.0, 15.0]
    assert {one["speed"] for one in stribeck} == {0.7}
    gaps = [one["gap"] for one in grid(load("transmission.backlash"), (), SCALES)]
    assert gaps == pytest.approx([2e-5, 8e-5, 3e-4, 1e-3])
    assert [one["order"] for one in grid(load("drive.cogging"), ("amplitude",), SCALES)] == list(ORDERS)
    dahl = grid(load("friction.dahl"), (), SCALES)
    assert {one["coulomb"] for one in dahl} == {0.4}
    assert [one["stiffness"] for one in dahl] == pytest.approx([20.0, 2.0, 0.2])


def test_a_search_moves_what_is_not_linear_and_no_width_of_a_sign() -> None:
    assert shape_of(load("friction.stribeck"), ("coulomb", "breakaway", "viscous")) == ("stribeck_speed",)
    assert shape_of(load("drive.torque_ripple"), ("amplitude", "relative")) == ("order",)
    assert shape_of(load("transmission.backlash"), ()) == ("gap",)


def test_a_law_of_the_angle_is_tried_where_the_axis_was(robot: Robot) -> None:
    """A number of either sign lies at a visited angle, one above zero is a share of the swing; a spring has neither."""

    class Latch(load("load.cable_spring")):  # type: ignore[misc]
        parameters = (
            Parameter("peak", "N m", 1.0, 0.0, 9.0, "at the centre"),
            Parameter("centre", "rad", 0.0, -7.0, 7.0, "of the latch"),
            Parameter("width", "rad", 0.1, 0.0, 7.0, "of the latch"),
        )

    place = place_at(robot, Spot("axis_2", "arm"))
    assert place is not None
    swing = 0.2 * np.sin(np.linspace(0, 2 * np.pi, 400, endpoint=False))
    seen = np.stack((swing - 1.5, swing + 0.9))
    scales = scales_at(robot, place, seen, seen, None, 0.7, 10.0)
    values = grid(Latch, ("peak",), scales)
    rms = 0.2 / np.sqrt(2)
    for angle in seen.ravel():
        assert min(abs(angle - one["centre"]) for one in values) <= 0.51 * rms
    assert all(np.abs(seen - one["centre"]).min() < rms for one in values)
    assert sorted({one["width"] for one in values}) == pytest.approx([0.5 * rms, 2 * rms])
    assert shape_of(Latch, ("peak",)) == ("centre", "width")


def test_scales_are_those_of_the_place(robot: Robot) -> None:
    """On the joint's side of a gear friction turns at lower speeds and holds more."""
    seen = np.array([[0.1, -0.1, 0.3, -0.3]])
    found = []
    for use in ("friction.dahl", "load.cable_spring"):
        place = place_at(robot, next(spot for spot in spots(robot, load(use)) if spot.on == "axis_2"))
        assert place is not None
        found.append(scales_at(robot, place, seen, 2 * seen, None, 0.7, 10.0))
    motor, arm = found
    ratio = motor.friction_speed / arm.friction_speed
    assert ratio == pytest.approx(abs(1 / robot.drives.gear[1, 1]))
    assert arm.level == pytest.approx(ratio * motor.level)
    assert motor.speed == pytest.approx(2 * np.sqrt(np.mean(seen**2)))


def test_a_law_of_which_others_are_special_cases_is_tried_where_it_is_named() -> None:
    general = "friction.quadratic_load"
    assert general not in catalogue()
    assert catalogue(only=[general]) == [general]
    assert "friction.load_dependent" in catalogue()
