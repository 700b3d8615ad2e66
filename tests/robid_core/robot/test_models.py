"""Models of robots: what a fit gives back makes the fitted robot again, from any robot, without its file."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from robid_core import ConfigurationError, DataRejected, Fit, Model, ParameterTable, Robot
from robid_core.testing import example_fit, example_robot

FOUND = {"gear_stiffness.axis_1": 61234.5678901234, "friction.axis_1.coulomb": 0.1 + 0.2}
GREASE = "effects:\n  grease: {use: friction.stribeck, on: axis_1}  # thick in winter\n"


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    """One axis with an effect, from a file of the user's."""
    (tmp_path / "robot.yaml").write_text(f"robid_robot: 1\nname: greased\nbase: one_axis\n{GREASE}")
    return Robot.load("robot.yaml", tmp_path)


def kept(model: Model, folder: Path) -> Model:
    """The model as another run finds it."""
    model.write(folder / "model.h5")
    return Model.read(folder / "model.h5")


def fit_of(model: Model | None, values: dict[str, float]) -> Fit:
    n = len(values)
    table = ParameterTable(
        tuple(values), ("",) * n, ("",) * n, np.zeros(n), np.array(list(values.values())), np.ones(n),
        np.ones(n, dtype=bool), np.zeros(n, dtype=bool),
    )  # fmt: skip
    return Fit("test", "converged", True, 1.0, 1, 1, table, np.eye(n), tuple(values), model=model)


def test_a_model_makes_the_fitted_robot_again_without_its_file(robot: Robot, tmp_path: Path) -> None:
    values = {**FOUND, "effect.grease.breakaway": 1.25}  # freed, though the file leaves it at the default
    model = kept(robot.model(values), tmp_path)
    (tmp_path / "robot.yaml").unlink()
    back, fitted = Robot.of_model(model), robot.with_parameters(values)
    assert back == fitted
    angle = np.array([0.3])
    for name in ("a", "b", "c", "d"):
        np.testing.assert_array_equal(
            getattr(back.linearize(angle), name), getattr(fitted.linearize(angle), name)
        )
    reference = 20 * np.sin(2 * np.pi * 5 * np.arange(200) * 0.001)[None, :, None]
    ours, theirs = (r.simulate(reference, np.array([[0.3]])) for r in (back, fitted))
    np.testing.assert_array_equal(ours.position, theirs.position)
    np.testing.assert_array_equal(ours.torque, theirs.torque)
    nominal = robot.simulate(reference, np.array([[0.3]]))
    assert np.abs(nominal.torque - theirs.torque).max() > 1e-3


def test_the_hash_is_that_of_the_base_and_tells_when_its_file_changed(robot: Robot, tmp_path: Path) -> None:
    model = robot.model(FOUND)
    assert (model.base, model.base_sha256) == ("greased", robot.sha256)
    assert Robot.load("robot.yaml", tmp_path).sha256 == model.base_sha256
    path = tmp_path / "robot.yaml"
    path.write_text("# other words, the same robot\n" + path.read_text())
    assert Robot.load("robot.yaml", tmp_path).sha256 == model.base_sha256
    path.write_text(path.read_text() + "parameters: {mass.axis_1: 40.5}\n")
    assert Robot.load("robot.yaml", tmp_path).sha256 != model.base_sha256


def test_the_largest_packaged_robot_fits_into_a_model(tmp_path: Path) -> None:
    robot = Robot.load("six_axis_flex")
    values = {name: 1.1 * robot.parameter(name) for name in robot.spring_names}
    assert Robot.of_model(kept(robot.model(values), tmp_path)) == robot.with_parameters(values)


def test_a_second_fit_counts_from_the_file_and_keeps_what_the_first_found(robot: Robot) -> None:
    first = Robot.of_model(robot.model(FOUND, tuple(FOUND), np.diag([4.0, 9.0])))
    model = first.model(
        {"rotor_inertia.axis_1": 1.3e-3, "gear_stiffness.axis_1": 6e4}, ("rotor_inertia.axis_1",)
    )
    assert model.base_sha256 == robot.sha256
    assert dict(zip(model.names, model.start, strict=True)) == {**FOUND, "rotor_inertia.axis_1": 1.2e-3}
    assert Robot.of_model(model) == robot.with_parameters(
        {**FOUND, "rotor_inertia.axis_1": 1.3e-3, "gear_stiffness.axis_1": 6e4}
    )


def test_standard_errors_are_those_of_the_free_parameters(robot: Robot) -> None:
    model = robot.model(FOUND, ("friction.axis_1.coulomb",), np.array([[0.04]]))
    assert model.standard_errors() == {"friction.axis_1.coulomb": 0.2}


def test_effects_that_a_diagnosis_adds_or_takes_off_are_in_the_model(robot: Robot, tmp_path: Path) -> None:
    whole = robot.description.model_dump()
    whole["effects"] = {"ripple": {"use": "drive.torque_ripple", "on": "axis_1", "with": {"amplitude": 0.2}}}
    changed = dataclasses.replace(robot, description=type(robot.description).model_validate(whole))
    model = kept(changed.model({"effect.ripple.amplitude": 0.25}), tmp_path)
    assert model.base_sha256 == robot.sha256
    back = Robot.of_model(model)
    assert set(back.description.effects) == {"ripple"}
    assert back.parameter("effect.ripple.amplitude") == 0.25
    assert back == changed.with_parameters({"effect.ripple.amplitude": 0.25})


def test_a_robot_that_differs_by_more_than_effects_and_numbers_is_its_own_base(robot: Robot) -> None:
    """Speed limits have no name: no list of names and values brings this one back."""
    axes = {"axis_1": robot.description.axes["axis_1"].model_copy(update={"speed_limit": 300.0})}
    slower = dataclasses.replace(robot, description=robot.description.model_copy(update={"axes": axes}))
    model = slower.model(FOUND)
    assert model.base_sha256 == slower.sha256 != robot.sha256
    assert Robot.of_model(model) == slower.with_parameters(FOUND)


def test_what_a_robot_does_not_have_is_in_no_model(robot: Robot) -> None:
    with pytest.raises(ConfigurationError, match=r"has no parameter gear_stiffness.axis_9"):
        robot.model({"gear_stiffness.axis_9": 1.0})
    with pytest.raises(ConfigurationError, match="must be greater than 0"):
        robot.model({"gear_stiffness.axis_1": -1.0})


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"base_text": "robid_robot: 1\n"}, "not the one that base_sha256 belongs to"),
        ({"names": ("gear_stiffness.axis_1",)}, "1 names have 2 values"),
        ({"free_names": ("mass.axis_1",), "covariance": np.eye(1)}, "mass.axis_1 was estimated and has no value"),
        ({"value": np.array([np.nan, 0.3])}, "NaN"),
        ({"effects": "friction.dahl"}, "effects is no JSON mapping"),
        ({"effects": '{"grease": "friction.dahl"}'}, "effects is no JSON mapping"),
    ],
)  # fmt: skip
def test_a_model_that_does_not_belong_together_is_refused(
    robot: Robot, change: dict[str, object], told: str
) -> None:
    with pytest.raises(DataRejected, match=told):
        robot.model(FOUND).replace(**change)


def test_the_fitted_robot_is_that_of_the_model_or_this_one_with_the_parameters(robot: Robot) -> None:
    assert robot.fitted(fit_of(robot.model(FOUND), FOUND)) == robot.with_parameters(FOUND)
    assert robot.fitted(fit_of(None, FOUND)) == robot.with_parameters(FOUND)
    plain = example_robot(2)  # of no file
    fit = example_fit(plain)
    assert plain.fitted(fit) == plain.with_parameters(fit.parameters.as_mapping())


def test_two_fits_of_different_parameters_go_together(robot: Robot) -> None:
    body, spring = {"mass.axis_1": 41.0}, {"gear_stiffness.axis_1": 6e4}
    first = Robot.of_model(robot.model(body))
    assert first.fitted(fit_of(robot.model(spring), spring)) == robot.with_parameters({**body, **spring})


def test_two_fits_that_disagree_on_a_name_are_one_error(robot: Robot) -> None:
    first = Robot.of_model(robot.model({**FOUND, "mass.axis_1": 41.0}))
    other = {"gear_stiffness.axis_1": 6e4, "friction.axis_1.coulomb": 0.6}
    for model in (robot.model(other), None):
        with pytest.raises(
            ConfigurationError,
            match=r"two fits disagree on gear_stiffness.axis_1 \(61234.6 in the robot, 60000",
        ) as told:
            first.fitted(fit_of(model, other))
        assert "and 1 more; take the robot of one of them" in str(told.value)


def test_a_fit_that_began_at_another_goes_on_from_it(robot: Robot) -> None:
    first = Robot.of_model(robot.model(FOUND))
    better = {"gear_stiffness.axis_1": 6e4}
    fit = fit_of(first.model(better), better)
    expected = robot.with_parameters({**FOUND, **better})
    assert first.fitted(fit) == expected
    assert robot.fitted(fit) == expected


def test_a_fit_of_another_robot_is_refused(robot: Robot) -> None:
    other = Robot.load("six_axis").model({})
    with pytest.raises(
        ConfigurationError, match=r"the fit is of the robot six_axis \(sha256 .*let both take the same"
    ):
        robot.fitted(fit_of(other, {}))
