"""Robots with an effect in them: they move, and one whose structure changed is still a robot."""

from __future__ import annotations

import tempfile
from dataclasses import fields
from pathlib import Path

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics import Simulation, SimulationDiverged, SimulationState
from robid_core.robot import Robot
from robid_core.robot.plant import continue_simulation, standing
from robid_core.robot.structure_effect import StructureEffect
from robid_core.testing.broken import ContractBroken
from robid_core.testing.places import LABEL, example_robots, spots

N_LANE = 9  # a block of eight and one more
N_ALONE = 3  # equal experiments: the fewest that run on all lanes at once, whose kernels are compiled already
N_SAMPLE = 200  # 0.2 s
SPEED = 10.0  # rad/s of the motors, at the first lane
RUNAWAY = 20.0  # times the largest speed that was asked for: nothing that follows its reference gets there


def check_motion(name: str, robot: Robot) -> None:
    """Check that a robot follows a sine of 5 Hz for 0.2 s, and does among nine experiments what it does by itself."""
    middle = 0.5 * (robot.drives.lower + robot.drives.upper)
    angle = np.where(np.isfinite(middle), middle, 0.0) + 0.1  # an arm that hangs straight down shows no load
    start = standing(robot, robot.motor_angle(np.tile(angle, (N_LANE, 1))))
    time = robot.sample_time_s * np.arange(N_SAMPLE)
    wave = np.sin(2 * np.pi * 5.0 * time[:, None] + np.arange(robot.n_axis))
    reference = SPEED * (1 + np.arange(N_LANE) / N_LANE)[:, None, None] * wave
    together = _follow(name, robot, start, reference)
    speed = np.abs(np.diff(together.position, axis=1)).max() / robot.sample_time_s
    if not speed <= RUNAWAY * 2 * SPEED:
        raise ContractBroken(
            f"{name}: a motor of {robot.name} is asked for {2 * SPEED:g} rad/s and runs {speed:.3g}"
        )
    for lane in (0, N_LANE - 1):
        same = [lane] * N_ALONE
        own = SimulationState(**{f.name: getattr(start, f.name)[same] for f in fields(start)})
        alone = _follow(name, robot, own, reference[same])
        for word, one, all_lanes in (
            ("position", alone.position, together.position),
            ("torque", alone.torque, together.torque),
            ("state of the law", alone.state.law_state, together.state.law_state),
        ):
            if not np.array_equal(one[0], all_lanes[lane]):
                raise ContractBroken(
                    f"{name}: {robot.name} moves otherwise as experiment {lane} of {N_LANE} than by itself: {word} "
                    f"differs by {np.abs(one[0] - all_lanes[lane]).max():.3g}"
                )


def _follow(name: str, robot: Robot, start: SimulationState, reference: FloatArray) -> Simulation:
    try:
        return continue_simulation(robot, start, reference, None)
    except SimulationDiverged as error:
        raise ContractBroken(f"{name}: {robot.name} does not stay in bounds: {error}") from error


def check_structure(effect: type[StructureEffect], values: FloatArray) -> None:
    """Check that a structure effect makes robots that load, linearise and move, and refuses the rest in words."""
    for kind in effect.places:
        name = f"{effect.__name__} on {kind}"
        found = [(robot, on) for robot in example_robots() for on in spots(robot, kind)]
        made = sum(_check_on(name, effect, values, robot, on) for robot, on in found)
        if not made:
            raise ContractBroken(f"{name}: refuses every example robot")
        for robot, on in found[::2]:
            _check_refusals(name, effect, values, robot, on)


def _check_on(name: str, effect: type[StructureEffect], values: FloatArray, robot: Robot, on: str) -> bool:
    """Check the robot with the effect; return False where it is refused, as a second axis is where there is one."""
    before = repr(robot.description)
    try:
        changed = effect.apply(robot, values.copy(), on, LABEL)
    except ConfigurationError:
        return False
    if not isinstance(changed, Robot) or repr(robot.description) != before:
        raise ContractBroken(
            f"{name}: apply gives {type(changed).__name__}, or changes the robot it is given"
        )
    if changed == robot:
        raise ContractBroken(f"{name}: {robot.name} stays as it was; give parameters that change something")
    _check_robot(name, changed)
    return True


def _check_robot(name: str, robot: Robot) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.yaml"
        path.write_text(robot.to_yaml(), encoding="utf-8")
        if Robot.load(str(path)) != robot:
            raise ContractBroken(f"{name}: {robot.name} changes when it is written and loaded")
    model = robot.linearize(np.full(robot.n_axis, 0.1))
    if not all(np.isfinite(matrix).all() for matrix in (model.a, model.b, model.c, model.d)):
        raise ContractBroken(f"{name}: the linear model of {robot.name} is not finite")
    check_motion(name, robot)


def _check_refusals(
    name: str, effect: type[StructureEffect], values: FloatArray, robot: Robot, on: str
) -> None:
    """Check that what cannot be is a ConfigurationError: at the bounds of the table, and on no such thing."""
    tries = [(values, "no_such_place")]
    for index, row in enumerate(effect.parameters):
        for bound in (row.lower, row.upper):
            changed = values.copy()
            changed[index] = bound
            tries.append((changed, on))
    for parameters, where in tries:
        told = dict(zip((row.name for row in effect.parameters), parameters.tolist(), strict=True))
        try:
            made = effect.apply(robot, parameters, where, LABEL)
            _ = made.mechanism, made.drives
        except ConfigurationError:
            continue
        except Exception as error:
            raise ContractBroken(
                f"{name}: on '{where}' with {told} it fails with {type(error).__name__}: {error}; raise "
                "ConfigurationError, or narrow the bounds"
            ) from error
        if where == "no_such_place":
            raise ContractBroken(f"{name}: acts on 'no_such_place' of {robot.name}; raise ConfigurationError")
