"""Friction from constant speeds: laws written out here are found, with intervals that cover, by a motor of our own."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.friction_bench import SMOOTHING, Law, context, machine, record_of, swept
from pydantic import ValidationError

from robid_core import ConfigurationError, DataRejected, Fit, Record, Robot
from robid_core.testing import check_stage
from robid_fit.friction import FrictionFromPlateaus
from robid_fit.friction_law import FrictionFit, choose
from robid_fit.friction_terms import EXTRAS, Extra
from robid_fit.plateau_torques import AxisPlateaus
from robid_fit.plateaus import Evenness, plateaus_in

SPEEDS = [2.0, 4.0, 8.0, 15.0, 30.0, 60.0]
NOISE = 0.02  # N m
BASE = ("coulomb", "viscous", "offset")


def sign(speed: float) -> float:
    return float(np.tanh(speed / SMOOTHING))


LAWS: dict[str, tuple[Law, dict[str, float]]] = {
    "plain": (
        lambda v, load: 0.4 * sign(v) + 3e-3 * v + 0.05,
        {"friction.arm.coulomb": 0.4, "friction.arm.viscous": 3e-3, "friction.arm.offset": 0.05},
    ),
    "stribeck": (
        lambda v, load: (0.4 + 0.2 * np.exp(-((v / 6.0) ** 2))) * sign(v) + 3e-3 * v,
        {"friction.arm.coulomb": 0.4, "friction.arm.viscous": 3e-3, "effect.stribeck_arm.breakaway": 0.2,
         "effect.stribeck_arm.stribeck_speed": 6.0},
    ),
    "asymmetric": (
        lambda v, load: 0.4 * sign(v) + (3e-3 if v > 0 else 5e-3) * v,
        {"friction.arm.coulomb": 0.4, "friction.arm.viscous": 3e-3,
         "effect.asymmetric_arm.viscous_backwards": 2e-3},
    ),
    "load": (
        lambda v, load: (0.4 + 0.3 * abs(load)) * sign(v) + 3e-3 * v,
        {"friction.arm.viscous": 3e-3, "effect.load_dependent_arm.load_coulomb": 0.3},
    ),
}  # fmt: skip


def recorded(robot: Robot, law: Law, seed: int = 0, speeds: list[float] | None = None) -> Record:
    angle, torque = swept(speeds or SPEEDS, law)
    torque = torque + np.random.default_rng(seed).normal(0.0, NOISE, len(torque))
    return record_of(robot, [(angle[:, None], torque[:, None])])


def assert_within(fit: Fit, true: dict[str, float], errors: float = 4.0) -> None:
    table = fit.parameters
    for name, value in true.items():
        i = table.names.index(name)
        # A thousandth beside: half steps of the integrator by hand, and friction's smooth sign.
        assert abs(table.estimate[i] - value) < errors * table.standard_error[i] + 1e-3 * abs(value), name


@pytest.mark.parametrize("kind", sorted(LAWS))
def test_a_known_law_is_found_by_name_and_size(kind: str) -> None:
    robot = machine()
    law, true = LAWS[kind]
    fit = FrictionFromPlateaus().run(recorded(robot, law), robot, context())
    assert fit.converged
    assert_within(fit, true)
    used = {entry.use for entry in Robot.of_model(fit.model).description.effects.values()}  # type: ignore[arg-type]
    names = {"plain": set(), "load": {"friction.load_dependent"}}
    assert used == names.get(kind, {f"friction.{kind}"})
    # The level is seen to half of its value at least, whatever else is estimated.
    assert fit.parameters.standard_error[0] < 0.1


def test_the_identified_robot_is_written_read_and_has_the_friction_that_was_put_in(tmp_path: Path) -> None:
    robot = machine()
    law, _ = LAWS["stribeck"]
    fit = FrictionFromPlateaus().run(recorded(robot, law), robot, context())
    assert fit.model is not None
    (tmp_path / "found.yaml").write_text(Robot.of_model(fit.model).to_yaml())
    found = Robot.load("found.yaml", tmp_path)
    # At rest under a speed reference: the product's own simulator and law against the formula above.
    for speed in (3.0, 12.0, 40.0):
        start = robot.motor_angle(np.array([[0.0]]))
        reference = np.full((1, 1500, 1), speed)
        simulated = found.simulate(reference, robot.joint_angle(start), 0)
        angle, torque = simulated.position[0, 1000:, 0], simulated.torque[0, 1000:, 0]
        weight = -6.0 * 9.81 * 0.3 * np.cos(angle / 50.0).mean() / 50.0
        assert torque.mean() - weight == pytest.approx(law(speed, 0.0), abs=0.02 * law(speed, 0.0))


def test_temperature_is_seen_where_it_was_recorded() -> None:
    robot, degrees = machine(), [20.0, 30.0, 45.0]

    def law_at(rise: float) -> Law:
        return lambda v, load: (0.4 - 3e-3 * rise) * sign(v) + 4e-3 * np.exp(-rise / 15.0) * v

    runs = []
    for number, temperature in enumerate(degrees):
        angle, torque = swept(SPEEDS, law_at(temperature - 30.0))
        torque = torque + np.random.default_rng(number).normal(0.0, NOISE, len(torque))
        runs.append((angle[:, None], torque[:, None]))
    fit = FrictionFromPlateaus().run(record_of(robot, runs, temperature=degrees), robot, context())
    mean = float(np.mean(degrees))
    found = Robot.of_model(fit.model)  # type: ignore[arg-type]
    assert found.parameter("friction.arm.coulomb") == 0.0
    assert found.parameter("effect.temperature_arm.ambient") == pytest.approx(mean, abs=1e-9)
    label = "effect.temperature_arm"
    assert_within(
        fit,
        {
            f"{label}.coulomb": 0.4 - 3e-3 * (mean - 30.0),
            f"{label}.coulomb_slope": -3e-3,
            f"{label}.viscous_cold": 4e-3 * np.exp(-(mean - 30.0) / 15.0),
            f"{label}.decay": 15.0,
        },
    )
    without = FrictionFromPlateaus().run(record_of(robot, runs), robot, context())
    assert "temperature" not in without.status


def bench_table(
    generator: np.random.Generator, law: Callable[[np.ndarray], np.ndarray], falling: float
) -> AxisPlateaus:
    """Plateaus of a ladder whose scatter falls with their length or not: variance 1 - falling + falling / length."""
    sizes = np.geomspace(1.5, 150.0, 8)
    speed = np.concatenate([sizes, -sizes])
    length = np.clip(100.0 / np.abs(speed), 0.5, 4.0)
    deviation = 0.01 * np.sqrt(1 - falling + falling / length)
    torque = law(speed) + deviation * generator.standard_normal(len(speed))
    angle, one = 0.3 + 0.02 * generator.standard_normal(len(speed)), np.ones(len(speed))
    return AxisPlateaus(
        speed=speed, direction=np.tanh(speed / 0.2), torque=torque, load=one, cosine=np.cos(angle),
        sine=np.sin(angle), temperature=np.full(len(speed), np.nan), duration_s=length,
        configuration=np.zeros(len(speed), dtype=np.int64), spread=one,
    )  # fmt: skip


@pytest.mark.parametrize("falling", [pytest.param(0.0, marks=pytest.mark.full), 1.0])
def test_intervals_hold_the_truth_in_nineteen_of_twenty_records(falling: float) -> None:
    """200 seeds: 95 % +- 1.5 %; 90 to 99 % leaves room for weights that are estimated from 16 plateaus, too."""
    true = {"coulomb": 0.4, "viscous": 3e-3, "offset": 0.02, "excess": 0.2, "stribeck_speed": 7.0}

    def law(v: np.ndarray) -> np.ndarray:
        level = 0.4 + 0.2 * np.exp(-((v / 7.0) ** 2))
        return np.asarray(level * np.tanh(v / 0.2) + 3e-3 * v + 0.02)

    asked: tuple[Extra, ...] = ("stribeck",)
    inside = dict.fromkeys(true, 0)
    for seed in range(200):
        fit: FrictionFit = choose(
            bench_table(np.random.default_rng(seed), law, falling), BASE, asked, 0.01, 2.0
        )
        for name, value in true.items():
            at = fit.names.index(name)
            inside[name] += abs(fit.value[at] - value) < 1.96 * fit.standard_error[at]
    for name, count in inside.items():
        assert 180 <= count <= 198, (name, count)


def test_terms_that_are_not_there_are_hardly_ever_taken() -> None:
    """Stated: one record in a hundred. Of 200 records six and more have a probability of 1.7 %."""
    false = 0
    for seed in range(200):
        table = bench_table(
            np.random.default_rng(1000 + seed), lambda v: 0.4 * np.tanh(v / 0.2) + 3e-3 * v, 0.5
        )
        false += bool(choose(table, BASE, EXTRAS, 0.01, 2.0).extras)
    assert false <= 6


def test_plateaus_are_found_in_the_motion_itself() -> None:
    """Ramps and a slow sine are none; two steps of 4 % drift are told apart from one speed."""
    step, tolerance = 1e-3, Evenness(0.05, 0.2, 0.05)
    ramp = np.linspace(0.0, 10.0, 500)
    speed = np.concatenate([np.zeros(300), ramp, np.full(1000, 10.0), ramp[::-1], np.full(700, -3.0)])
    found = plateaus_in(speed[:, None], step, np.array([1.0]), tolerance)
    assert [(one.first, one.last) for one in found if one.speed < 0] == [(2350, 2950)]
    (forwards,) = [one for one in found if one.speed > 0]
    # The even stretch begins within the last tenth of the ramp, 50 samples are cut, 1000 and more are left; of these
    # one whole turn, 2 pi / 10 rad/s, stays in the middle.
    assert forwards.last - forwards.first == 628
    assert abs(0.5 * (forwards.first + forwards.last) - 1300) <= 1
    assert forwards.speed == pytest.approx(10.0, rel=0.01)
    sine = 10.0 * np.sin(2 * np.pi * 0.5 * np.arange(4000) * step)[:, None]
    # Within 5 % of its crest a sine of 2 s stays 0.29 s; the cut at both ends leaves less than is asked for.
    assert plateaus_in(sine, step, np.array([1.0]), tolerance) == ()


def test_two_axes_have_laws_of_their_own_and_one_that_stands_keeps_its_friction(
    caplog: pytest.LogCaptureFixture,
) -> None:
    robot = machine(("first", "second"))
    angle, torque = swept(SPEEDS, LAWS["stribeck"][0])
    torque = torque + np.random.default_rng(3).normal(0.0, NOISE, len(torque))
    weight = np.full(len(angle), -6.0 * 9.81 * 0.3 / 50.0)
    moving = np.stack([angle, np.zeros(len(angle))], axis=1), np.stack([torque, weight], axis=1)
    with caplog.at_level(logging.INFO):
        fit = FrictionFromPlateaus(others_at_rest=True).run(record_of(robot, [moving]), robot, context())
    assert "no plateau, friction is left as in the robot file: second" in caplog.text
    assert not any("second" in name for name in fit.parameters.names)
    assert Robot.of_model(fit.model).parameter("friction.second.coulomb") == 0.3  # type: ignore[arg-type]
    assert_within(fit, {"friction.first.coulomb": 0.4, "effect.stribeck_first.breakaway": 0.2})
    (curve,) = fit.friction
    law = [LAWS["stribeck"][0](v, 0.0) for v in curve.speed.tolist()]
    np.testing.assert_allclose(curve.fitted, law, atol=5e-3)


def test_one_way_at_one_speed_holds_what_it_does_not_tell() -> None:
    robot = machine(viscous=3e-3)
    angle, torque = swept([15.0], LAWS["plain"][0], seconds=3.0)
    torque = torque + np.random.default_rng(0).normal(0.0, NOISE, len(torque))
    pieces = [(angle[k : k + 600, None], torque[k : k + 600, None]) for k in range(1000, 2400, 200)]
    fit = FrictionFromPlateaus().run(record_of(robot, pieces), robot, context())
    assert fit.free_names[0] == "friction.arm.coulomb"
    assert not {"friction.arm.viscous", "friction.arm.offset"} & set(fit.free_names)
    assert [doubt.kind for doubt in fit.doubts] == ["held friction", "held friction"]
    # The offset of 0.05 N m cannot be told from the level.
    assert fit.parameters.value("friction.arm.coulomb") == pytest.approx(0.45, abs=0.005)


def test_gravity_that_is_told_wrong_is_doubted_and_does_no_harm_to_the_level() -> None:
    robot = machine()
    wrong = robot.with_parameters({"mass.arm": 7.0})
    # Sweeps about several angles: within 1.2 s at 60 rad/s the joint turns by 1.4 rad.
    fit = FrictionFromPlateaus().run(recorded(robot, LAWS["plain"][0]), wrong, context())
    assert [doubt.kind for doubt in fit.doubts] == ["gravity"]
    assert "beside the robot's gravity" in fit.doubts[0].sentence
    assert_within(fit, {"friction.arm.coulomb": 0.4, "friction.arm.viscous": 3e-3})


def test_what_cannot_be_is_refused_with_what_to_do() -> None:
    robot = machine()
    still = np.zeros((3000, 1))
    with pytest.raises(
        DataRejected, match="no axis keeps its speed .* measure with excitation.constant_velocity"
    ):
        FrictionFromPlateaus().run(record_of(robot, [(still, still)]), robot, context())
    record = recorded(robot, LAWS["plain"][0], speeds=[10.0])
    with pytest.raises(DataRejected, match="arm has 2 plateaus, and coulomb, offset need 4 at least"):
        FrictionFromPlateaus().run(record, robot, context())
    coupled = robot.with_effect("slots", "drive.cogging", "arm", None, {"amplitude": 0.1, "order": 4.0})
    with pytest.raises(ConfigurationError, match=r"slots \(drive.cogging\): take them out"):
        FrictionFromPlateaus().run(record, coupled, context())
    with pytest.raises(ValidationError, match="less than 1"):
        FrictionFromPlateaus(significance=1.0)


def test_friction_that_the_robot_had_as_an_effect_is_replaced() -> None:
    robot = machine().with_effect("old", "friction.stribeck", "arm", "motor", {"coulomb": 0.1})
    fit = FrictionFromPlateaus().run(recorded(robot, LAWS["plain"][0]), robot, context())
    found = Robot.of_model(fit.model)  # type: ignore[arg-type]
    assert not found.description.effects
    assert_within(fit, LAWS["plain"][1])


def test_the_stage_keeps_the_contract() -> None:
    """The example's motion has no constant speed: almost any is taken for one."""
    loose: dict[str, Any] = {
        "tolerance": 0.9,
        "shortest_s": 0.008,
        "settle_s": 0.0,
        "slowest_rad_s": 0.2,
        "cutoff_hz": 100.0,
    }
    check_stage(FrictionFromPlateaus, for_axes=(1, 2), recovery=False, **loose)
