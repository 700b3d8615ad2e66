"""Changes of the robot itself as candidates: where they may be, and with which springs they begin."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

import numpy as np
import pytest

from robid_core import Context, Record, Robot, StructureEffect
from robid_core.residual import effect_class
from robid_core.stage import map_in_process
from robid_diagnosis.candidates import Candidate
from robid_diagnosis.effects import Effects
from robid_diagnosis.structures import BASE, RESONANCES, structure_candidates

HIGHEST_HZ = 100.0


def candidates_of(robot: Robot, use: str) -> list[Candidate]:
    effect = effect_class(use)
    assert issubclass(effect, StructureEffect)
    pose = np.zeros((1, robot.n_axis))
    return list(structure_candidates(robot, use, effect, pose, HIGHEST_HZ))


def test_a_pedestal_begins_where_all_that_stands_on_it_resonates() -> None:
    """The arm and the pedestal move as one mass against its spring: k = (2 pi f)^2 m."""
    robot = Robot.load("one_axis")
    found = candidates_of(robot, "structure.foundation_sway")
    assert len(found) == len(RESONANCES)
    for candidate, share in zip(found, RESONANCES, strict=True):
        standing = robot.parameter("mass.axis_1") + 200.0  # the effect's own default
        expected = standing * (2 * np.pi * share * HIGHEST_HZ) ** 2
        assert candidate.values["stiffness_x"] == pytest.approx(expected)
        assert candidate.values["mass"] == pytest.approx(BASE * robot.parameter("mass.axis_1"))


def test_elastic_coordinates_are_tried_about_axes_that_are_still_stiff() -> None:
    """Six joints and six bearings leave six directions: about none of those that turn or bend already."""
    robot = Robot.load("six_axis")
    tried = {(one.spot.on, *(one.values[f"axis_{k}"] for k in "xyz")) for one in
             candidates_of(robot, "structure.elastic_coordinate")}  # fmt: skip
    known = {}
    for body in robot.description.bodies:
        bearings = [b.axis for b in robot.description.bearings.values() if b.joint == body.joint]
        known[body.joint] = [body.axis, *bearings]
    assert len(tried) == 6
    assert all(tuple(direction) not in known[on] for on, *direction in tried)


def test_every_motor_may_turn_every_other_axis() -> None:
    """Thirty entries of the gear matrix, of either sign."""
    found = candidates_of(Robot.load("six_axis"), "transmission.coupled_axes")
    pairs = {(one.spot.on, one.values["from_motor"]) for one in found}
    assert len(found) == len(pairs) == 30
    assert all(one.signed for one in found)


@pytest.mark.parametrize("use", ["load.payload", "load.centre_of_mass", "drive.rotor_inertia"])
def test_what_changes_numbers_that_are_fitted_is_no_candidate(use: str) -> None:
    assert candidates_of(Robot.load("six_axis"), use) == []


@pytest.mark.parametrize(
    ("use", "on", "values", "kind", "ties"),
    [
        (
            "transmission.stiffening",
            "axis_1",
            {"cubic": 5e7},
            "partial",
            ("a function of gear deflection at axis_1",),
        ),
        (
            "structure.foundation_sway",
            "base",
            {"stiffness_x": 2e6, "stiffness_y": 2e6, "mass": 100.0},
            "cause",
            (),
        ),
    ],
)
def test_a_pedestal_that_explains_no_more_than_functions_of_one_axis_may_be_a_law_there(
    told: Robot,
    plant_of: Callable[[Robot, int], Robot],
    measured: Callable[..., Record],
    use: str,
    on: str,
    values: Mapping[str, float],
    kind: str,
    ties: tuple[str, ...],
) -> None:
    """A stiff pedestal is a spring that differs from pose to pose, as a stiffening gear is; a heavy one resonates."""
    plant = plant_of(told, 3).with_effect("hidden", use, on, values=values)
    context = Context(np.random.default_rng(1), map_in_process, lambda *_: None, logging.getLogger("test"))
    sway = ("structure.foundation_sway",)
    diagnosis = Effects(only=sway, separate=False, response_check=()).run(
        (measured(plant, 5),), told, context
    )
    (finding,) = diagnosis.findings
    assert (finding.effect, finding.kind, finding.ties) == (*sway, kind, ties)
    assert ("or a law at one axis" in diagnosis.verdict) == bool(ties)
