"""Implausible numbers are found where they stand, and packaged robots have none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from oracles.robots import changed

from robid_core import Robot
from robid_core.robot.plausibility import remarks_on
from robid_core.robot.suspect_units import in_other_units

SOFT = {"stiffness": 30.0, "damping": 1.0}
ARMS = ("one_axis", "six_axis", "universal_arm", "seven_axis", "scara")


@pytest.mark.parametrize("name", [*ARMS, *(f"{name}_true" for name in ARMS)])
def test_packaged_robots_are_plausible(name: str) -> None:
    assert list(remarks_on(Robot.load(name))) == []


def test_a_bearing_on_the_line_of_the_next_gear_is_remarked() -> None:
    """The bearings of data sheets stand on both directions across: six_axis_flex has one on the last axis' line."""
    (remark,) = remarks_on(Robot.load("six_axis_flex"))
    assert (remark.where, remark.impossible) == ("bearing_stiffness.axis_5_x", False)


@pytest.mark.parametrize(
    ("axis", "place", "told", "impossible"),
    [
        ({"position_limits": [-170.0, 170.0]}, "position_limits", "170 rad are 27.1 turns; degrees.*2.967 rad", True),
        ({"position_limits": [-15.0, 15.0]}, "position_limits", "2.39 turns", False),
        ({"gear_ratio": 0.01}, "gear_ratio", "motor turns per joint turn are wanted, 100", True),
        ({"gear_ratio": 0.5}, "gear_ratio", "motor turns per joint turn are wanted, 2", False),
        ({"rotor_inertia": 12.0}, "rotor_inertia", r"rotor is 1.2e\+05, the arm .* 13.6.* much more", False),
        ({"rotor_inertia": 1e-7}, "rotor_inertia", "much less", False),
        ({"torque_limit": 1.0}, "torque_limit", r"gravity asks for 1.97\d N m of the motor, 1.97 times", True),
        ({"torque_limit": 1.9, "friction": {}}, "torque_limit", r"for more than it in \d\d% of the poses", False),
        ({"torque_limit": 0.4}, "friction.coulomb", "0.5 N m is 125 % of the torque limit 0.4 N m", True),
        ({"friction": {"coulomb": 0.5, "speed": 0.2}}, "step_s", "follows its friction in 0.48 ms", False),
        ({"speed_limit": 6000.0}, "speed_limit", "6000 rad/s are 60 rad/s at the joint", False),
        ({"gear": SOFT, "position_limits": [-0.5, 0.5]}, "axes", "gravity bends the springs over", True),
        ({"gear": {"stiffness": 8e8, "damping": 60.0}}, "axes", "lies at 1.22e.03 to .* too stiff", False),
        ({"gear": {"stiffness": 1.1e9, "damping": 60.0}}, "gear.stiffness", "winds the gear up by 1.8e-06 rad", False),
        ({"gear": {"stiffness": 1400.0, "damping": 1.0}}, "gear.stiffness", "bends the gear .* per degree", False),
        ({"torque_constant": 350.0}, "torque_constant", "350 N m/A, .* mN m/A. That would be 0.35", False),
        ({"sensors": {"torque_noise": 8.0}}, "sensors.torque_noise", "8 N m in every sample are 40 %", False),
        ({"sensors": {"encoder_counts": 20}}, "sensors.encoder_counts", "20 bits are 1048576", False),
        ({"gear": None}, "axes", "nothing is elastic", False),
        ({"controller": {"speed_gain": 50.0}}, "axes", "axis_1: the controller is unstable", True),
        ({"controller": None, "speed_limit": None}, "axes", "lacks speed_limit of axis_1 .* and controller of", False),
    ],
)  # fmt: skip
def test_what_cannot_be_and_what_is_unusual_is_told_with_its_size(
    axis: dict[str, Any], place: str, told: str, impossible: bool
) -> None:
    """The pendulum has 40 kg at 0.5 m: 197 N m, 1.97 at the motor; 13.6 kg m^2 about the axis."""
    robot = changed(Robot.load("one_axis"), every_axis=axis)
    found = [r for r in remarks_on(robot) if r.where in (place, f"axes.axis_1.{place}")]
    assert found, list(remarks_on(robot))
    assert any(r.impossible == impossible and _matches(told, r.what) for r in found), found


def test_millimetres_and_points_are_told() -> None:
    robot = Robot.load("one_axis")
    body = robot.description.bodies[0].model_dump(mode="json")
    long = changed(robot, bodies=[{**body, "translation": (0.0, 0.0, 300.0)}])
    assert [r.where for r in remarks_on(long) if r.impossible] == ["bodies[0] (axis_1).translation"]
    away = changed(robot, bodies=[{**body, "centre_of_mass": (0.0, 0.0, 500.0)}])
    (first, *_) = [r for r in remarks_on(away) if r.impossible]
    assert (first.where, first.what) == (
        "bodies[0] (axis_1).centre_of_mass",
        "500 m away; were millimetres written?",
    )
    heavy = changed(robot, bodies=[{**body, "inertia": [[3e5, 0, 0], [0, 3e5, 0], [0, 0, 3e5]]}])
    assert any("86.6 m; kg mm^2?" in r.what and r.impossible for r in remarks_on(heavy))
    point = changed(robot, bodies=[{**body, "inertia": [[0.0] * 3] * 3}])
    assert any("40 kg in one point" in r.what and not r.impossible for r in remarks_on(point))


@pytest.mark.parametrize(
    ("whole", "place", "told"),
    [
        ({"gravity": [0.0, 0.0, -1.0]}, "gravity", "1 m/s.2, and 9.81 on earth; in multiples of g"),
        ({"gravity": [0.0, 0.0, -1.62]}, "gravity", "1.62 m/s.2, where the earth has 9.81; is it meant"),
        ({"gravity": [0.0, 0.0, 9.81]}, "gravity", "it hangs from a ceiling; where it stands on a floor"),
        (
            {"sample_time_s": 1.0, "step_s": 0.00025},
            "sample_time_s",
            "1 s from sample to sample; ms\\? 1 ms",
        ),
        (
            {"effects": {"more": {"use": "load.payload", "on": "axis_1", "with": {"mass": 8000.0}}}},
            "effects.more.with.mass",
            "a payload of 8000 kg on an arm of 40 kg; grams\\? 8000 g are 8 kg",
        ),
        (
            {
                "effects": {
                    "more": {"use": "load.payload", "on": "axis_1", "with": {"mass": 8000.0, "z": 0.5}}
                }
            },
            "axes.axis_1.torque_limit",
            r"gravity asks for .* of the poses, the payload more \(8000 kg\) among what it bears; torque",
        ),
        (
            {
                "effects": {
                    "wave": {"use": "drive.torque_ripple", "on": "axis_1", "with": {"amplitude": 15.0}}
                }
            },
            "effects.wave.with.amplitude",
            "15 N m are 75 % of the torque limit 20 N m of the motor",
        ),
        (
            {"effects": {"more": {"use": "friction.coulomb_tanh", "on": "axis_1", "with": {"coulomb": 0.5}}}},
            "effects.more",
            "Coulomb friction of axis_1 is stated twice .* by friction.coulomb_tanh, and by axes.axis_1.friction",
        ),
    ],
)
def test_a_number_that_another_unit_explains_is_remarked(
    whole: dict[str, Any], place: str, told: str
) -> None:
    found = [r for r in remarks_on(changed(Robot.load("one_axis"), **whole)) if r.where == place]
    assert any(_matches(told, r.what) for r in found), found


@pytest.mark.parametrize(
    "whole",
    [
        {"gravity": [0.0, 0.0, 0.0]},
        {"gravity": [9.81, 0.0, 0.0]},
        {"effects": {"more": {"use": "load.payload", "on": "axis_1", "with": {"mass": 20.0}}}},
        {"effects": {"wave": {"use": "drive.torque_ripple", "on": "axis_1", "with": {"amplitude": 0.5}}}},
        {
            "effects": {
                "more": {"use": "friction.coulomb", "on": "axis_1", "side": "arm", "with": {"coulomb": 5.0}}
            }
        },
    ],
)
def test_what_is_usual_is_not(whole: dict[str, Any]) -> None:
    assert list(remarks_on(changed(Robot.load("one_axis"), **whole))) == []


def test_an_inertia_in_kg_cm2_is_told() -> None:
    robot = Robot.load("one_axis")
    body = robot.description.bodies[0].model_dump(mode="json")
    heavy = changed(robot, bodies=[{**body, "inertia": [[15000.0, 0, 0], [0, 15000.0, 0], [0, 0, 1000.0]]}])
    assert any("radius of gyration of 19.4 m" in r.what and "kg cm^2?" in r.what for r in remarks_on(heavy))


LONG = ("six_axis", "universal_arm", "seven_axis", "scara")
EXAMPLES = Path(__file__).parents[3] / "examples"
OTHERS = sorted(file.relative_to(EXAMPLES).as_posix() for file in EXAMPLES.glob("*/robot*.yaml"))


@pytest.mark.parametrize("name", [*LONG, "kuka_kr300/robot.yaml", "staubli_tx40/robot.yaml"])
@pytest.mark.parametrize("scaled", ["translations", "all lengths", "all lengths, and inertias with them"])
def test_translations_that_are_ten_times_too_short_are_told(name: str, scaled: str) -> None:
    robot = Robot.load(str(EXAMPLES / name) if "/" in name else name)
    bodies = [body.model_dump(mode="json") for body in robot.description.bodies]
    for body in bodies:
        body["translation"] = [0.1 * one for one in body["translation"]]
        if scaled != "translations":
            body["centre_of_mass"] = [0.1 * one for one in body["centre_of_mass"]]
        if scaled.endswith("with them"):
            body["inertia"] = [[0.01 * one for one in row] for row in body["inertia"]]
    found = list(in_other_units(changed(robot, bodies=bodies)))
    assert [one.where.partition(".")[2] for one in found if "ten times too short?" in one.what] == [
        "translation"
    ]


@pytest.mark.parametrize("name", [*ARMS, "six_axis_flex", *OTHERS])
def test_arms_as_they_are_built_are_not_too_short(name: str) -> None:
    robot = Robot.load(str(EXAMPLES / name) if "/" in name else name)
    assert not any("too short" in one.what for one in in_other_units(robot))


def test_short_chains_are_not_judged() -> None:
    """A pan-tilt head: two bodies of 0.1 m whose axes are 1 cm apart."""
    body = Robot.load("one_axis").description.bodies[0].model_dump(mode="json")
    pan = {**body, "joint": "axis_1"}
    tilt = {**body, "joint": "axis_2", "parent": "axis_1", "translation": [0.0, 0.0, 0.01]}
    axis = Robot.load("one_axis").description.axes["axis_1"].model_dump(mode="json", exclude_none=True)
    two = changed(Robot.load("one_axis"), bodies=[pan, tilt], axes={"axis_1": axis, "axis_2": axis})
    assert not any("too short" in one.what for one in in_other_units(two))


def _matches(pattern: str, text: str) -> bool:
    import re

    return re.search(pattern, text) is not None
