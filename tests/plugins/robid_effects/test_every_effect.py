"""Every built-in effect keeps the contract, and does in a robot file what a robot file promises.

The contract: `robid_core.testing.check_effect`. The file: it loads, the table's parameters have names, a changed one
changes the motion, and what is written loads as the same robot.
"""

from __future__ import annotations

import functools
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import (
    ConfigurationError,
    Effect,
    ForceEffect,
    Robot,
    RobotMotion,
    SignalEffect,
    StructureEffect,
    effect_columns,
    forces_along,
)
from robid_core.registry import EFFECTS, registry
from robid_core.testing import check_effect

BUILT_IN = sorted(plugin.name for plugin in registry().plugins(EFFECTS) if plugin.distribution == "robid")
EVERY = pytest.mark.parametrize("name", BUILT_IN)

# Values that make each law do all it can: limits that are met, delays of more than a step, parts that wait at zero.
LIVELY: dict[str, dict[str, float]] = {
    "drive.current_loop": {"time_constant": 4e-4, "delay": 6.1e-4},
    "drive.saturation": {"limit": 1.5, "rate": 4e3},
    "drive.torque_ripple": {"relative": 0.1, "phase": 0.4},
    "friction.asymmetric": {"viscous_forwards": 0.01, "viscous_backwards": 0.03},
    "friction.coulomb_viscous": {"viscous": 0.02, "offset": -0.1},
    "friction.elasto_plastic": {"viscous": 0.01},
    "drive.core_loss": {"hysteresis": 0.01, "eddy": 1e-4},
    "friction.eyring": {"viscous_forwards": 0.01, "coulomb_backwards": 0.3},
    "friction.load_dependent": {"viscous": 0.01},
    "friction.power_law": {"viscous_backwards": 0.01, "exponent": 1.7},
    "friction.quadratic_load": {"load_square": 0.3, "viscous": 0.01},
    "friction.lugre": {"damping": 0.3, "viscous": 0.2},
    "friction.stribeck": {"exponent": 1.3, "viscous": 0.01},
    "friction.temperature": {"start": 40.0},
    "load.counterbalance": {"stiffness": 2e4, "mounting_angle": 0.5},
    "sensing.delay": {"delay": 3.3e-3},
    "sensing.quantisation": {"resolution": 0.01},
    "transmission.bouc_wen": {"sharpness": 3.0, "share": 0.8},
    "transmission.piecewise_linear": {"lost_motion": 2e-4},
    "transmission.spring_damper": {"damping": 20.0},
}

# What a change of this parameter must show in the motion of the axis; the first of the table by default.
TELLING = {
    "drive.current_loop": "delay",
    "friction.temperature": "viscous_hot",
    "load.centre_of_mass": "x",
    "structure.elastic_coordinate": "stiffness",
    "structure.foundation": "stiffness_y",
}

ON = {"body": "axis_6", "base": "base", "structure.elastic_coordinate": "axis_5"}


def effect_of(name: str) -> type[Effect]:
    effect: type[Effect] = registry().load(EFFECTS, name)
    return effect


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.full] * (name in LIVELY)) for name in BUILT_IN],
)
def test_it_keeps_the_contract(name: str) -> None:
    check_effect(effect_of(name))


@pytest.mark.parametrize("name", sorted(LIVELY))
def test_it_keeps_the_contract_with_other_parameters(name: str) -> None:
    check_effect(effect_of(name), **LIVELY[name])


def test_every_effect_is_said_to_be_where_its_name_says() -> None:
    """friction and transmission are forces, drive and sensing distort signals (or the motor itself)."""
    kinds = {name: effect_of(name) for name in BUILT_IN}
    assert len(kinds) >= 40
    for name, effect in kinds.items():
        group = name.partition(".")[0]
        assert group in ("friction", "transmission", "drive", "sensing", "load", "structure")
        if group == "friction":
            assert issubclass(effect, ForceEffect)
            assert {"motor", "gear", "arm"} <= set(effect.sides)
        if group == "structure":
            assert issubclass(effect, StructureEffect)


# In a robot file -------------------------------------------------------------------------------------------------


def written(name: str, folder: Path, values: dict[str, float]) -> Path:
    """A robot file with the effect at the second axis, or where else it can be."""
    effect: Any = effect_of(name)
    where = getattr(effect, "places", None) or getattr(effect, "sides", None) or effect.channels
    on = ON.get(name) or ON.get(where[0], "axis_2")
    given = ", ".join(f"{key}: {value!r}" for key, value in values.items())
    path = folder / "robot.yaml"
    path.write_text(
        "robid_robot: 1\nname: tried\nbase: six_axis\n"
        f"effects:\n  cause: {{use: {name}, on: {on}, with: {{{given}}}}}\n"
    )
    return path


def motion(robot: Robot) -> tuple[np.ndarray, ...]:
    """What the drives sample in 60 ms, the second axis swinging 5 rad/s about a pose that gravity loads."""
    time = robot.sample_time_s * np.arange(60)
    reference = np.zeros((1, 60, 6))
    reference[0, :, 1] = 5.0 * np.sin(2 * np.pi * 20 * time)
    run = robot.simulate(reference, np.array([[0.1, 0.5, 0.2, 0.1, 0.3, 0.1]]), seed=5)
    return run.position, run.torque, run.state.speed


@functools.cache
def nominal_motion() -> tuple[np.ndarray, ...]:
    return motion(Robot.load("six_axis"))


@functools.cache
def with_it(name: str) -> tuple[Robot, tuple[np.ndarray, ...]]:
    """Return the robot with the effect, and how it moves."""
    with tempfile.TemporaryDirectory() as folder:
        robot = Robot.load(str(written(name, Path(folder), LIVELY.get(name, {}))))
    return robot, motion(robot)


@EVERY
def test_its_parameters_have_names_in_a_robot_file_and_change_the_motion(name: str) -> None:
    effect = effect_of(name)
    robot, moved = with_it(name)
    named = {f"effect.cause.{row.name}": row for row in effect.parameters}
    found = {key: value for key, value in robot.parameters().items() if key.startswith("effect.")}
    assert list(found) == list(named)
    for key, row in named.items():
        assert found[key] == LIVELY.get(name, {}).get(row.name, row.default)
        assert robot.parameter_unit(key) == row.unit
        assert robot.parameter_kind(key) == "effect"
    key = f"effect.cause.{TELLING.get(name, effect.parameters[0].name)}"
    row = named[key]
    other = 0.7 * found[key] if row.lower <= 0.7 * found[key] != 0.0 else 0.99 * row.lower + 0.01 * row.upper
    changed = robot.with_parameters({key: other})
    assert changed.parameters()[key] == other
    assert {k for k, v in changed.parameters().items() if v != robot.parameters()[k]} == {key}
    assert any(not np.array_equal(a, b) for a, b in zip(moved, motion(changed), strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(moved, motion(robot), strict=True))


@EVERY
def test_a_robot_with_it_goes_out_to_yaml_and_loads_equal(name: str, tmp_path: Path) -> None:
    robot, moved = with_it(name)
    (tmp_path / "back.yaml").write_text(robot.to_yaml())
    back = Robot.load(str(tmp_path / "back.yaml"))
    assert back == robot
    assert back.to_yaml() == robot.to_yaml()
    assert back.parameters() == robot.parameters()
    for one, other in zip(moved, motion(back), strict=True):
        assert one.tobytes() == other.tobytes()


@EVERY
def test_without_it_the_robot_moves_otherwise(name: str) -> None:
    _, moved = with_it(name)
    motors = [(a[..., :6], b[..., :6]) for a, b in zip(moved, nominal_motion(), strict=True)]
    assert any(not np.array_equal(a, b) for a, b in motors)


def swung(robot: Robot, step: float) -> RobotMotion:
    """The motion of the axis, with everything behind it, sampled every `step`; the torque is held for a sample."""
    time = robot.sample_time_s * np.arange(60)
    reference = np.zeros((1, 60, 6))
    reference[0, :, 1] = 5.0 * np.sin(2 * np.pi * 20 * time)
    run = robot.simulate(reference, np.array([[0.1, 0.5, 0.2, 0.1, 0.3, 0.1]]), keep_coordinates=True)
    assert run.coordinates is not None
    finer = round(robot.sample_time_s / step)
    instants = np.arange(60 * finer) / finer
    position = np.stack([np.interp(instants, range(60), q) for q in run.coordinates[0].T], axis=-1)[None]
    speed = np.gradient(position, step, axis=1)
    return RobotMotion(position, speed, step, torque=np.repeat(run.torque, finer, axis=1))


@EVERY
def test_every_parameter_of_a_law_has_a_column(name: str) -> None:
    effect = effect_of(name)
    robot, _ = with_it(name)
    names = [f"effect.cause.{row.name}" for row in effect.parameters]
    if issubclass(effect, StructureEffect):
        with pytest.raises(ConfigurationError, match="no parameter of a law"):
            effect_columns(robot, names, swung(robot, robot.sample_time_s))
        return
    within = issubclass(effect, SignalEffect) and effect.channels[0] == "torque"  # laws that run every step
    motion = swung(robot, robot.step_s if within else robot.sample_time_s)
    columns = effect_columns(robot, names, motion)
    assert {column.name for column in columns} == set(names)
    assert all(np.isfinite(column.values).all() for column in columns)
    draws = name.endswith("noise")  # drawn before the run, by no law
    assert draws or any(column.values.any() for column in columns)
    if not issubclass(effect, ForceEffect):
        return
    linear = [column for column in columns if column.linear]
    for column in linear:  # what the regressor says is what the law does
        value = robot.parameter(column.name)
        forces = [
            forces_along(robot.with_parameters({column.name: at}), motion).of("cause")[0].run.force
            for at in (value, 1.001 * value + 1e-3)
        ]
        change = column.values * (0.001 * value + 1e-3)
        np.testing.assert_allclose(forces[1] - forces[0], change, rtol=0, atol=1e-8 * np.abs(forces).max())


def test_the_robot_file_of_the_documentation_loads_and_moves(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "your_own_robot.md").read_text(encoding="utf-8")
    (text,) = (
        block
        for block in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
        if "robid_robot" in block and "effects:" in block
    )
    (tmp_path / "robot.yaml").write_text(text)
    robot = Robot.load(str(tmp_path / "robot.yaml"))
    assert list(robot.description.effects) == ["grease", "play", "ripple", "tool"]
    assert robot.parameters()["effect.grease.viscous"] == 0.005
    assert np.isfinite(motion(robot)[0]).all()
