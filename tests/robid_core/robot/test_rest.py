"""Where a robot rests whose springs have gaps, corners and soft zones: at a minimum of its potential energy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from robid_core import Robot
from robid_core.mechanics.rest import terms_at_rest
from robid_core.mechanics.static_laws import static_force


def robot_of(folder: Path, effects: str, base: str = "six_axis") -> Robot:
    path = folder / "robot.yaml"
    path.write_text(f"robid_robot: 1\nname: tried\nbase: {base}\neffects:\n{effects}")
    return Robot.load(str(path))


def poses(robot: Robot, count: int, seed: int) -> np.ndarray:
    d = robot.drives
    return np.random.default_rng(seed).uniform(d.lower, d.upper, (count, robot.n_axis))


def assert_stable_rest(robot: Robot, position: np.ndarray) -> None:
    """Nothing pulls on what is behind the motors, and every push is pushed back."""
    n, (stiffness, _) = robot.n_axis, robot.spring_arrays()
    springs = robot.mechanism.spring_directions
    matrix = (springs.T * stiffness) @ springs
    terms, laws = terms_at_rest(robot.mechanism, position), static_force(robot.bending_forces, position)
    pull = (terms.bias + position @ matrix + laws.force)[:, n:]
    slope = (terms.gravity_stiffness + matrix + laws.stiffness)[:, n:, n:]
    # Rounding: eps times the largest stiffness (8e5 N m/rad) times a coordinate (3 rad), and a step of 1e-12 rad left.
    assert abs(pull).max() < 1e-5
    assert (np.linalg.eigvalsh(slope)[:, 0] > 0).all()


@pytest.mark.parametrize("gap", [2e-4, 6e-4, 2e-3])
@pytest.mark.parametrize("axes", [(2,), (5,), (1, 2, 3, 4, 5, 6)])
def test_every_pose_of_a_robot_with_backlash_has_a_rest(
    tmp_path: Path, gap: float, axes: tuple[int, ...]
) -> None:
    lines = [f"  b{a}: {{use: transmission.backlash, on: axis_{a}, with: {{gap: {gap}}}}}\n" for a in axes]
    robot = robot_of(tmp_path, "".join(lines))
    rest = robot.equilibrium(poses(robot, 40, 5))
    assert rest.refused == {}
    assert_stable_rest(robot, rest.position)


@pytest.mark.parametrize(
    "effect",
    [
        "{use: transmission.piecewise_linear, on: axis_2, with: {lost_motion: 4.0e-4}}",
        "{use: transmission.soft_zone, on: axis_3}",
        "{use: transmission.backlash, on: axis_3, side: gear, with: {gap: 2.0e-4}}",  # docs/your_own_robot.md, 'tired'
    ],
)
def test_every_pose_of_a_robot_with_another_soft_zone_has_a_rest(tmp_path: Path, effect: str) -> None:
    robot = robot_of(tmp_path, f"  soft: {effect}\n")
    rest = robot.equilibrium(poses(robot, 60, 6))
    assert_stable_rest(robot, rest.position)


@pytest.mark.parametrize("angle", [np.pi / 2, -np.pi / 2, 0.0, 2.9])
@pytest.mark.parametrize("gap", [1e-4, 2e-3])
def test_the_rest_is_the_minimum_of_the_energy(tmp_path: Path, gap: float, angle: float) -> None:
    """Oracle: the energy of one joint, weight and gear integrated over a fine grid, and its lowest points."""
    play = f"  play: {{use: transmission.backlash, on: axis_1, with: {{gap: {gap}}}}}\n"
    robot = robot_of(tmp_path, play, "one_axis")
    motor, arm = robot.equilibrium(np.array([[angle]])).position[0]
    (stiffness,), _ = robot.spring_arrays()
    chain, middle = robot.chain, robot.drives.gear[0, 0] * motor
    weight = abs(chain.mass @ np.linalg.norm(chain.centre_of_mass, axis=1)) * 9.81
    grid = np.linspace(middle - gap - 2 * weight / stiffness, middle + gap + 2 * weight / stiffness, 40_001)
    z = np.column_stack((np.full(len(grid), motor), grid))
    pull = terms_at_rest(robot.mechanism, z).bias[:, 1] - stiffness * (middle - grid)
    pull += static_force(robot.bending_forces, z).force[:, 1]
    energy = cumulative_trapezoid(pull, grid, initial=0.0)
    lowest = grid[1:-1][(energy[1:-1] <= energy[:-2]) & (energy[1:-1] < energy[2:])]
    assert 1 <= len(lowest) <= 2  # one on each flank at most
    assert min(abs(arm - lowest)) < 2 * (grid[1] - grid[0])


def test_a_robot_without_a_rest_somewhere_gives_candidates_elsewhere(tmp_path: Path) -> None:
    from robid_design.candidates import random_configurations

    robot = Robot.load("six_axis")
    weak = robot.with_parameters({"gear_stiffness.axis_3": 60.0})
    some = poses(weak, 100, 7)
    refused = weak.equilibrium(some, partial=True).refused
    assert 0 < len(refused) < 100
    assert all("axis_3" in why for why in refused.values())
    chosen = random_configurations(weak, 20, np.random.default_rng(8), gravity_share=1.0)
    assert weak.equilibrium(chosen, partial=True).refused == {}
