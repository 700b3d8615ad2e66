"""The table of a robot's numbers: each with its unit, and of what was estimated the fit's covariance."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest
from oracles.robots import changed

from robid_core import ConfigurationError, Robot
from robid_core.robot.parameter_table import parameter_table

FREE = ("gear_stiffness.axis_3", "friction.axis_3.coulomb", "mass.axis_4")
COVARIANCE = np.array([[4e6, -30.0, np.nan], [-30.0, 1e-4, np.nan], [np.nan, np.nan, np.nan]])


def test_csv_and_json_hold_every_number_and_its_covariance() -> None:
    robot = Robot.load("scara").with_parameters({"gear_stiffness.axis_3": 3.9e5})
    model = Robot.load("scara").model({name: robot.parameter(name) for name in FREE}, FREE, COVARIANCE)
    rows = list(csv.DictReader(io.StringIO(parameter_table(robot, model, ".csv"))))
    told = json.loads(parameter_table(robot, model, ".json"))
    assert [row["name"] for row in rows] == [row["name"] for row in told["parameters"]] == list(robot.layout)
    for row, entry in zip(rows, told["parameters"], strict=True):
        assert float(row["value"]) == entry["value"] == robot.parameter(entry["name"])
        assert row["unit"] == entry["unit"] == robot.parameter_unit(entry["name"])
    known = {row["name"]: row for row in rows}
    assert known["gear_stiffness.axis_3"]["unit"] == "N/m"
    assert float(known["gear_stiffness.axis_3"]["standard_error"]) == 2000.0
    assert known["mass.axis_4"]["standard_error"] == known["mass.axis_1"]["standard_error"] == ""
    assert (
        float(known[FREE[0]][f"covariance.{FREE[1]}"])
        == float(known[FREE[1]][f"covariance.{FREE[0]}"])
        == -30.0
    )
    assert known["mass.axis_1"][f"covariance.{FREE[0]}"] == known[FREE[0]]["covariance.mass.axis_4"] == ""
    assert told["covariance"]["names"] == list(FREE)
    matrix = np.array(told["covariance"]["matrix"], dtype=float)
    np.testing.assert_array_equal(matrix, COVARIANCE)
    assert told["sha256"] == robot.sha256


def test_a_robot_that_no_fit_found_has_no_errors() -> None:
    robot = Robot.load("one_axis")
    told = json.loads(parameter_table(robot, None, ".json"))
    assert told["covariance"] == {"names": [], "matrix": []}
    assert all(row["standard_error"] is None for row in told["parameters"])
    with pytest.raises(ConfigurationError, match="a table goes into .csv or .json, not into '.txt'"):
        parameter_table(robot, None, ".txt")


def test_units_on_a_slide_are_those_of_a_screw_or_of_a_linear_motor() -> None:
    """Behind a screw the motor turns; with a ratio of one it slides with its carriage."""
    screw = Robot.load("scara")
    assert screw.parameter_unit("gear_ratio.axis_3") == "rad/m"
    assert (
        screw.parameter_unit("rotor_inertia.axis_3")
        == screw.parameter_unit("rotor_inertia.axis_1")
        == "kg m^2"
    )
    assert screw.parameter_unit("torque_limit.axis_3") == "N m"
    assert screw.parameter_unit("gear_damping.axis_3") == "N s/m"
    linear = changed(screw, every_axis={"gear_ratio": 1.0})
    assert linear.parameter_unit("gear_ratio.axis_3") == "1"
    assert linear.parameter_unit("rotor_inertia.axis_3") == "kg"
    assert linear.parameter_unit("torque_limit.axis_3") == "N"
