"""Payload and centre of mass: against pinocchio's joined inertias, and gravity by hand."""

import numpy as np
import pinocchio
import pytest

from robid_core import ConfigurationError, Robot
from robid_core.mechanics import dynamics
from robid_effects.centre_of_mass import CentreOfMassError
from robid_effects.payload import Payload, joined

LOAD = np.array([12.0, 0.05, -0.03, 0.11, 0.08])  # kg, centre of mass, radius of gyration


def pinocchio_model(robot: Robot) -> pinocchio.Model:
    chain, model = robot.chain, pinocchio.Model()
    model.gravity.linear = chain.gravity
    for j, name in enumerate(chain.names):
        parent = model.getJointId(chain.names[chain.parent[j]]) if chain.parent[j] >= 0 else 0
        place = pinocchio.SE3(chain.rotation[j], chain.translation[j])
        joint = model.addJoint(parent, pinocchio.JointModelRevoluteUnaligned(chain.axis[j]), place, name)
        inertia = pinocchio.Inertia(chain.mass[j], chain.centre_of_mass[j], chain.inertia[j])
        model.appendBodyToJoint(joint, inertia, pinocchio.SE3.Identity())
    return model


def poses(n: int) -> np.ndarray:
    return np.random.default_rng(18).uniform(-2, 2, (5, n))


def test_two_bodies_join_as_pinocchio_adds_them() -> None:
    rng = np.random.default_rng(19)
    points = rng.normal(size=(2, 6, 3))
    inertias = [np.sum(p**2) * np.eye(3) - p.T @ p for p in points]
    centres = rng.normal(size=(2, 3))
    total, centre, inertia = joined(2.0, centres[0], inertias[0], 0.7, centres[1], inertias[1])
    other = pinocchio.Inertia(2.0, centres[0], inertias[0]) + pinocchio.Inertia(0.7, centres[1], inertias[1])
    assert total == pytest.approx(other.mass, rel=1e-15)
    np.testing.assert_allclose(centre, other.lever, atol=1e-14)
    np.testing.assert_allclose(inertia, other.inertia, atol=1e-13)


@pytest.mark.parametrize("on", [None, "axis_2"])
def test_the_loaded_robot_is_the_one_that_pinocchio_loads(on: str | None) -> None:
    robot = Robot.load("six_axis")
    loaded = Payload.apply(robot, LOAD, on, "tool")
    model = pinocchio_model(robot)
    body = model.getJointId(
        "axis_6" if on is None else "axis_2_z"
    )  # axis_2 bends in two bearings before its body
    load = pinocchio.Inertia(12.0, LOAD[1:4], 12.0 * 0.08**2 * np.eye(3))
    model.appendBodyToJoint(body, load, pinocchio.SE3.Identity())
    data = model.createData()
    q = poses(model.nq)
    found = dynamics(loaded.chain, q)
    for k in range(len(q)):
        mass = np.array(pinocchio.crba(model, data, q[k]))
        mass = np.triu(mass) + np.triu(mass, 1).T
        np.testing.assert_allclose(found.mass[k], mass, atol=1e-10 * np.abs(mass).max())
        gravity = pinocchio.computeGeneralizedGravity(model, data, q[k])
        np.testing.assert_allclose(found.bias[k], gravity, atol=1e-10 * np.abs(gravity).max())


def test_mass_matrix_and_gravity_are_linear_in_the_mass() -> None:
    robot = Robot.load("six_axis")
    q = poses(robot.chain.n_coordinate)
    results = [
        dynamics(Payload.apply(robot, LOAD * [m, 1, 1, 1, 1], None, "tool").chain, q) for m in (0, 1, 3)
    ]
    for field in ("mass", "bias"):
        none, one, three = (getattr(result, field) for result in results)
        np.testing.assert_allclose(three - none, 3 * (one - none), atol=1e-10 * np.abs(three).max())
        assert np.abs(one - none).max() > 1e-2


def test_what_is_taken_off_was_never_there() -> None:
    robot = Robot.load("six_axis")
    off = LOAD * [-1, 1, 1, 1, 1]
    again = Payload.apply(Payload.apply(robot, LOAD, "axis_3", "on"), off, "axis_3", "off")
    for field in ("mass", "centre_of_mass", "inertia"):
        np.testing.assert_allclose(getattr(again.chain, field), getattr(robot.chain, field), atol=1e-12)


def test_a_load_that_no_body_can_have_is_refused() -> None:
    robot = Robot.load("one_axis")  # 40 kg, smallest principal moment 0.2
    with pytest.raises(ConfigurationError, match="effects.tool: body 'axis_1' has 40 kg, with -40 kg"):
        Payload.apply(robot, np.array([-40.0, 0, 0, 0, 0]), None, "tool")
    with pytest.raises(
        ConfigurationError, match="effects.tool: body 'axis_1': inertia: a principal moment is -"
    ):
        Payload.apply(robot, np.array([-20.0, 0, 0, 0.5, 0.5]), None, "tool")
    with pytest.raises(ConfigurationError, match="there is no body 'hand'; there are axis_1"):
        Payload.apply(robot, LOAD, "hand", "tool")


def test_a_shift_of_the_centre_of_mass_changes_gravity_and_inertia_as_by_hand() -> None:
    """One arm about y, 40 kg at (0.05, 0, 0.5): at rest about the joint (9.81 m x), inertia 3.5 + m (x^2 + z^2)."""
    robot = Robot.load("one_axis")
    moved = CentreOfMassError.apply(robot, np.array([0.02, 0.3, -0.1]), None, "oil")
    found = dynamics(moved.chain, np.zeros((1, 1)))
    assert found.bias[0, 0] == pytest.approx(-9.81 * 40 * 0.07, rel=1e-12)
    assert found.mass[0, 0, 0] == pytest.approx(3.5 + 40 * (0.07**2 + 0.4**2), rel=1e-12)
    assert moved.chain.mass == robot.chain.mass


def test_a_massless_body_has_no_centre_of_mass_to_move() -> None:
    robot = Robot.load("one_axis")
    empty = robot.description.bodies[0].model_copy(update={"mass": 0.0, "inertia": ((0.0,) * 3,) * 3})
    bare = Robot(robot.description.model_copy(update={"bodies": (empty,)}))
    with pytest.raises(ConfigurationError, match="body 'axis_1' has no mass"):
        CentreOfMassError.apply(bare, np.ones(3), "axis_1", "oil")
