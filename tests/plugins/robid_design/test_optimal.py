"""design.optimal weighs the candidates at the robot that the fit found, effects and all."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from robid_core import Design, Excitation, Fit, Frf, Robot
from robid_core.testing import check_stage, example_artifacts, example_context, example_fit
from robid_design.optimal import OptimalDesign

SETTINGS = OptimalDesign(candidates=12, experiments=2, lines=5)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("one_axis")


@pytest.fixture(scope="module")
def excitation(robot: Robot) -> Excitation:
    found = example_artifacts(robot)[Excitation]
    assert isinstance(found, Excitation)
    return found


def chosen(robot: Robot, excitation: Excitation, fit: Fit | None = None, frf: Frf | None = None) -> Design:
    return SETTINGS.run(excitation, robot, example_context(), fit, frf)


def test_one_axis_of_which_all_poses_are_nearly_alike_has_a_design() -> None:
    check_stage(OptimalDesign, for_axes=(1,), candidates=50, experiments=4)


def test_candidates_are_weighed_at_the_robot_of_the_fit(robot: Robot, excitation: Excitation) -> None:
    whole = robot.description.model_dump()
    whole["effects"] = {"tool": {"use": "load.payload", "on": "axis_1", "with": {"mass": 8.0, "z": 0.5}}}
    loaded = dataclasses.replace(robot, description=type(robot.description).model_validate(whole))
    values = {
        "gear_stiffness.axis_1": 6e4,
        "effect.tool.mass": 10.0,
    }  # an effect that the robot lacks is added
    fit = example_fit(robot).replace(model=loaded.model(values))
    found = chosen(robot, excitation, fit)
    right = chosen(loaded.with_parameters(values), excitation)
    np.testing.assert_array_equal(found.information, right.information)
    np.testing.assert_array_equal(found.candidate_index, right.candidate_index)
    lighter = chosen(robot.with_parameters({"gear_stiffness.axis_1": 6e4}), excitation)
    assert not np.allclose(found.information, lighter.information, rtol=1e-3)


def test_a_fit_that_estimated_no_springs_states_no_errors_of_springs(
    robot: Robot, excitation: Excitation
) -> None:
    fit = example_fit(robot)
    rows = np.array(["damping" in name for name in fit.parameters.names])
    names = tuple(name for name, kept in zip(fit.parameters.names, rows, strict=True) if kept)
    table = fit.parameters.select("n_parameter", rows).replace(
        names=names, units=("",) * len(names), groups=("",) * len(names)
    )
    frf = example_artifacts(robot)[Frf]
    assert isinstance(frf, Frf)
    dampers = fit.replace(parameters=table, model=robot.model(table.as_mapping()))
    with_fit = chosen(robot, excitation, dampers, frf).predicted_standard_error
    np.testing.assert_allclose(
        with_fit, chosen(robot, excitation, None, frf).predicted_standard_error, rtol=1e-9
    )
