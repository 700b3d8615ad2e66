"""Elastic modes against a closed form, resonances of the response, and the kinematics of another module."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Robot
from robid_core.mechanics import pose_of
from robid_report.body import SWING, body_data
from robid_report.mode_shapes import elastic_modes, energy_in_words


def test_one_spring_between_rotor_and_arm_has_its_closed_form() -> None:
    """f = sqrt(k (1 / J_rotor + 1 / J_arm)) / 2 pi; gravity adds less than m g l / k of it."""
    robot = Robot.load("one_axis")
    (mode,) = elastic_modes(robot, np.zeros((1, 1)), 1e4, 9)[0]
    chain, gear = robot.chain, float(robot.mechanism.gear[0, 0])
    axis, centre = chain.axis[0], chain.centre_of_mass[0]
    arm = float(axis @ chain.inertia[0] @ axis + chain.mass[0] * (centre @ centre - (axis @ centre) ** 2))
    rotor = float(robot.mechanism.rotor_inertia[0]) / gear**2
    stiffness = float(robot.spring_arrays()[0][0])
    closed = np.sqrt(stiffness * (1 / rotor + 1 / arm)) / (2 * np.pi)
    lever = float(chain.mass[0] * 9.82 * np.linalg.norm(centre))
    assert mode.frequency_hz == pytest.approx(closed, rel=lever / stiffness)
    assert mode.energy == pytest.approx([1.0])
    assert energy_in_words(robot.spring_names, mode.energy) == "gear of axis_1 100\u202f%"


def test_the_undamped_response_grows_without_bound_towards_each_mode() -> None:
    """Nearer by a factor of ten, larger by that factor: the response is of a simple pole there."""
    robot = Robot.load("six_axis")
    dampers = dict.fromkeys(robot.damping_names, 0.0)
    robot = robot.with_parameters({**dampers, **{f"gear_damping.{a}": 1e-9 for a in robot.axis_names}})
    angle = np.array([[0.3, -0.4, 0.5, 0.2, 0.6, -0.1]])
    modes = elastic_modes(robot, angle, 60.0, 5)[0]
    assert len(modes) >= 3
    for mode in modes:
        near = mode.frequency_hz * (1 + np.array([1e-6, 1e-5]))
        size = np.abs(robot.response(angle, near, np.full((1, 6), 1e-12), "continuous")).max(axis=(2, 3))[0]
        assert size[0] / size[1] == pytest.approx(10.0, rel=0.02)
        assert mode.energy.sum() == pytest.approx(1.0)


def test_points_of_a_mode_move_as_the_jacobian_of_the_chain_says() -> None:
    robot = Robot.load("six_axis")
    angle = np.array([[0.3, -0.4, 0.5, 0.2, 0.6, -0.1]])
    found = body_data(robot, angle, 100.0)
    assert found is not None
    data, _ = found
    chain = robot.chain
    joint = np.zeros((1, chain.n_coordinate))
    joint[0, robot.mechanism.arm] = angle[0]
    (modes,) = elastic_modes(robot, angle, 100.0, 1)
    rate = robot.mechanism.constraint_map @ modes[0].shape
    poses = [pose_of(chain, joint, name) for name in chain.names]
    moved = np.stack([pose.jacobian[0, 3:] @ rate for pose in poses])
    drawn = np.array(data["configurations"][0]["modes"][0]["moved"])
    assert np.linalg.norm(drawn, axis=1).max() == pytest.approx(SWING * data["size"], abs=2e-4)
    own = drawn[: len(moved)]
    scale = float((own * moved).sum() / (moved**2).sum())
    np.testing.assert_allclose(own, scale * moved, atol=1e-4)  # written to 0.1 mm
    np.testing.assert_allclose(
        np.array(data["configurations"][0]["points"])[: len(poses)],
        np.stack([pose.position[0] for pose in poses]),
        atol=1e-4,
    )


def test_a_rotor_whose_mass_lies_in_its_joint_is_not_drawn() -> None:
    robot = Robot.load("one_axis")
    whole = robot.description.model_dump()
    assert body_data(robot, np.zeros((1, 1)), 100.0) is not None
    whole["bodies"][0]["centre_of_mass"] = (0.0, 0.0, 0.0)
    rotor = Robot(type(robot.description).model_validate(whole))
    assert body_data(rotor, np.zeros((1, 1)), 100.0) is None
