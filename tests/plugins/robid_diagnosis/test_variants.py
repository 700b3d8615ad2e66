"""Records of several payloads in one diagnosis, and experiments of the role test that only its last judgement sees."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from robid_core import (
    Channel,
    ConfigurationError,
    Context,
    DataRejected,
    DenseRun,
    Diagnosis,
    Finding,
    FloatArray,
    Record,
    Robot,
)
from robid_core.residual import check_variants
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects
from robid_diagnosis.variants import Variants

PERIOD, T = 2000, 1e-3
LINES = np.unique(2 * np.round((np.geomspace(3.0, 80.0, 50) * PERIOD * T - 1) / 2).astype(int) + 1)
TOLD_KG, AT_M = 10.0, 1.0
POSES = np.array([[-1.1], [-0.4], [0.6]])
BY_LOAD = {"coulomb": 0.0, "load_coulomb": 0.04, "load_excess": 0.0}
OFF = {"gear_stiffness.axis_1": 6e4, "gear_damping.axis_1": 50.0, "friction.axis_1.coulomb": 0.62}


@pytest.fixture(scope="module")
def told() -> Robot:
    return Robot.load("one_axis")


@pytest.fixture(scope="module")
def loaded_file(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The robot file of the variant: the nominal one and what it carries."""
    path = tmp_path_factory.mktemp("robots") / "loaded.yaml"
    tool = f"tool: {{use: load.payload, on: axis_1, with: {{mass: {TOLD_KG}, z: {AT_M}}}}}"
    path.write_text(f"robid_robot: 1\nname: loaded\nbase: one_axis\neffects:\n  {tool}\n", encoding="utf-8")
    return str(path)


def carrying(robot: Robot, mass: float) -> Robot:
    return robot.with_effect("tool", "load.payload", "axis_1", values={"mass": mass, "z": AT_M})


def measured(plants: tuple[Robot, ...], poses: FloatArray, seed: int) -> Record:
    """Two experiments of two periods of each plant in each pose: a multisine on a slow sine, in closed loop.

    With two plants the second is the variant "loaded".
    """
    generator, time = np.random.default_rng(seed), T * np.arange(PERIOD)
    angle, torque = [], []
    for number, plant in enumerate(plants):
        start = np.repeat(poses, 2, axis=0)
        reference = np.zeros((len(start), PERIOD, 1))
        for lane in reference:
            phase = generator.uniform(0, 2 * np.pi, len(LINES))
            wave = np.cos(2 * np.pi * np.outer(time, LINES / (PERIOD * T)) + phase).sum(axis=1)
            lane[:, 0] = 4 * wave / wave.std() + 10 * np.sin(2 * np.pi * time / (PERIOD * T) + phase[0])
        run = plant.simulate(np.tile(reference, (1, 3, 1)), start, seed=seed + number)
        shape = (len(poses), 1, 2, 2, PERIOD, 1)
        angle.append(run.position[:, PERIOD:].reshape(shape))
        torque.append(run.torque[:, PERIOD:].reshape(shape))
    channels = {
        "motor_position": Channel("motor", "rad", np.concatenate(angle)),
        "motor_torque": Channel("motor", "N m", np.concatenate(torque)),
    }
    n_config = len(plants) * len(poses)
    dense = DenseRun(T, channels, time, np.ones((n_config, 1, 2, 2, PERIOD), dtype=bool))
    names = tuple(np.repeat(("bare", "loaded"), len(poses)).tolist()) if len(plants) > 1 else ()
    everywhere = np.tile(poses, (len(plants), 1))
    return Record(
        plants[0].axis_names, "simulated", "zero_order_hold", (dense,), everywhere, line=LINES, variants=names
    )


def diagnosed(records: tuple[Record, ...], robot: Robot, **settings: object) -> Diagnosis:
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    return Effects.model_validate(settings).run(records, robot, context)


def test_a_law_that_acts_under_both_payloads_is_found_once(told: Robot, loaded_file: str) -> None:
    """Every configuration of either variant shows it; the extended robot has the law and not the other's load."""
    plant = told.with_parameters(OFF).with_effect(
        "hidden", "friction.load_dependent", "axis_1", values=BY_LOAD
    )
    record = measured((plant, carrying(plant, TOLD_KG)), POSES, 3)
    diagnosis = diagnosed((record,), told, robots={"loaded": loaded_file})
    (finding,) = diagnosis.findings
    assert (finding.kind, finding.effect, finding.on) == ("cause", "friction.load_dependent", "axis_1")
    assert finding.n_seen == 2 * len(POSES)
    (size,), (error,) = finding.value, finding.standard_error
    assert abs(size - BY_LOAD["load_coulomb"]) < max(4 * error, 0.02 * size)
    assert diagnosis.model is not None
    extended = Robot.of_model(diagnosis.model)
    assert [entry.use for entry in extended.description.effects.values()] == ["friction.load_dependent"]
    assert extended.parameter("gear_stiffness.axis_1") == pytest.approx(
        OFF["gear_stiffness.axis_1"], rel=1e-3
    )


@pytest.mark.parametrize(
    ("true_kg", "wrong"), [(14.0, True), pytest.param(10.1, False, marks=pytest.mark.full)]
)
def test_a_load_that_is_told_wrong_is_a_value_of_its_variant(
    told: Robot, loaded_file: str, true_kg: float, wrong: bool
) -> None:
    """Neither friction nor a gain takes its place; what a scale may be off by is no finding, and bends no spring."""
    plant = told.with_parameters(OFF)
    records = (
        measured((plant,), POSES, 5),
        measured((carrying(plant, true_kg),), POSES, 6).replace(variants=("loaded",) * len(POSES)),
    )
    diagnosis = diagnosed(records, told, robots={"loaded": loaded_file})
    assert [(f.kind, f.effect, f.on) for f in diagnosis.findings] == [("value", "load", "tool")] * wrong
    if wrong:
        mass = number(diagnosis.findings[0], "effect.tool.mass")
        assert mass[0] == TOLD_KG
        assert abs(mass[1] - true_kg) < 4 * mass[2] < 0.1 * true_kg
        assert "wrong value: load of tool (effect.tool.mass 14" in diagnosis.verdict
    assert diagnosis.model is not None
    spring = Robot.of_model(diagnosis.model).parameter("gear_stiffness.axis_1")
    assert spring == pytest.approx(OFF["gear_stiffness.axis_1"], rel=2e-3)


def number(finding: Finding, name: str) -> tuple[float, float, float]:
    """Told, found, standard error."""
    i = finding.names.index(name)
    return float(finding.nominal[i]), float(finding.value[i]), float(finding.standard_error[i])


def test_experiments_of_the_role_test_judge_and_are_not_looked_at(told: Robot) -> None:
    """With other test experiments the diagnosis is the same to the last digit, and only its judgement another."""
    plant = told.with_parameters(OFF).with_effect(
        "hidden", "friction.load_dependent", "axis_1", values=BY_LOAD
    )
    record = measured((plant,), np.vstack([POSES, [[1.0]]]), 7)
    run = record.run
    test = np.zeros((4, 1, 2), dtype=bool)
    test[3] = True
    torque = run.values("motor_torque").copy()
    torque[3] *= 1.05
    spoilt = Channel("motor", "N m", torque)
    asked = {"only": ("friction.load_dependent",), "most": 1}
    first, second = (
        diagnosed(
            (record.replace(runs=(run.replace(channels={**run.channels, "motor_torque": one}, test=test),)),),
            told,
            **asked,
        )
        for one in (run.channel("motor_torque"), spoilt)
    )
    assert all("experiments of the role test" in row.quantity for row in (*first.errors, *second.errors))
    assert first.data is not None
    assert (first.data.n_config, first.data.n_experiment, first.data.n_test) == (3, 6, 2)
    assert "Data: 6 experiments in 3 configurations" in first.verdict
    assert "2 experiments held out" in first.verdict
    (finding,), (again,) = first.findings, second.findings
    assert finding.n_seen == len(POSES)
    assert np.array_equal(finding.value, again.value)
    told_first, told_second = (one.verdict.split("\n")[0] for one in (first, second))
    assert told_first == told_second
    before, after = (float(row.relative[0]) for row in first.errors)
    assert after < 0.3 * before
    assert float(second.errors[1].relative[0]) > 0.03 > 3 * after


def test_test_experiments_alone_are_no_data(told: Robot) -> None:
    record = measured((told,), POSES, 9)
    every = record.replace(runs=(record.run.replace(test=np.ones((3, 1, 2), dtype=bool)),))
    with pytest.raises(DataRejected, match="all experiments have the role test"):
        diagnosed((every,), told)


def test_a_variant_that_is_not_told_is_refused(told: Robot, loaded_file: str) -> None:
    """So are robots that nothing was measured under, and a number that all share and one tells otherwise."""
    record = measured((told, carrying(told, TOLD_KG)), POSES, 11)
    with pytest.raises(ConfigurationError, match="give the robot of each that is not the nominal one"):
        diagnosed((record,), told)
    with pytest.raises(ConfigurationError, match="nothing was measured as 'heavy'"):
        diagnosed((record,), told, robots={"heavy": loaded_file})
    other = told.with_parameters({"mass.axis_1": 55.0})
    with pytest.raises(ConfigurationError, match=r"mass.axis_1 is free and shared, but has another value"):
        check_variants((record,), told, {"loaded": other}, ("mass.axis_1",))


def test_a_label_means_one_load_in_all_variants(told: Robot) -> None:
    """Two tools of one name have unknowns of their own, believed alike: a percent of the mass, 5 mm of the place."""
    variants = Variants(told, {"heavy": carrying(told, 8.0), "light one": carrying(told, 4.0)})
    assert variants.loads == ("tool", "tool_light_one")
    assert variants.whole.parameter("effect.tool_light_one.mass") == 4.0
    assert variants.robot_of("light one").parameter("effect.tool_light_one.mass") == 4.0
    assert variants.robot_of("bare") is told
    for label in variants.loads:
        assert variants.priors[f"effect.{label}.mass"] == pytest.approx(0.01)
        assert variants.priors[f"effect.{label}.z"] * AT_M == pytest.approx(0.005)
    same = Variants(carrying(told, 8.0), {"again": carrying(told, 8.0)})
    assert same.loads == ()
    assert not same.priors
