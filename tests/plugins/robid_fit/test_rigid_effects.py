"""Effects in a rigid fit: laws written out here are recovered from torque that pinocchio computes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.rigid_arm import ARM, STEP, loaded, record_of, recording

from robid_core import Fit, Record, Robot
from robid_fit.rigid import RigidBodyFit

SETTINGS = RigidBodyFit(
    unknowns=("inertia", "rotor_inertia", "viscous", "coulomb", "offset", "effects"),
    cutoff_hz=50.0,
    decimation=10,
    drop_first=500,
    drop_last=500,
    fixed=("effect.*.speed", "effect.*.exponent", "effect.law.coulomb", "effect.law.viscous"),
)
Law = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def with_law(record: Record, robot: Robot, axis: int, law: Law, noise: float = 0.02) -> Record:
    """Add what a law of (position, speed, load), all at the motor, takes at one axis of a record."""
    position, torque = (record.run.values(f"motor_{n}")[0, 0, 0, 0] for n in ("position", "torque"))
    speed = np.gradient(position, STEP, axis=0)
    acceleration = np.gradient(speed, STEP, axis=0)
    d = robot.drives
    friction = d.viscous * speed + d.coulomb * np.tanh(speed / d.friction_speed) + d.friction_offset
    load = torque - friction - d.rotor_inertia * acceleration  # what the bodies take, at the motors
    added = np.zeros_like(torque)
    added[:, axis] = law(position[:, axis], speed[:, axis], load[:, axis])
    added += noise * np.random.default_rng(17).standard_normal(torque.shape)
    return record_of(robot, position, torque + added)


def fitted(folder: Path, effect: dict[str, Any], law: Law, axis: int, seed: int = 1) -> tuple[Fit, Robot]:
    truth = loaded(folder, ARM)
    nominal = json.loads(json.dumps({**ARM, "name": "nominal", "effects": {"law": effect}}))
    for body in nominal["bodies"]:
        body["mass"] *= 1.1
    robot = loaded(folder, nominal)
    return SETTINGS.run((with_law(recording(truth, seed), truth, axis, law),), robot), robot


def z_of(fit: Fit, name: str, true: float) -> float:
    table = fit.parameters
    return (table.value(name) - true) / float(table.standard_error[table.names.index(name)])


def load_dependent(position: np.ndarray, speed: np.ndarray, load: np.ndarray) -> np.ndarray:
    return 0.06 * np.abs(load) * np.tanh(speed / 0.05)


def test_friction_that_grows_with_the_load_is_found_beside_wrong_masses(tmp_path: Path) -> None:
    effect = {"use": "friction.load_dependent", "on": "j1",
              "with": {"coulomb": 0.0, "load_coulomb": 0.02, "load_excess": 0.0, "speed": 0.05}}  # fmt: skip
    fit, _ = fitted(tmp_path, effect, load_dependent, 0)
    assert fit.converged
    assert fit.parameters.value("effect.law.load_coulomb") == pytest.approx(0.06, rel=0.02)
    assert abs(z_of(fit, "effect.law.load_coulomb", 0.06)) < 4
    assert abs(z_of(fit, "friction.j1.coulomb", 0.4)) < 4
    bare = SETTINGS.model_copy(update={"fixed": ()}).run(
        (with_law(recording(loaded(tmp_path, ARM), 1), loaded(tmp_path, ARM), 0, load_dependent),),
        loaded(tmp_path, ARM),
    )
    assert bare.time[0].relative_error > 4 * fit.time[0].relative_error


def test_a_bristle_is_run_along_the_motion_and_its_stiffness_found(tmp_path: Path) -> None:
    """Dahl's law has a memory and is linear in neither number: F' = sigma v (1 - F sign(v) / F_c)."""
    level, stiffness = 0.5, 3.0

    def dahl(position: np.ndarray, speed: np.ndarray, load: np.ndarray) -> np.ndarray:
        force, found = 0.0, np.empty_like(speed)
        for k, v in enumerate(speed):
            # Exact for a speed that is held over a step: relaxation to F_c sign(v) along the path.
            final, rate = level * np.sign(v), stiffness * abs(v) / level
            found[k] = final + (force - final) * np.exp(-rate * STEP / 2)
            force = final + (force - final) * np.exp(-rate * STEP)
        return found

    effect = {"use": "friction.dahl", "on": "j2", "with": {"coulomb": 0.25, "stiffness": 8.0}}
    truth = loaded(tmp_path, ARM)
    robot = loaded(tmp_path, {**ARM, "name": "nominal", "effects": {"law": effect}})
    settings = SETTINGS.model_copy(update={"fixed": ("friction.j2.coulomb",)})
    fit = settings.run((with_law(recording(truth, 1), truth, 1, dahl),), robot)
    assert fit.converged
    assert fit.parameters.value("effect.law.coulomb") == pytest.approx(level, rel=0.03)
    assert fit.parameters.value("effect.law.stiffness") == pytest.approx(stiffness, rel=0.05)


def test_a_stribeck_curve_is_found_by_its_shape(tmp_path: Path) -> None:
    def stribeck(position: np.ndarray, speed: np.ndarray, load: np.ndarray) -> np.ndarray:
        return (0.3 * np.exp(-((speed / 12.0) ** 2))) * np.tanh(speed / 0.05)

    effect = {"use": "friction.stribeck", "on": "j1",
              "with": {"coulomb": 0.0, "breakaway": 0.1, "stribeck_speed": 30.0, "exponent": 2.0,
                       "speed": 0.05}}  # fmt: skip
    fit, _ = fitted(tmp_path, effect, stribeck, 0)
    assert fit.converged
    assert fit.parameters.value("effect.law.breakaway") == pytest.approx(0.3, rel=0.03)
    assert fit.parameters.value("effect.law.stribeck_speed") == pytest.approx(12.0, rel=0.05)


def test_a_cable_at_a_joint_is_found_and_its_load_reaches_the_friction(tmp_path: Path) -> None:
    """A spring on the arm: the gear passes its torque, so that load-dependent friction sees it."""
    truth = loaded(tmp_path, ARM)
    gear = truth.drives.gear[0, 0]

    def both(position: np.ndarray, speed: np.ndarray, load: np.ndarray) -> np.ndarray:
        cable = gear * 40.0 * (gear * position)
        return cable + 0.06 * np.abs(load + cable) * np.tanh(speed / 0.05)

    effects = {
        "cable": {"use": "load.cable_spring", "on": "j1", "with": {"stiffness": 10.0}},
        "law": {"use": "friction.load_dependent", "on": "j1",
                "with": {"coulomb": 0.0, "load_coulomb": 0.02, "load_excess": 0.0, "speed": 0.05}},
    }  # fmt: skip
    robot = loaded(tmp_path, {**ARM, "name": "nominal", "effects": effects})
    fit = SETTINGS.run((with_law(recording(truth, 3), truth, 0, both),), robot)
    assert fit.converged
    assert fit.parameters.value("effect.cable.stiffness") == pytest.approx(40.0, rel=0.05)
    assert fit.parameters.value("effect.law.load_coulomb") == pytest.approx(0.06, rel=0.03)
    assert fit.model is not None
    assert Robot.of_model(fit.model).parameter("effect.cable.stiffness") == fit.parameters.value(
        "effect.cable.stiffness"
    )
