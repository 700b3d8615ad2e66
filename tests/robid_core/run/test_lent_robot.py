"""`inputs: {robot: fit}`: a stage is lent the robot that a fit found, and follows it."""

from __future__ import annotations

from typing import Any

import pytest

from robid_core import ConfigurationError, Configurations, Diagnosis, Fit, PluginError, Robot

STAGES = """\
  identify: {use: strange.identify}
  told: {use: strange.tell, inputs: {robot: identify}}
  nominal: {use: strange.tell}
"""
HEAD = "robid: 1\nname: strange\nseed: 7\nrobot: one_axis\nstages:\n"


def begin(world: Any, stages: str = STAGES) -> None:
    world.file.write_text(HEAD + stages)


def told(world: Any, stage: str) -> list[float]:
    path = world.folder / "artifacts" / f"{stage}.h5"
    return [float(x) for x in Configurations.read(path).angle[:, 0]]


def test_a_stage_is_lent_the_fitted_robot_and_follows_it(world: Any) -> None:
    begin(world)
    world.run()
    assert told(world, "told") == [6e4, 0]
    assert told(world, "nominal") == [8e4, 0]
    assert world.ran() == ["identify", "tell", "tell"]
    world.run()
    assert world.ran() == []
    world.run("stages.identify.with.stiffness=5e4")
    assert world.ran() == ["identify", "tell"]
    assert told(world, "told") == [5e4, 0]


def test_a_stage_in_a_process_of_its_own_is_lent_the_same(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in world.environment.items():
        monkeypatch.setenv(name, value)
    begin(world)
    world.run(deadline_s=120.0)
    assert told(world, "told") == [6e4, 0]


def test_a_second_fit_begins_at_the_robot_of_the_first_and_counts_from_the_file(world: Any) -> None:
    begin(world, "  identify: {use: strange.identify}\n")
    world.file.write_text(
        world.file.read_text()
        + "  again: {use: strange.identify, inputs: {robot: identify}, with: {stiffness: 5.5e+4}}\n"
        "  told: {use: strange.tell, inputs: {robot: again}}\n"
    )
    world.run()
    model = Fit.read(world.folder / "artifacts" / "again.h5").model
    assert model is not None
    assert model.base_sha256 == Robot.load("one_axis").sha256
    assert (model.start.tolist(), model.value.tolist()) == ([6e4], [5.5e4])
    assert told(world, "told") == [5.5e4, 0]


def test_the_robot_of_a_fit_that_did_not_converge_is_refused_and_the_rest_goes_on(world: Any) -> None:
    begin(world)
    result = world.run("stages.identify.with.converged=false")
    assert result.exit_code == 6
    assert result.outcomes["told"] == "refused"
    assert result.outcomes["nominal"] == "made"
    why = result.manifest.stages["told"].note
    assert why == "its robot is that of 'identify', which must not be used: too few data"


def test_a_fit_without_a_model_lends_no_robot(world: Any) -> None:
    stages = (
        "  where: {use: strange.where}\n  acquire: {use: strange.measure}\n  frf: {use: strange.respond}\n"
        "  fit: {use: strange.estimate}\n  told: {use: strange.tell, inputs: {robot: fit}}\n"
    )
    world.file.write_text(
        HEAD.replace("stages:", "drives: {use: strange}\nstages:")
        + stages.replace("strange.measure", "strange.measure, inputs: {configurations: where}")
    )
    with pytest.raises(
        ConfigurationError, match=r"stage told: its robot is to be that of 'fit', whose Fit holds no m"
    ):
        world.run()


def test_an_effect_that_a_fit_adds_acts_and_counts_in_the_key(world: Any) -> None:
    begin(world)
    result = world.run("stages.identify.with.effect=friction.stribeck")
    assert told(world, "told") == [6e4, 1]
    ingredients = result.manifest.stages["told"].ingredients["robot"]["effects"]
    assert set(ingredients) == {"friction.stribeck"}
    assert "effects" not in result.manifest.stages["nominal"].ingredients["robot"]


def test_an_effect_that_no_stage_names_is_refused(world: Any) -> None:
    begin(world)
    with pytest.raises(
        PluginError, match=r"stage told: the robot of 'identify' has friction.stribeck, which no stage"
    ):
        world.run("stages.identify.with.effect=friction.stribeck", "stages.identify.with.named=false")


def test_two_fits_that_disagree_are_refused_where_both_are_used(world: Any) -> None:
    other = "  other: {use: strange.identify, with: {stiffness: 5.0e+4}}\n"
    explain = "  explain: {use: strange.explain, inputs: {robot: identify, fit: other}}\n"
    begin(world, "  identify: {use: strange.identify}\n" + other + explain)
    with pytest.raises(ConfigurationError) as told:
        world.run()
    assert str(told.value) == (
        "stage explain: two fits disagree on gear_stiffness.axis_1 (60000 in the robot, 50000 in the fit); take the "
        "robot of one of them, or let the second begin at the first by `inputs: {robot: ...}`"
    )
    begin(
        world,
        "  identify: {use: strange.identify}\n"
        + other.replace("with", "inputs: {robot: identify}, with")
        + explain,
    )
    world.run()
    model = Diagnosis.read(world.folder / "artifacts" / "explain.h5").model
    assert model is not None
    assert dict(zip(model.names, model.value, strict=True))["gear_stiffness.axis_1"] == 5e4
