"""A fit put into the user's own robot file: the numbers change where they stand, every other character stays."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from robid_core import ConfigurationError, Robot
from robid_core.robot.file.in_place import with_model

WHOLE = """\
# My arm.  Weighed in March.
robid_robot: 1
name: arm                    # on the bench
bodies:
  - joint: j
    axis: [0, 1, 0]
    mass: 4.0   # with the tool
    centre_of_mass: [0.05, 0, 0.5]
    inertia: [[0.5, 0.01, 0],   # from CAD
              [0.01, 0.5, 0], [0, 0, 0.2]]
axes:
  j:
    position_limits: [-2.0, 2.0]

    rotor_inertia: 1.2e-3    # data sheet
    torque_limit: 20
    speed_limit: 400
    gear: {stiffness: 8.0e+4, damping: 60}      # guessed
    friction:
      coulomb: 0.5
      # the grease is old

    controller: {speed_gain: 0.08}
effects:
  grease: {use: friction.stribeck, on: j, with: {breakaway: 1.2}}  # thick
  play: {use: transmission.backlash, on: j, side: gear}
# the end
"""
DERIVED = """\
# The same, used.
robid_robot: 1
name: used
base: arm.yaml     # as delivered
effects:
  ripple: {use: drive.torque_ripple, on: j, with: {amplitude: 0.15, order: 18}}   # seen at 3 Hz
parameters:
  gear_stiffness.j: 7.0e+4       # after the crash
  mass.j: 4.1

# end
"""


def adopted(folder: Path, text: str, values: dict[str, float]) -> str:
    """The rewritten text; it loads as the fitted robot."""
    path = folder / "robot.yaml"
    (folder / "arm.yaml").write_text(WHOLE)
    path.write_text(text)
    robot = Robot.load("robot.yaml", folder)
    after = with_model(text, path, robot.model(values, tuple(values)))
    path.write_text(after)
    assert Robot.load("robot.yaml", folder) == robot.with_parameters(values)
    return after


def test_only_the_numbers_change(tmp_path: Path) -> None:
    values = {
        "gear_stiffness.j": 61234.5678901234, "mass.j": 4.25, "inertia.j.xy": 0.0125, "inertia.j.zz": 0.21,
        "friction.j.coulomb": 0.1 + 0.2, "effect.grease.breakaway": 1e-5,
    }  # fmt: skip
    after = adopted(tmp_path, WHOLE, values)
    expected = WHOLE
    for old, new in (
        ("stiffness: 8.0e+4", "stiffness: 61234.5678901234"),
        ("mass: 4.0 ", "mass: 4.25 "),
        ("[0.5, 0.01, 0]", "[0.5, 0.0125, 0]"),
        ("[0.01, 0.5, 0], [0, 0, 0.2]", "[0.0125, 0.5, 0], [0, 0, 0.21]"),
        ("coulomb: 0.5", "coulomb: 0.30000000000000004"),
        ("breakaway: 1.2", "breakaway: 1e-05"),
    ):
        assert expected.count(old) == 1
        expected = expected.replace(old, new)
    assert after == expected


def test_numbers_that_the_file_leaves_at_their_default_go_into_their_mapping(tmp_path: Path) -> None:
    values = {"friction.j.viscous": 0.002, "friction.j.offset": -0.1, "effect.grease.speed": 1.5}
    after = adopted(tmp_path, WHOLE, values)
    assert (
        "      coulomb: 0.5\n      viscous: 0.002\n      offset: -0.1\n      # the grease is old\n" in after
    )
    assert "with: {breakaway: 1.2, speed: 1.5}}  # thick\n" in after


def test_a_derived_file_keeps_its_base_and_takes_the_rest_under_parameters(tmp_path: Path) -> None:
    values = {"gear_stiffness.j": 6e4, "effect.ripple.amplitude": 0.2, "gear_damping.j": 55.0}
    after = adopted(tmp_path, DERIVED, values)
    assert "base: arm.yaml     # as delivered\n" in after
    assert "  gear_stiffness.j: 60000.0       # after the crash\n" in after
    assert "with: {amplitude: 0.2, order: 18}}   # seen at 3 Hz\n" in after
    tail = after.partition("  mass.j: 4.1\n")[2]
    line, rest = tail.split("\n", 1)
    assert line.split("  # ")[0].strip() == "gear_damping.j: 55.0"
    assert line.endswith("# N m s/rad, standard error unknown, before 60")
    assert rest == "\n# end\n"


@pytest.mark.parametrize(
    "text",
    [
        "robid_robot: 1\nbase: arm.yaml",
        "robid_robot: 1\nbase: arm.yaml\nparameters: {}\n",
        "robid_robot: 1\nbase: arm.yaml\nparameters: {mass.j: 4.1}  # weighed\n",
        '{"robid_robot": 1, "base": "arm.yaml"}',
        "robid_robot: 1\r\nbase: arm.yaml\r\nparameters:\r\n  mass.j: 4.1\r\n",
    ],
)
def test_parameters_are_begun_where_there_are_none(tmp_path: Path, text: str) -> None:
    after = adopted(tmp_path, text, {"gear_stiffness.j": 6e4, "gear_damping.j": 55.0})
    assert "gear_stiffness.j: 60000.0" in after
    assert ("# weighed" in after) == ("# weighed" in text)


@pytest.mark.parametrize(
    ("gear", "told"),
    [
        (
            "{data_sheet: {K_nm_per_rad: 8.0e+4}}",
            r"for gear_damping\.j; take the robot file that the run wrote",
        ),
        (
            "{stiffness: &many 60, damping: *many}",
            r"for some effect, or a number that stands for others too \(an alias\)",
        ),
    ],
)
def test_what_has_no_place_of_its_own_is_refused(tmp_path: Path, gear: str, told: str) -> None:
    text = WHOLE.replace("{stiffness: 8.0e+4, damping: 60}", gear)
    with pytest.raises(ConfigurationError, match=f"there is no place of its own {told}"):
        adopted(tmp_path, text, {"gear_damping.j": 55.0})


def test_a_file_that_changed_since_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(WHOLE)
    model = Robot.load("robot.yaml", tmp_path).model({"mass.j": 4.2})
    with pytest.raises(
        ConfigurationError, match="arm has changed since the fit was made from it; run the pipeline"
    ):
        with_model(WHOLE.replace("mass: 4.0", "mass: 5.0"), path, model)


def test_an_effect_that_a_model_adds_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(WHOLE)
    robot = Robot.load("robot.yaml", tmp_path)
    whole = robot.description.model_dump()
    whole["effects"]["ripple"] = {"use": "drive.torque_ripple", "on": "j"}
    changed = dataclasses.replace(robot, description=type(robot.description).model_validate(whole))
    with pytest.raises(ConfigurationError, match="no place of its own for effect.ripple.amplitude"):
        with_model(WHOLE, path, changed.model({"effect.ripple.amplitude": 0.2}))
    with pytest.raises(ConfigurationError, match="no place of its own for some effect"):
        with_model(WHOLE, path, changed.model({}))
