"""compensate.ripple on simulated robots with friction: ripple found and taken off, nothing where there is none."""

from __future__ import annotations

import json
import logging
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles import friction_bench
from pydantic import ValidationError

from robid_acquisition.batch import record_of
from robid_compensation.ripple import (
    AxisRipple,
    RippleCompensation,
    analysis_bins,
    drift_in_turns,
    motors_by_configuration,
    table,
    without_ripple,
)
from robid_core import (
    ComplexArray,
    ConfigurationError,
    Configurations,
    Context,
    DataRejected,
    PoorExcitation,
    Record,
    Robot,
)
from robid_core.estimation.distortion.order_analysis import MotorData, torque_and_friction, unexplained
from robid_core.robot.file.description import RobotDescription
from robid_core.stage import map_in_process
from robid_core.testing import check_stage, example_record
from robid_excitation.multisine import Multisine
from robid_frf.h1 import H1

COGGING, CURRENT, RESOLVER = (0.1, 4, 0.5), (0.02, 24, -0.7), (4e-4, 6, 1.1)  # amplitude, order, phase
CLEAR = {
    "cogging": COGGING,
    "resolver": (1.2e-3, 6, 1.1),
}  # where a motor moves slowly, noise beside 0.02 N m
SIZES = {"cogging": COGGING, "current": CURRENT, "resolver": RESOLVER}


def context(seed: int = 0) -> Context:
    log = logging.getLogger("test.ripple")
    return Context(np.random.default_rng(seed), map_in_process, lambda done, total, note="": None, log)


def nominal() -> Robot:
    return Robot.load("one_axis")


def machine(*kinds: str, base: str = "one_axis_true", axis: str = "axis_1", **order: float) -> Robot:
    """A packaged robot with ripple, as its user would describe it in a robot.yaml."""
    data = Robot.load(base).description.model_dump(mode="json")
    effects: dict[str, Any] = {}
    for kind in kinds:
        amplitude, default, phase = SIZES[kind]
        values: dict[str, float] = {"amplitude": amplitude, "order": order.get(kind, default), "phase": phase}
        use = {
            "cogging": "drive.cogging",
            "current": "drive.torque_ripple",
            "resolver": "sensing.resolver_ripple",
        }
        if kind == "current":
            values |= {"amplitude": 0.0, "relative": amplitude}
        effects[kind] = {"use": use[kind], "on": axis, "with": values}
    data["effects"] = effects
    return Robot(RobotDescription.model_validate_json(json.dumps(data)))


def measured(robot: Robot, angle: list[list[float]], seed: int = 0, **settings: Any) -> Record:
    """One period in closed loop with noise, after one to settle."""
    nominal = Robot.load(robot.name.removesuffix("_true"))
    standing = Configurations(nominal.axis_names, np.array(angle))
    wanted = {
        "band_hz": (4.0, 80.0),
        "lines": 60,
        "period_s": 4.0,
        "blocks": 4,
        "slow_sine_rad_s": 9.0,
        "draws": 1,
    }
    return simulated(robot, standing, nominal, seed, {**wanted, **settings})


def simulated(
    robot: Robot, standing: Configurations, nominal: Robot, seed: int, settings: dict[str, Any]
) -> Record:
    excitation = Multisine(**settings).run(standing, nominal, context(seed))
    shape = excitation.reference.shape
    offset = np.stack([excitation.start_offset(i) for i in range(standing.n_config)]).reshape(-1, shape[-1])
    start = robot.motor_angle(standing.angle).repeat(shape[1] * shape[2], axis=0) - offset
    reference = np.tile(excitation.reference.reshape(-1, *shape[-2:]), (1, 2, 1))
    result = robot.simulate(reference, robot.joint_angle(start), seed)
    position, torque = (
        np.ascontiguousarray(x[:, shape[-2] :]).reshape(*shape[:3], 1, *shape[-2:])
        for x in (result.position, result.torque)
    )
    return record_of("simulated", standing, excitation, position, torque)


def beside_friction(motor: MotorData) -> ComplexArray:
    """What friction does not explain of a motor's torque, at detection lines."""
    left, _ = unexplained(torque_and_friction(motor), motor)
    return left[:, motor.basis.usable & ~motor.basis.excited]


@pytest.fixture(scope="module")
def rippled() -> Record:
    return measured(machine("cogging", "current", "resolver"), [[0.3], [-0.6]])


@pytest.fixture(scope="module")
def smooth() -> Record:
    return measured(machine(), [[0.3], [-0.6]])


@pytest.fixture(scope="module")
def found(rippled: Record) -> list[AxisRipple]:
    return RippleCompensation().search(rippled, nominal(), context())


def test_orders_sizes_and_phases_are_those_of_the_machine(found: list[AxisRipple]) -> None:
    measured_sizes = {(one.kind, one.order): one for one in found[0].found.ripple}
    for kind, (amplitude, order, phase) in SIZES.items():
        one = measured_sizes.pop((kind, float(order)))
        # Three standard errors, and what friction's regressors, of a speed that has the ripple in it, take of a wave.
        assert abs(one.amplitude - amplitude) < 3 * one.standard_error + 0.02 * amplitude
        assert abs(one.phase - phase) < 3 * one.standard_error / one.amplitude + 0.02
        assert one.standard_error < 0.05 * amplitude
        assert one.ties == ()
    # Cogging is a torque too, of which current ripple has its share: waves of 24 +- 4 with 0.1 * 0.02 / 2 = 1e-3 N m.
    for kind, order in measured_sizes:
        assert (kind, order) in {("cogging", 20.0), ("cogging", 28.0)}
        assert measured_sizes[kind, order].amplitude < 3e-3


def test_the_torque_at_detection_lines_falls_to_that_of_a_machine_without_ripple(
    rippled: Record, smooth: Record, found: list[AxisRipple]
) -> None:
    size = {}
    for name, record in (("with", rippled), ("freed", without_ripple(rippled, found)), ("never", smooth)):
        left = [beside_friction(motors[0]) for motors in motors_by_configuration(record)]
        size[name] = float(np.sqrt(np.mean(np.abs(left) ** 2)))
    assert size["with"] > 3 * size["never"]
    assert size["freed"] < 1.2 * size["never"]


def test_the_response_comes_closer_to_that_without_ripple(
    rippled: Record, smooth: Record, found: list[AxisRipple]
) -> None:
    without, before, after = (
        H1().run(record, context()).response for record in (smooth, rippled, without_ripple(rippled, found))
    )
    errors = [float(np.sqrt(np.mean(np.abs(np.log(x / without)) ** 2))) for x in (before, after)]
    # With ripple the motor meets friction at other instants: that part of the scatter stays.
    assert errors[1] < 0.5 * errors[0]


def test_a_record_without_ripple_is_handed_on_as_it_is(
    smooth: Record, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO):
        assert RippleCompensation().run(smooth, nominal(), context()) is smooth
    assert "axis_1: no significant ripple over 1.2" in caplog.text


def test_alarms_are_rare_under_friction() -> None:
    """Nominal 1 in 1000 a record; what friction leaves has heavier tails, and one in a hundred is granted."""
    robot, alarms, runs = machine(), 0, 24
    for seed in range(runs):
        record = measured(robot, [[0.3]], 100 + seed, period_s=2.0, lines=36, slow_sine_rad_s=12.0)
        alarms += bool(
            RippleCompensation(max_order=30.0).search(record, nominal(), context())[0].found.ripple
        )
    assert alarms <= 3  # 24 trials at 0.01: 3 or more with a probability of 2e-3


def test_the_log_is_a_table_and_the_source_says_what_was_done(
    rippled: Record, caplog: pytest.LogCaptureFixture
) -> None:
    stage = RippleCompensation(orders=(4.0, 24.0), kinds=("cogging", "current"))
    with caplog.at_level(logging.INFO):
        freed = stage.run(rippled, nominal(), context())
    assert "axis_1: cogging ripple, order 4, amplitude 0.1" in caplog.text
    assert "axis_1: current ripple, order 24, amplitude 0.0" in caplog.text
    assert "+-" in caplog.text
    assert "chi-square" in caplog.text
    assert freed.source.startswith("simulated; ripple compensated: axis_1 c")
    assert "axis_1 current 24" in freed.source
    # Nothing was said of the resolver: the angle stays.
    np.testing.assert_array_equal(freed.run.values("motor_position"), rippled.run.values("motor_position"))
    np.testing.assert_array_equal(freed.run.values("speed_reference"), rippled.run.values("speed_reference"))
    assert np.ptp(freed.run.values("motor_torque") - rippled.run.values("motor_torque")) > 0.1


def test_only_given_orders_are_looked_for(rippled: Record) -> None:
    only = RippleCompensation(orders=(4.0, 7.0), kinds=("cogging",)).search(rippled, nominal(), context())
    assert [one.wave for one in only[0].found.ripple] == [("cogging", 4.0)]


def test_each_configuration_may_have_phases_of_its_own(rippled: Record) -> None:
    shifted = rippled.run.values("motor_position").copy()
    shifted[1] += 1.0  # the zero of the angle was lost between the configurations
    channel = rippled.run.channel("motor_position").replace(values=shifted)
    run = rippled.run.replace(channels={**rippled.run.channels, "motor_position": channel})
    record = rippled.replace(runs=(run,))
    stage = RippleCompensation(phase="per_configuration", orders=(4.0,), kinds=("cogging",))
    entries = stage.search(record, nominal(), context())
    assert [entry.configurations for entry in entries] == [(0,), (1,)]
    first, second = (entry.found.ripple[0] for entry in entries)
    # sin(4 q + phase) with q = measured - 1.
    assert np.angle(np.exp(1j * (second.phase - first.phase + 4.0))) == pytest.approx(0.0, abs=0.05)
    assert second.amplitude == pytest.approx(COGGING[0], rel=0.05)
    assert "axis_1, configuration 2: cogging ripple, order 4" in " ".join(table(record, entries))
    freed = without_ripple(record, entries)
    left = [beside_friction(motors[0]) for motors in motors_by_configuration(freed)]
    before = [beside_friction(motors[0]) for motors in motors_by_configuration(record)]
    assert np.mean(np.abs(left) ** 2) < 0.5 * np.mean(np.abs(before) ** 2)


def test_an_order_between_whole_ones_is_found_where_it_is() -> None:
    record = measured(machine("cogging", cogging=7.3), [[0.3]])
    stage = RippleCompensation(order_step=0.25, max_order=12.0, kinds=("cogging",))
    (one,) = stage.search(record, nominal(), context())[0].found.ripple
    # Phase over half a turn and more of angle either side: an error of the phase over two radians.
    assert one.order == pytest.approx(7.3, abs=4 * one.standard_error / one.amplitude / 2)
    assert one.amplitude == pytest.approx(COGGING[0], rel=0.03)


def test_orders_between_whole_ones_have_no_common_phase(rippled: Record) -> None:
    with pytest.raises(ConfigurationError, match="per_configuration"):
        RippleCompensation(order_step=0.5).search(rippled, nominal(), context())


def test_a_motor_that_hardly_moves_is_told_to_show_nothing(caplog: pytest.LogCaptureFixture) -> None:
    record = measured(machine("cogging"), [[0.3]], period_s=2.0, lines=30, slow_sine_rad_s=0.5, blocks=2)
    with caplog.at_level(logging.WARNING):
        entries = RippleCompensation(max_order=3.0).search(record, nominal(), context())
    assert entries[0].found.ripple == ()
    assert "axis_1 moves by 0." in caplog.text
    assert "cannot be seen" in caplog.text


def stiff(*kinds: str, **order: float) -> Robot:
    """An arm with a stiff gear and ripple."""
    robot = friction_bench.machine()
    uses = {"cogging": "drive.cogging", "resolver": "sensing.resolver_ripple"}
    for kind in kinds:
        amplitude, default, phase = CLEAR[kind]
        values = {"amplitude": amplitude, "order": float(order.get(kind, default)), "phase": phase}
        robot = robot.with_effect(kind, uses[kind], "arm", None, values)
    return robot


def trajectory(robot: Robot, seed: int = 0, seconds: float = 12.0) -> Record:
    """Under a speed reference of three slow sines, which is no period of anything."""
    draw, time = np.random.default_rng(seed), np.arange(round(seconds / 1e-3)) * 1e-3
    sines = [
        draw.uniform(4.0, 9.0) * np.sin(2 * np.pi * f * time + draw.uniform(0, 2 * np.pi))
        for f in (0.11, 0.23, 0.41)
    ]
    reference = np.sum(sines, axis=0) * np.minimum(1.0, time)
    result = robot.simulate(reference[None, :, None], np.array([[0.1]]), seed)
    noise = draw.normal(0.0, 0.02, result.torque[0].shape)
    return friction_bench.record_of(robot, [(result.position[0], result.torque[0] + noise)])


def test_ripple_is_found_and_taken_off_a_trajectory(caplog: pytest.LogCaptureFixture) -> None:
    told, record = friction_bench.machine(), trajectory(stiff("cogging", "resolver"))
    stage = RippleCompensation(max_order=12.0)
    with caplog.at_level(logging.INFO):
        freed = stage.run(record, told, context())
    sizes = {one.wave: one for one in stage.search(record, told, context())[0].found.ripple}
    for kind in ("cogging", "resolver"):
        amplitude, order, phase = CLEAR[kind]
        one = sizes[kind, float(order)]  # type: ignore[index]
        # Three standard errors, and what friction's shapes, of a speed that has the ripple in it, take of a wave.
        assert abs(one.amplitude - amplitude) < 3 * one.standard_error + 0.02 * amplitude
        assert abs(one.phase - phase) < 3 * one.standard_error / one.amplitude + 0.02
    assert "arm: cogging ripple, order 4, amplitude 0.1" in caplog.text
    assert "arm: resolver ripple, order 6, amplitude 0.00" in caplog.text
    assert stage.search(freed, told, context())[0].found.ripple == ()
    assert np.ptp(freed.run.values("motor_torque") - record.run.values("motor_torque")) > 0.15


def test_a_trajectory_without_ripple_is_handed_on_as_it_is() -> None:
    """Stated: one in a thousand each; two of eight have a probability of 3e-5."""
    told, alarms = friction_bench.machine(), 0
    for seed in range(8):
        record = trajectory(stiff(), 10 + seed)
        alarms += RippleCompensation(max_order=20.0).run(record, told, context()) is not record
    assert alarms <= 1


def test_an_order_behind_a_gear_is_found_on_a_trajectory_where_it_is() -> None:
    record = trajectory(stiff("cogging", cogging=7.37))
    stage = RippleCompensation(order_step=0.25, max_order=12.0, kinds=("cogging",))
    (one,) = stage.search(record, friction_bench.machine(), context())[0].found.ripple
    turns = np.ptp(record.run.values("motor_position")) / (2 * np.pi)
    # A phase that errs by four standard errors at either end of the travel.
    assert one.order == pytest.approx(7.37, abs=4 * one.standard_error / one.amplitude / (np.pi * turns))
    assert one.amplitude == pytest.approx(COGGING[0], rel=0.03)


def test_a_short_trajectory_and_holes_are_refused() -> None:
    told, record = friction_bench.machine(), trajectory(stiff(), seconds=0.15)
    with pytest.raises(DataRejected, match=r"0.15 s is too short for order analysis below 100 Hz"):
        RippleCompensation().run(record, told, context())
    valid = record.run.valid.copy()
    valid[..., 7] = False
    with pytest.raises(DataRejected, match="has holes"):
        RippleCompensation().run(
            record.replace(runs=(record.run.replace(valid=valid),)), nominal(), context()
        )


def test_too_few_experiments_and_missing_samples_are_refused() -> None:
    six = Robot.load("six_axis")
    record = example_record(six, n_config=1, n_block=1)
    run = record.run
    fewer = {k: v.replace(values=v.values[:, :, :2]) for k, v in run.channels.items()}
    with pytest.raises(PoorExcitation, match="2 experiments .* 6 axes"):
        RippleCompensation().run(
            record.replace(runs=(run.replace(channels=fewer, valid=run.valid[:, :, :2]),)), six, context()
        )
    valid = run.valid.copy()
    valid[0, 0, 3, 1, 17] = False
    with pytest.raises(DataRejected, match="experiment 4, period 2, at 0.0170 s"):
        RippleCompensation().run(record.replace(runs=(run.replace(valid=valid),)), six, context())


def test_the_band_is_that_of_the_lines_or_the_one_given(rippled: Record) -> None:
    assert rippled.line is not None
    bins = analysis_bins(rippled, None)
    assert (bins[0], bins[-1]) == (rippled.line.min(), rippled.line.max())
    bins = analysis_bins(rippled, (10.1, 20.0))
    assert (bins[0], bins[-1]) == (41, 80)  # 4 s a period
    assert analysis_bins(rippled, (10.0, 1e5))[-1] == 1999


def test_drift_from_period_to_period_is_told(caplog: pytest.LogCaptureFixture, rippled: Record) -> None:
    run = rippled.run
    channels = {k: v.replace(values=np.repeat(v.values, 2, axis=3)) for k, v in run.channels.items()}
    position = channels["motor_position"].values.copy()
    position[:, :, :, 1] += 0.2
    channels["motor_position"] = channels["motor_position"].replace(values=position)
    drifting = rippled.replace(runs=(run.replace(channels=channels, valid=np.repeat(run.valid, 2, axis=3)),))
    assert drift_in_turns(drifting) == pytest.approx(0.2 / (2 * np.pi))
    with caplog.at_level(logging.WARNING):
        RippleCompensation(orders=(4.0,), kinds=("cogging",)).run(drifting, nominal(), context())
    assert "drift from period to period: order 4" in caplog.text


def test_it_keeps_the_contract_of_stages() -> None:
    check_stage(RippleCompensation, max_order=4.0, minimum_periods=0.0)
    settings = {"kinds": ("cogging",), "phase": "per_configuration", "minimum_periods": 0.0}
    check_stage(RippleCompensation, for_axes=(1,), orders=(400.0, 650.5), **settings)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"kinds": ()}, "none; name each of"),
        ({"kinds": ("cogging", "cogging")}, "once at most"),
        ({"kinds": ("cogs",)}, "cogging"),
        ({"band_hz": (20.0, 10.0)}, "20 Hz is not below 10 Hz"),
        ({"max_order": 0.5}, "below the first order"),
        ({"significance": 0.0}, "greater than 0"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        RippleCompensation(**settings)


def test_the_ripple_of_a_reference_plant_of_six_axes_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blind to the plant: on every axis the offset's and the current's ripple within a tenth and four errors."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(Path(__file__).parents[2])])
    from reference.plants import reference_plant

    plant = reference_plant(1)
    standing = Configurations(plant.nominal.axis_names, plant.pose[1:2])
    wanted = {
        "band_hz": (4.0, 80.0),
        "lines": 60,
        "period_s": 4.0,
        "blocks": 2,
        "slow_sine_rad_s": 9.0,
        "draws": 1,
    }
    record = simulated(plant.robot, standing, plant.nominal, 1, wanted)
    entries = RippleCompensation(kinds=("cogging", "current"), max_order=30.0).search(
        record, plant.nominal, context()
    )
    effects = plant.robot.description.effects
    for name, entry in zip(plant.nominal.axis_names, entries, strict=True):
        sizes = {one.wave: one for one in entry.found.ripple}
        for label, key, kind in (("offset", "amplitude", "cogging"), ("current", "relative", "current")):
            true = effects[f"{label}_ripple_{name}"].with_
            one = sizes[kind, true["order"]]  # type: ignore[index]
            assert abs(one.amplitude - true[key]) < min(
                0.1 * true[key], 4 * one.standard_error + 0.02 * true[key]
            )
            assert abs(np.angle(np.exp(1j * (one.phase - true["phase"])))) < 0.1
