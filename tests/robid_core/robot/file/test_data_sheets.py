"""Data sheets of gears and bearings against their makers' own worked numbers, and against the joint they sit in."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from robid_core.robot.file.body import Body
from robid_core.robot.file.data_sheet import CURVE, BearingSheet, GearSheet
from robid_core.robot.file.description import RobotDescription
from robid_core.robot.file.expansion import directions_across
from robid_core.robot.file.part import with_tuples
from robid_core.robot.file.reading import read_description
from robid_core.robot.file.tree import stretched_inertia
from robid_core.yaml_file.problems import FileProblems

pytestmark = pytest.mark.usefixtures("effects_of_a_stranger")

STRAIN_WAVE = {
    "K1_nm_per_rad": 6.7e4, "K2_nm_per_rad": 1.1e5, "K3_nm_per_rad": 1.2e5, "T1": 29.0, "T2": 108.0,
}  # fmt: skip
CYCLOIDAL = {"K_nm_per_arcmin": 108.0, "lost_motion_arcmin": 1.0, "rated_torque": 412.0}


def test_wind_up_is_the_torsion_angle_that_the_maker_calculates() -> None:
    """Harmonic Drive, engineering data, example for an HFUC-32-100-2UH: 7.15e-4 rad at 60 N m, three digits."""
    assert GearSheet(**STRAIN_WAVE).wind_up(60.0) == pytest.approx(7.15e-4, abs=0.5e-6)


def test_wind_up_has_the_stiffness_of_its_range_everywhere_and_no_steps() -> None:
    sheet = GearSheet(**STRAIN_WAVE)
    torque = np.linspace(0, 300, 3001)
    angle = np.array([sheet.wind_up(t) for t in torque])
    expected = np.select([torque[1:] <= 29.0 + 1e-9, torque[1:] <= 108.0 + 1e-9], [6.7e4, 1.1e5], 1.2e5)
    np.testing.assert_allclose(np.diff(torque) / np.diff(angle), expected, rtol=1e-9)


def test_the_linear_model_takes_the_stiffness_between_the_torques_and_the_stated_damping() -> None:
    sheet = GearSheet(**STRAIN_WAVE)
    assert sheet.linear_stiffness == 1.1e5
    # a rotor of inertia J on the spring: the poles of J s^2 + d s + k have the ratio of damping
    inertia, stiffness = 12.0, sheet.linear_stiffness
    poles = np.roots([inertia, sheet.linear_damping(inertia), stiffness])
    np.testing.assert_allclose(-poles.real / np.abs(poles), 0.03, rtol=1e-12)
    assert GearSheet(**STRAIN_WAVE, damping=40.0).linear_damping(inertia) == 40.0
    doubled = GearSheet(**STRAIN_WAVE, damping_ratio=0.06)
    assert doubled.linear_damping(inertia) == pytest.approx(2 * sheet.linear_damping(inertia))


def test_minutes_of_arc_and_radians_describe_the_same_gear() -> None:
    minutes = {
        key.replace("rad", "arcmin"): value * np.pi / 10800
        for key, value in STRAIN_WAVE.items()
        if "K" in key
    }
    same = GearSheet(**minutes, T1=29.0, T2=108.0).curve()
    assert same == pytest.approx(GearSheet(**STRAIN_WAVE).curve())


def test_lost_motion_is_split_into_free_play_and_what_winds_elastically() -> None:
    sheet = GearSheet(**CYCLOIDAL)
    stiffness = 108.0 * 10800 / np.pi
    assert sheet.stiffness == pytest.approx((stiffness,) * 3)
    # From -3 % to +3 % of 412 N m the gear turns by its play and twice the elastic angle: one minute in all.
    total = sheet.free_play + 2 * 0.03 * 412 / stiffness
    assert total == pytest.approx(np.pi / 10800)
    assert sheet.curve() == pytest.approx(
        {
            "stiffness_1": stiffness, "stiffness_2": stiffness, "stiffness_3": stiffness,
            "torque_1": 41.2, "torque_2": 412.0, "lost_motion": sheet.free_play,
        }
    )  # fmt: skip
    assert GearSheet(K_nm_per_arcmin=108.0).curve() == {}


def test_the_curve_of_a_sheet_is_the_wind_up_of_the_sheet() -> None:
    """Linear spring plus the law of transmission.piecewise_linear at half the play plus the wind-up: the torque."""
    from robid_effects.piecewise_linear import PiecewiseLinear

    for values in (STRAIN_WAVE, CYCLOIDAL, {**STRAIN_WAVE, "lost_motion_arcmin": 1.5, "rated_torque": 137.0}):
        sheet = GearSheet(**values)
        curve = sheet.curve()
        assert list(curve) == [row.name for row in PiecewiseLinear.parameters]
        assert all(row.lower <= curve[row.name] <= row.upper for row in PiecewiseLinear.parameters)
        place: Any = SimpleNamespace(stiffness=sheet.linear_stiffness, label="a")
        arguments = PiecewiseLinear.arguments(np.array(list(curve.values())), place)
        for torque in (0.6 * curve["torque_1"], 0.5 * sum(sheet.torques), 1.5 * curve["torque_2"]):
            angle = 0.5 * sheet.free_play * (sheet.lost_motion_arcmin > 0) + sheet.wind_up(torque)
            none = np.zeros(0)
            force = PiecewiseLinear.law(angle, 0.0, 0.0, none, none, arguments, 0.0)[0]
            assert force + sheet.linear_stiffness * angle == pytest.approx(torque, rel=1e-9)


def robot(folder: Path, axis: str, more: str = "") -> RobotDescription:
    (folder / "robot.yaml").write_text(f"""\
robid_robot: 1
name: sheet
bodies:
  - {{joint: a, axis: [0, 1, 0], mass: 20, centre_of_mass: [0, 0, 0.5]}}
axes:
  a:
    gear_ratio: -121
    rotor_inertia: 2.0e-3
    torque_limit: 30
    speed_limit: 400
    controller: {{speed_gain: 0.2}}
{axis}{more}""")
    return read_description(folder / "robot.yaml")


def test_a_gear_sheet_becomes_a_spring_and_an_effect(tmp_path: Path) -> None:
    description = robot(
        tmp_path,
        "    gear: {data_sheet: {K1_nm_per_rad: 6.7e+4, K2_nm_per_rad: 1.1e+5, K3_nm_per_rad: 1.2e+5,\n"
        "                        T1: 29, T2: 108}}\n",
    )
    gear = description.axes["a"].gear
    assert gear is not None
    assert gear.stiffness == 1.1e5
    assert gear.damping == pytest.approx(2 * 0.03 * np.sqrt(1.1e5 * 2.0e-3 * 121**2))
    (effect,) = description.effects.values()
    assert (effect.use, effect.on, effect.side) == (CURVE, "a", "gear")
    assert list(description.effects) == ["a_curve"]
    assert effect.with_ == {
        "stiffness_1": 6.7e4, "stiffness_2": 1.1e5, "stiffness_3": 1.2e5, "torque_1": 29.0, "torque_2": 108.0,
        "lost_motion": 0.0,
    }  # fmt: skip


def test_a_bearing_sheet_becomes_two_springs_across_the_axis(tmp_path: Path) -> None:
    description = robot(tmp_path, "    bearing: {moment_rigidity_nm_per_arcmin: 390}\n")
    assert list(description.bearings) == ["a_x", "a_z"]
    for name, axis in (("a_x", (1.0, 0.0, 0.0)), ("a_z", (0.0, 0.0, 1.0))):
        bearing = description.bearings[name]
        assert bearing.axis == axis
        assert bearing.joint == "a"
        assert bearing.stiffness == pytest.approx(390 * 10800 / np.pi)
        # a point mass of 20 kg at 0.5 m, swinging
        assert bearing.damping == pytest.approx(2 * 0.015 * np.sqrt(bearing.stiffness * 20 * 0.25))


def test_a_description_with_sheets_written_out_is_read_back_equal(tmp_path: Path) -> None:
    description = robot(
        tmp_path,
        "    gear: {data_sheet: {K_nm_per_arcmin: 108, lost_motion_arcmin: 1, rated_torque: 412}}\n"
        "    bearing: {moment_rigidity_nm_per_rad: 1.0e+6, damping: 300}\n",
    )
    assert RobotDescription.model_validate(with_tuples(description.model_dump(mode="json"))) == description


@pytest.mark.parametrize(
    "axis", [(0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.48, -0.6, 0.64), (0.6, 0.0, 0.8)]
)
def test_directions_across_an_axis_are_orthonormal_and_named_after_the_nearest(
    axis: tuple[float, float, float],
) -> None:
    directions = directions_across(axis)
    frame = np.array([axis, *directions.values()])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert len(directions) == 2
    for letter, direction in directions.items():
        assert direction["xyz".index(letter)] > 0.5  # nearer than 60 degrees


def test_stretched_inertia_is_the_largest_over_all_poses() -> None:
    """Against a search over poses of a planar arm that can stretch out: the bound is reached there."""
    links = [
        {"joint": "a", "axis": (0.0, 1.0, 0.0), "mass": 10.0, "centre_of_mass": (0.0, 0.0, 0.3)},
        {"joint": "b", "parent": "a", "axis": (0.0, 1.0, 0.0), "translation": (0.0, 0.0, 0.6), "mass": 5.0,
         "centre_of_mass": (0.2, 0.0, 0.0), "inertia": ((0.1, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.15))},
    ]  # fmt: skip
    bodies = tuple(Body.model_validate(link) for link in links)
    turn = np.linspace(0, 2 * np.pi, 721)
    centre = np.stack([0.2 * np.cos(turn), 0.6 - 0.2 * np.sin(turn)])
    expected = 10 * 0.09 + (5 * (centre**2).sum(axis=0) + 0.2).max()
    assert stretched_inertia(bodies, "a") == pytest.approx(expected, rel=1e-6)
    assert stretched_inertia(bodies, "b") == pytest.approx(5 * 0.04 + 0.2)


SHEETS: dict[str, tuple[dict[str, Any], str]] = {
    "no stiffness": ({"T1": 1.0, "T2": 2.0}, "stiffness is given as none; give K1, K2 and K3, or K alone"),
    "two of three": ({"K1_nm_per_rad": 1.0, "K2_nm_per_rad": 1.0}, "given as K1_nm_per_rad, K2_nm_per_rad; give K1"),
    "two units": (
        {"K1_nm_per_rad": 1.0, "K2_nm_per_arcmin": 1.0, "K3_nm_per_rad": 1.0, "T1": 1.0, "T2": 2.0}, "in one unit"
    ),
    "ranges without ends": ({**STRAIN_WAVE, "T1": None}, "have no torques where they end; give T1 and T2"),
    "ends without ranges": ({"K_nm_per_rad": 1.0, "T1": 1.0}, "T1 and T2 part three ranges of stiffness"),
    "torques reversed": ({**STRAIN_WAVE, "T1": 108.0, "T2": 29.0}, "T1 108 N m is not below T2 29 N m"),
    "ratcheting below rated": (
        {"K_nm_per_rad": 1.0, "rated_torque": 300.0, "ratcheting_torque": 200.0},
        "rated_torque 300 N m is not below ratcheting_torque 200 N m",
    ),
    "lost motion of what": ({"K_nm_per_rad": 1.0, "lost_motion_arcmin": 1.0}, "give rated_torque in N m"),
    "lost motion in radians": (
        {**CYCLOIDAL, "lost_motion_arcmin": 2.9e-4},
        "lost_motion_arcmin 0.00029 is less than the gear winds elastically from -3 to +3 % of 412 N m, 0.229 minutes",
    ),
    "damped twice": ({**STRAIN_WAVE, "damping": 3.0, "damping_ratio": 0.1}, "damping 3 and damping_ratio 0.1 are"),
}  # fmt: skip


@pytest.mark.parametrize("name", SHEETS)
def test_a_sheet_that_contradicts_itself_is_refused_with_its_numbers(name: str) -> None:
    values, told = SHEETS[name]
    with pytest.raises(ValidationError) as refused:
        GearSheet.model_validate(values)
    assert told in str(refused.value)


def test_a_bearing_has_one_rigidity() -> None:
    for values in ({}, {"moment_rigidity_nm_per_rad": 1.0, "moment_rigidity_nm_per_arcmin": 1.0}):
        with pytest.raises(ValidationError, match="one of the two"):
            BearingSheet.model_validate(values)


MISTAKES = {
    "key misspelt": (
        "    gear: {data_sheet: {K_nm_per_arcmn: 108}}\n",
        "robot.yaml:12:25: axes.a.gear.data_sheet.K_nm_per_arcmn: unknown key 'K_nm_per_arcmn'; did you mean "
        "'K_nm_per_arcmin'?",
    ),
    "negative stiffness": (
        "    gear: {data_sheet: {K_nm_per_arcmin: -108}}\n",
        "robot.yaml:12:25: axes.a.gear.data_sheet.K_nm_per_arcmin: -108 must be greater than 0",
    ),
    "no stiffness": (
        "    gear: {data_sheet: {rated_torque: 108}}\n",
        "robot.yaml:12:12: axes.a.gear.data_sheet: stiffness is given as none",
    ),
    "spring and sheet": (
        "    gear: {stiffness: 1.0e+5, data_sheet: {K_nm_per_arcmin: 108}}\n",
        "robot.yaml:12:12: axes.a.gear.stiffness: a gear has stiffness and damping, or a data_sheet",
    ),
    "bearing without rigidity": (
        "    bearing: {damping: 3}\n",
        "robot.yaml:12:5: axes.a.bearing: give moment_rigidity_nm_per_arcmin or moment_rigidity_nm_per_rad",
    ),
    "bearing given twice": (
        "    bearing: {moment_rigidity_nm_per_arcmin: 390}\nbearings:\n"
        "  a_x: {joint: a, axis: [1, 0, 0], stiffness: 1, damping: 0}\n",
        "robot.yaml:14:3: bearings.a_x: the data sheet of axis 'a' (line 12) makes 'a_x' too; take another name",
    ),
    "effect of the same label": (
        "    gear: {data_sheet: {K_nm_per_arcmin: 108, lost_motion_arcmin: 1, rated_torque: 412}}\n"
        "effects:\n  a_curve: {use: friction.stribeck, on: a}\n",
        "robot.yaml:14:3: effects.a_curve: the data sheet of axis 'a' (line 12) makes 'a_curve' too",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_a_sheet_is_told_at_its_place_and_nothing_else(name: str, tmp_path: Path) -> None:
    axis, told = MISTAKES[name]
    with pytest.raises(FileProblems) as refused:
        robot(tmp_path, axis)
    assert str(refused.value).startswith(told)
    assert "\n" not in str(refused.value)


def test_a_gear_that_turns_does_not_fit_a_joint_that_slides(tmp_path: Path) -> None:
    robot(tmp_path, "")
    text = (tmp_path / "robot.yaml").read_text().replace("{joint: a,", "{joint: a, type: prismatic,")
    (tmp_path / "robot.yaml").write_text(text + "    gear: {data_sheet: {K_nm_per_arcmin: 108}}\n")
    with pytest.raises(FileProblems, match=r"^robot.yaml:12:5: axes.a.gear: joint 'a' is prismatic"):
        read_description(tmp_path / "robot.yaml")
