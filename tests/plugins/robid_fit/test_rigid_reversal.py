"""Friction where motors turn back and where they stand still, in a rigid fit of data that pinocchio computes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.multisine import context
from oracles.rigid_arm import ARM, DRIVE, STEP, loaded, record_of, recording, slide, sticking

from robid_core import Robot
from robid_core.estimation.rigid.friction_direction import direction, direction_slope
from robid_core.estimation.standstill import at_rest
from robid_fit.rigid import RigidBodyFit
from robid_fit.torque_doubts import standing
from robid_fit.torque_residual import TorqueResidualFit

SETTINGS: dict[str, Any] = {"cutoff_hz": 50.0, "decimation": 20, "drop_first": 500, "drop_last": 500}


def told_with(folder: Path, speed: float, bodies: float = 1.0) -> Robot:
    """Return the arm with another speed within which friction turns, and other masses."""
    other = json.loads(json.dumps(ARM))
    other["name"] = f"told_{speed}"
    for axis in other["axes"].values():
        axis["friction"]["speed"] = speed
    for body in other["bodies"]:
        body["mass"] *= bodies
    return loaded(folder, other)


def wide(folder: Path) -> Robot:
    """Return the arm with friction that turns within 1 rad/s: wide enough for its motion to show."""
    return told_with(folder, 1.0)


@pytest.mark.parametrize("told", [0.1, 8.0])
def test_the_speed_within_which_friction_turns_is_found(tmp_path: Path, told: float) -> None:
    truth = wide(tmp_path)
    record = recording(truth, 1, noise=0.02)
    fit = RigidBodyFit(**SETTINGS).run((record,), told_with(tmp_path, told, bodies=1.1))
    assert fit.model is not None
    found = Robot.of_model(fit.model)
    table = fit.parameters
    for axis in ("j1", "j2"):  # the slide is slower than its friction turns
        for number in ("speed", "coulomb"):
            name = f"friction.{axis}.{number}"
            index = table.names.index(name)
            error = abs(table.estimate[index] - truth.parameter(name))
            assert error < 4 * table.standard_error[index] + 0.01 * truth.parameter(name), name
            assert found.parameter(name) == pytest.approx(table.estimate[index])
    # What noise leaves: 0.02 N m of each axis, a twentieth of the band kept.
    assert fit.time[0].relative_error < 3 * 0.02 / np.sqrt(np.mean(fit.time[0].measured ** 2))


def test_a_held_speed_is_the_models(tmp_path: Path) -> None:
    truth = wide(tmp_path)
    record = recording(truth, 1, noise=0.02)
    fit = RigidBodyFit(friction_speed=1.0, **SETTINGS).run((record,), told_with(tmp_path, 0.1))
    assert fit.model is not None
    found = Robot.of_model(fit.model)
    assert not [name for name in fit.parameters.names if name.endswith(".speed")]
    assert [found.parameter(f"friction.{axis}.speed") for axis in found.axis_names] == [1.0] * 3
    assert found.parameter("friction.j1.coulomb") == pytest.approx(0.4, rel=0.02)


@pytest.mark.parametrize("repeats", [8, pytest.param(60, marks=pytest.mark.full)])
def test_the_interval_of_that_speed_holds_it(tmp_path: Path, repeats: int) -> None:
    robot = slide(tmp_path, axes={"x": {**DRIVE, "rotor_inertia": 5.0, "friction": {
        "coulomb": 20.0, "viscous": 200.0, "offset": -3.0, "speed": 0.1}}})  # fmt: skip
    clean = recording(robot, 5, seconds=8.0)
    position, torque = (clean.run.values(name)[0, 0, 0, 0] for name in ("motor_position", "motor_torque"))
    draw, settings, scores = np.random.default_rng(7), RigidBodyFit(cutoff_hz=50.0), []

    def estimate(noise: float) -> tuple[float, float]:
        noisy = record_of(robot, position, torque + noise * draw.normal(size=torque.shape))
        table = settings.run((noisy,), robot).parameters
        index = table.names.index("friction.x.speed")
        return float(table.estimate[index]), float(table.standard_error[index])

    bias = estimate(1e-6)[0] - 0.1
    for _ in range(repeats):
        value, error = estimate(2.0)
        scores.append((value - bias - 0.1) / error)
    # A mean of squares of normal numbers scatters by sqrt(2 / n).
    assert np.mean(np.square(scores)) == pytest.approx(1.0, abs=3.5 * np.sqrt(2 / repeats))


def test_the_slope_is_that_of_differences() -> None:
    velocity, speed = np.linspace(-3, 3, 41)[:, None] * [1.0, 1.0], np.array([0.5, 0.0])
    step = np.array([1e-6, 0.0])
    by_hand = (direction(velocity, speed + step) - direction(velocity, speed - step)) / 2e-6
    assert np.abs(direction_slope(velocity, speed) - by_hand).max() < 1e-8
    assert (direction(velocity, speed)[:, 1] == np.sign(velocity[:, 1])).all()


def test_samples_at_rest_say_nothing_of_friction(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    record = record_of(robot, *sticking(3))
    settings = {"cutoff_hz": 50.0, "friction_speed": 0.0}
    without = RigidBodyFit(**settings).run((record,), robot)
    with_rest = RigidBodyFit(at_rest="keep", **settings).run((record,), robot)
    assert (
        "left out, since at rest: x 4" in without.status
    )  # 40 %, and what filters mix with them: some of the samples
    assert "at rest" not in with_rest.status
    assert without.time[0].relative_error < 0.5 * with_rest.time[0].relative_error
    table = without.parameters
    for name, true in (("coulomb", 20.0), ("viscous", 200.0), ("offset", -3.0)):
        index = table.names.index(f"friction.x.{name}")
        assert abs(table.estimate[index] - true) < 4 * table.standard_error[index] + 0.02 * abs(true), name
    index = table.names.index("friction.x.offset")
    wide_error = with_rest.parameters.standard_error[with_rest.parameters.names.index("friction.x.offset")]
    assert table.standard_error[index] < 0.5 * wide_error


def test_an_axis_that_turns_back_is_not_at_rest_and_one_that_waits_is() -> None:
    n, time = 4000, np.arange(4000) * STEP
    draw = np.random.default_rng(0)
    turning = np.sin(2 * np.pi * 0.5 * time)
    waiting = np.where(time < 2, 0.3 * np.sin(np.pi * time) ** 2, 0.0)
    smoothed = np.stack((turning, waiting, np.zeros(n)), axis=1)
    measured = smoothed + draw.normal(0, 1e-5, smoothed.shape)
    speed = np.gradient(smoothed, STEP, axis=0)
    (still,) = at_rest([measured], [speed], [smoothed], [STEP], 50.0)
    assert not still[:, 0].any()
    assert still[2050:, 1].all()
    assert still[:1900, 1].mean() < 0.05
    assert not still[:, 2].any()  # never moved: what holds it is what it is measured for


def test_a_torque_fit_doubts_axes_that_stand_still(tmp_path: Path) -> None:
    """Where it counts them; else it says how many it leaves out."""
    robot = slide(tmp_path, axes={"x": {**DRIVE, "rotor_inertia": 5.0, "sensors": {"torque_noise": 0.5}, "friction": {
        "coulomb": 20.0, "viscous": 200.0, "offset": -3.0, "speed": 0.01}}})  # fmt: skip
    record = record_of(robot, *sticking(3))
    kept, left_out = (
        TorqueResidualFit(highest_hz=20.0, at_rest=at_rest).run((record,), robot, context()).doubts
        for at_rest in ("keep", "leave_out")
    )
    (doubt,) = [one for one in kept if one.kind == "standstill"]
    assert re.search(r"x in (3[5-9]|4\d) % of the samples", doubt.sentence)
    (remark,) = [one for one in left_out if one.kind == "standstill"]
    assert remark.is_remark
    assert re.search(
        r"do not count .*: x 6\d % of the samples", remark.sentence
    )  # what is near their ends, and sticks
    assert not standing((recording(robot, 1, seconds=5.0),), np.zeros(1, dtype=bool))
