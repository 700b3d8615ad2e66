"""Effects hidden in simulated drives, and the diagnosis that has to name them; data without an effect; wrong input."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

import robid_core as robid
from robid_core import (
    Channel,
    ConfigurationError,
    Context,
    DataRejected,
    Diagnosis,
    Record,
    RobidError,
    Robot,
)
from robid_core.stage import map_in_process
from robid_core.testing import check_stage, example_record
from robid_core.testing.diagnoses import CAUSE, NEAR, with_cause
from robid_core.testing.robots import example_robot
from robid_diagnosis.effects import Effects
from robid_diagnosis.wording import place_text

Values = Mapping[str, float]
Plants = Callable[[Robot, int], Robot]
Measured = Callable[..., Record]


def diagnosed(record: Record, robot: Robot, **settings: object) -> Diagnosis:
    """Diagnose, without the experiments for ties, which have tests of their own."""
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    stage = Effects.model_validate({"separate": False} | settings)
    return stage.run((record,), robot, context)


BY_LOAD = {"coulomb": 0.0, "load_coulomb": 0.04, "load_excess": 0.0}
PEDESTAL = {"stiffness_x": 2e6, "stiffness_y": 2e6, "damping_x": 1e3, "damping_y": 1e3, "mass": 20.0}
HIDDEN: dict[str, tuple[str, Values, str]] = {
    "load-dependent": ("friction.load_dependent", BY_LOAD, "load_coulomb"),
    "gear": ("transmission.kinematic_error", {"amplitude": 4e-5, "order": 2.0, "phase": 0.7}, "amplitude"),
    "lag": ("drive.current_loop", {"time_constant": 1e-3, "delay": 0.0}, "time_constant"),
    "pedestal": ("structure.foundation_sway", PEDESTAL, "stiffness_x"),
}  # fmt: skip


@pytest.mark.parametrize(
    "case",
    [
        "load-dependent",
        pytest.param("gear", marks=pytest.mark.full),
        pytest.param("lag", marks=pytest.mark.full),
        pytest.param("pedestal", marks=pytest.mark.full),
    ],
)
def test_a_hidden_effect_is_named_and_sized(
    told: Robot, plant_of: Plants, measured: Measured, case: str, caplog: pytest.LogCaptureFixture
) -> None:
    """First and alone, its size within four standard errors and 5 %; the extended robot leaves only noise."""
    caplog.set_level(logging.INFO)
    use, values, name = HIDDEN[case]
    on = "base" if case == "pedestal" else "axis_1"
    plant = plant_of(told, 3).with_effect("hidden", use, on, values=values)
    diagnosis = diagnosed(measured(plant, 4), told)
    (finding,) = diagnosis.findings
    assert (finding.kind, finding.effect, finding.on) == ("cause", use, on)
    assert finding.n_seen >= 3
    assert finding.held_out.sum() > 0
    i = finding.names.index(name)
    off = abs(finding.value[i] - values[name])
    assert off < 4 * finding.standard_error[i] or off < 0.02 * values[name]
    assert off < 0.05 * values[name]
    if case == "gear":  # drawn where it acts, a whole wave as high as the gear is stiff
        assert finding.explained is not None
        height = diagnosis.values.as_mapping()["gear_stiffness.axis_1"] * finding.value[i]
        assert np.ptp(finding.explained) / 2 == pytest.approx(
            height, rel=0.05
        )  # means over 1/48 turn: 1 % less
        assert np.abs(finding.residual - finding.explained).max() < 0.1 * height
    before, after = (errors.relative[0] for errors in diagnosis.errors)
    assert after < 0.6 * before
    noise = diagnosis.errors[-1].noise
    assert noise is not None  # of 300 bins in 8 experiments, by differences of two periods each: good to 2 %
    assert after == pytest.approx(noise[0], rel=0.1)
    assert f"noise alone leaves {100 * noise[0]:.3g} %" in diagnosis.verdict
    assert diagnosis.model is not None
    extended = Robot.of_model(diagnosis.model)
    assert [entry.use for entry in extended.description.effects.values()] == [use]
    course = (one.getMessage() for one in caplog.records if one.module == "search_log")
    refitted, first, named, left, again, ended, rest = (
        line for line in course if not line.startswith("not named")
    )
    assert refitted.startswith("all values refitted: misfit ")
    assert f": {place_text(use, on, finding.side)} gains " in first
    assert named.startswith(f"named {place_text(use, on, finding.side)}: twice the log-likelihood rises by ")
    assert left.startswith("causes: 1, misfit ")
    assert again.split(":")[0] == first.split(":")[0]
    assert ended == "nothing more is named"
    assert rest.startswith("left to do: ")


def test_a_limit_that_one_configuration_reaches_is_named_and_said_to_be_seen_there(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """Between the largest torques of two poses; what the others lack is no error of it."""
    plant = plant_of(told, 15)
    torque = np.abs(measured(plant, 16).run.values("motor_torque"))
    *_, second, first = np.sort(torque.max(axis=tuple(range(1, torque.ndim))))
    limit = {"limit": 0.3 * first + 0.7 * second}
    diagnosis = diagnosed(
        measured(plant.with_effect("hidden", "drive.saturation", "axis_1", values=limit), 16), told
    )
    (finding,) = diagnosis.findings
    assert (finding.kind, finding.effect, finding.names) == ("cause", "drive.saturation", ("limit",))
    assert abs(finding.value[0] - limit["limit"]) < 4 * finding.standard_error[0] < 0.05 * limit["limit"]
    assert finding.n_seen == 1
    assert "seen in 1 of 4 configurations" in diagnosis.verdict


def test_what_only_one_configuration_shows_though_all_move_is_no_cause(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """A weak ripple of the motor angle in one configuration: its size differs, and that is told as a failure."""
    record = measured(plant_of(told, 17), 18)
    (run,) = record.runs
    torque = run.values("motor_torque").copy()
    angle = run.values("motor_position")
    torque[1] += 0.0045 * np.cos(7 * angle[1] + 0.4)
    channels = dict(run.channels) | {"motor_torque": Channel("motor", "N m", torque)}
    diagnosis = diagnosed(replace(record, runs=(replace(run, channels=channels),)), told)
    assert {finding.kind for finding in diagnosis.findings} <= {"unknown"}
    assert diagnosis.search is not None
    assert any("differs between configurations" in reason for reason in diagnosis.search.failed)


@pytest.mark.full
@pytest.mark.parametrize("only", [("drive.torque_ripple",), ()])
def test_several_waves_of_one_kind_are_named_at_one_axis(
    told: Robot, plant_of: Plants, measured: Measured, only: tuple[str, ...]
) -> None:
    """Ripple of three orders: each is half of what free waves explain or less, and each is a cause."""
    plant, amplitude = plant_of(told, 51), {4.0: 0.012, 8.0: 0.012, 11.0: 0.010}
    for order, size in amplitude.items():
        values = {"amplitude": size, "order": order, "phase": 0.3 * order}
        plant = plant.with_effect(f"wave_{order:.0f}", "drive.torque_ripple", "axis_1", values=values)
    findings = diagnosed(measured(plant, 52), told, only=only).findings
    assert {finding.kind for finding in findings} == {"cause"}
    found = {
        round(values["order"][0]): values["amplitude"]
        for one in findings
        for values in [dict(zip(one.names, zip(one.value, one.standard_error, strict=True), strict=True))]
    }
    assert set(found) == set(amplitude)
    for order, (value, error) in found.items():
        assert abs(abs(value) - amplitude[order]) < 4 * error < 0.1 * amplitude[order]


def test_cogging_of_many_periods_a_turn_is_named(told: Robot, plant_of: Plants, measured: Measured) -> None:
    """Twelve slots and nine pole pairs: 36 periods a turn, beside a wave of the teeth's own order."""
    plant, amplitude = plant_of(told, 55), {12.0: 0.012, 36.0: 0.010}
    for order, size in amplitude.items():
        values = {"amplitude": size, "order": order, "phase": 0.4}
        plant = plant.with_effect(f"wave_{order:.0f}", "drive.cogging", "axis_1", values=values)
    findings = diagnosed(measured(plant, 56), told, only=("drive.cogging",)).findings
    assert {finding.kind for finding in findings} == {"cause"}
    assert {round(dict(zip(one.names, one.value, strict=True))["order"]) for one in findings} == {12, 36}
    for one in findings:
        values = dict(zip(one.names, zip(one.value, one.standard_error, strict=True), strict=True))
        size, error = values["amplitude"]
        assert abs(size - amplitude[round(values["order"][0])]) < 4 * error < 0.1 * size


@pytest.mark.full
def test_friction_that_turns_much_sooner_than_told_is_no_cause(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """A fifth of the told zero-speed width, which most robot files leave at its default: the width is found."""
    width = 0.2 * told.parameter("friction.axis_1.speed")
    diagnosis = diagnosed(
        measured(plant_of(told, 53).with_parameters({"friction.axis_1.speed": width}), 54), told
    )
    assert diagnosis.findings == ()
    assert diagnosis.model is not None
    found = Robot.of_model(diagnosis.model).parameter("friction.axis_1.speed")
    assert abs(found - width) < 0.1 * width


@pytest.mark.full
def test_hysteresis_is_named_and_what_cannot_be_told_from_it(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """Maxwell's slip and the law of Bouc and Wen draw nearly the same loops: either may be named, both are.

    As a part: its fit ends beside the minimum (a spread of 2.4 for 10, misfit 1.04), and more than noise is left.
    """
    plant = plant_of(told, 3).with_effect(
        "hidden", "transmission.maxwell_slip", "axis_1", values={"stiffness": 5e3, "torque": 2.0}
    )
    (finding,) = diagnosed(measured(plant, 4), told).findings
    assert (finding.kind, finding.on, finding.side) == ("partial", "axis_1", "gear")
    assert any("transmission.maxwell_slip" in name for name in (finding.effect, *finding.ties))


def test_nothing_is_found_where_nothing_is_hidden(told: Robot, plant_of: Plants, measured: Measured) -> None:
    """Springs and friction a third off are values that the refit finds, no findings."""
    diagnosis = diagnosed(measured(plant_of(told, 5), 6), told)
    assert diagnosis.findings == ()
    assert "Nothing significant" in diagnosis.verdict


def test_a_wrong_torque_constant_is_no_wrong_rotor_and_body(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """Eight percent of torque look like springs, rotor and body that are all eight percent off; tolerances tell it."""
    plant = plant_of(told, 13).with_effect(
        "hidden", "drive.torque_constant", "axis_1", values={"error": 0.08}
    )
    diagnosis = diagnosed(measured(plant, 14), told)
    (finding,) = diagnosis.findings
    assert (finding.kind, finding.effect) == ("cause", "drive.torque_constant")
    assert abs(finding.value[0] - 0.08) < 4 * finding.standard_error[0] < 0.04
    assert "without it parameters of the robot file would leave their tolerances" in diagnosis.verdict


def test_a_cause_that_the_catalogue_lacks_is_unknown(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """With the law and the like loss of the motor taken out no other takes its name; what it depends on is told."""
    plant = plant_of(told, 7).with_effect("hidden", "friction.load_dependent", "axis_1", values=BY_LOAD)
    diagnosis = diagnosed(measured(plant, 8), told, exclude=("friction.load_dependent", "drive.core_loss"))
    assert [finding.kind for finding in diagnosis.findings] == ["unknown"]
    assert diagnosis.findings[0].effect == "a function of load and speed"


@pytest.mark.full
def test_waves_that_stand_in_for_one_that_the_catalogue_lacks_are_parts_of_a_cause(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """A wave of the gear is one of the encoder and one of the torque together, both of its order: neither is there."""
    wave = {"amplitude": 4e-5, "order": 2.0, "phase": 0.7}
    plant = plant_of(told, 3).with_effect("hidden", "transmission.kinematic_error", "axis_1", values=wave)
    findings = diagnosed(measured(plant, 4), told, exclude=("transmission.kinematic_error",)).findings
    assert findings
    assert {finding.kind for finding in findings} <= {"partial", "unknown"}


def test_what_little_a_wrong_law_leaves_is_told_though_all_data_look_like_noise(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """A swaying base stands in for a stiffening spring of the gear; what depends on its deflection is left."""
    harder = {"cubic": 9e7}
    plant = plant_of(told, 3).with_effect("hidden", "transmission.stiffening", "axis_1", values=harder)
    diagnosis = diagnosed(measured(plant, 4), told, only=("structure.foundation_sway",))
    assert [finding.kind for finding in diagnosis.findings] == ["partial", "unknown"]
    assert diagnosis.findings[1].effect == "a function of gear deflection"


def test_a_heavier_arm_is_a_wrong_value(told: Robot, plant_of: Plants, measured: Measured) -> None:
    """Five standard deviations of what is believed of drawings; no effect takes its place."""
    plant = plant_of(told, 9).with_parameters({"mass.axis_1": 1.25 * told.parameter("mass.axis_1")})
    diagnosis = diagnosed(measured(plant, 10), told)
    (finding,) = diagnosis.findings
    assert (finding.kind, finding.effect, finding.on) == ("value", "body", "axis_1")


def test_where_a_reference_was_recorded_the_closed_loop_is_judged_where_nothing_was_fitted(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """Springs and friction a third off are seen in the motion; refitted, only the encoder's noise is left of it."""
    record = measured(plant_of(told, 3), 4, 6, with_reference=True)
    test = np.zeros(record.run.valid.shape[:3], dtype=bool)
    test[4:] = True
    kept_apart = record.replace(runs=(record.run.replace(test=test),))
    asked = {"only": ("friction.stribeck",), "most": 0}
    diagnosis = diagnosed(kept_apart, told, **asked)
    before, after = (one for one in diagnosis.errors if one.quantity.startswith("speed in closed loop"))
    assert (before.model, after.model) == ("robot file", "robot file, values refitted")
    assert before.quantity.endswith("experiments of the role test")
    assert before.relative[0] > 30 * after.relative[0]
    assert before.low[0] < before.relative[0] < before.high[0]
    wild = told.with_parameters(
        {"controller.axis_1.speed_gain": 1e3 * told.parameter("controller.axis_1.speed_gain")}
    )
    assert "The closed loop could not be simulated: " in diagnosed(kept_apart, wild, **asked).verdict
    with pytest.raises(RobidError):
        diagnosed(kept_apart, wild, closed_loop=True, **asked)
    assert len(diagnosed(kept_apart, told, closed_loop=False, **asked).errors) == 1


def test_wrong_input_is_one_sentence(told: Robot, plant_of: Plants, measured: Measured) -> None:
    record = measured(plant_of(told, 5), 6, n_config=1)
    with pytest.raises(
        DataRejected, match="2 experiments: what is found must hold in data that were held out"
    ):
        diagnosed(record, told)
    with pytest.raises(
        DataRejected, match="the record has the axes axis_1, the robot six_axis has axis_1, axis_2"
    ):
        diagnosed(record, Robot.load("six_axis"))
    (run,) = measured(plant_of(told, 5), 6).runs
    angle = run.channel("motor_position")
    held = replace(angle, values=np.broadcast_to(angle.values[..., :1, :1, :], angle.values.shape))
    stuck = run.replace(channels={**run.channels, "motor_position": held})
    with pytest.raises(
        DataRejected, match="the angle of axis_1 does not change by more than a count in any experiment"
    ):
        diagnosed(measured(plant_of(told, 5), 6).replace(runs=(stuck,)), told)
    with pytest.raises(
        ConfigurationError,
        match="only: 'friction.dahl@axis_9' could be tried nowhere: of one_axis it can be at axis_1",
    ):
        diagnosed(measured(plant_of(told, 5), 6), told, only=("friction.dahl@axis_9",), passes=1)
    with pytest.raises(
        ConfigurationError, match="no effect 'friction.stribek'; did you mean 'friction.stribeck'"
    ):
        diagnosed(record, told, only=("friction.stribek",))


def test_what_was_asked_for_and_gains_more_than_chance_is_told_with_why_it_is_not_named(
    told: Robot, plant_of: Plants, measured: Measured
) -> None:
    """A little load-dependent friction: beyond chance, and less than a cause has to gain."""
    little = {"coulomb": 0.0, "load_coulomb": 0.0012, "load_excess": 0.0}
    plant = plant_of(told, 5).with_effect("hidden", "friction.load_dependent", "axis_1", None, little)
    diagnosis = diagnosed(measured(plant, 6), told, only=("friction.load_dependent",), model_error=5e-4)
    assert not diagnosis.findings
    own = next(line for line in diagnosis.verdict.splitlines() if "axis_1 (motor): p = " in line)
    assert float(own.split("p = ")[1].split(",")[0]) < 1e-3
    gain = float(own.split("rises by ")[1].split()[0].rstrip(";.,"))
    assert gain < float(own.split("not named: fitted with all values it gains less than ")[1].rstrip("."))
    assert "Nothing significant" not in diagnosis.verdict
    assert "gains more than chance, and not enough" in diagnosis.verdict


def test_the_stage_keeps_the_contract(told: Robot, plant_of: Plants, measured: Measured) -> None:
    """The same bytes twice, inputs left alone, settings that survive YAML; one law, of which nothing is hidden."""
    record = measured(plant_of(told, 5), 6)
    check_stage(
        Effects,
        for_axes=(1,),
        artifacts=lambda robot: {Record: record.replace(axis_names=robot.axis_names)},
        recovery=False,  # the record is of a plant of this file, whatever the robot
        only=("friction.asymmetric",),
        most=0,
        passes=3,
    )


@pytest.mark.parametrize("n_axis", [1, 2])
def test_it_names_the_cause_that_the_contract_kit_plants(n_axis: int) -> None:
    """Alone, with its place, and its size within 3.3 stated errors, as `check_stage` asks of no other diagnosis."""
    robot = example_robot(n_axis)
    plant = with_cause(robot)
    record = example_record(plant, seed=1, within=NEAR)
    (found,) = robid.use("diagnosis.effects")(record, robot).findings
    assert (found.kind, found.effect, found.where) == ("cause", CAUSE, f"{robot.axis_names[0]} (motor)")
    index = found.names.index("coulomb_forwards")
    true = plant.parameters()["effect.planted.coulomb_forwards"]
    assert abs(found.value[index] - true) < 3.3 * found.standard_error[index]
