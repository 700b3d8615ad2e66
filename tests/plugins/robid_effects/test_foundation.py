"""Flexible foundation: linear frequencies of small systems that are known otherwise."""

import numpy as np
import pytest
from scipy.linalg import eigh

from robid_core import ConfigurationError, Robot
from robid_effects.foundation import RockingFoundation, SwayingFoundation

ROCKING = {
    "stiffness_x": 3e5,
    "stiffness_y": 2e5,
    "damping_x": 40.0,
    "damping_y": 30.0,
    "mass": 50.0,
    "height": 0.2,
    "radius_of_gyration": 0.4,
}


def weightless(**body: object) -> Robot:
    """One arm about y without gravity: 40 kg, 3.5 kg m^2 about x and y; rotor 1.2e-3 kg m^2, gear 100, 8e4 N m/rad."""
    robot = Robot.load("one_axis")
    changed = robot.description.bodies[0].model_copy(update=body)
    return Robot(robot.description.model_copy(update={"gravity": (0.0, 0.0, 0.0), "bodies": (changed,)}))


def row(effect, **values: float) -> np.ndarray:
    return np.array([values.get(entry.name, entry.default) for entry in effect.parameters])


def squares(robot: Robot) -> np.ndarray:
    """Squares of the undamped natural frequencies at angle zero, ascending, the motor's free turn first."""
    model = robot.second_order(np.zeros((1, robot.n_axis)))
    return eigh(model.stiffness[0], model.mass[0], eigvals_only=True)


def test_an_arm_on_a_rocking_base_is_a_chain_of_three_inertias() -> None:
    """Absolute angles of base b and arm p about y, motor m: springs k_f b, k_g (m / 100 - (p - b)); x is apart."""
    robot = RockingFoundation.apply(
        weightless(centre_of_mass=(0.0, 0.0, 0.0)), row(RockingFoundation, **ROCKING), "base", "floor"
    )
    base = 50 * (0.4**2 + 0.2**2)
    inertia = np.diag([1.2e-3, base, 3.5])
    gear = np.array([[0.01, 1.0, -1.0]])
    stiffness = 8e4 * gear.T @ gear + np.diag([0, 2e5, 0])
    expected = np.sort(np.r_[eigh(stiffness, inertia, eigvals_only=True), 3e5 / (base + 3.5)])
    np.testing.assert_allclose(squares(robot), expected, rtol=1e-9, atol=1e-6 * expected[1])


def test_the_damper_stands_beside_the_spring() -> None:
    robot = RockingFoundation.apply(weightless(), row(RockingFoundation, **ROCKING), None, "floor")
    values = dict(zip(robot.damping_names, robot.spring_arrays()[1], strict=True))
    assert (values["bearing_damping.floor_x"], values["bearing_damping.floor_y"]) == (40.0, 30.0)
    model = robot.second_order(np.zeros((1, 1)), motor_damping=np.zeros((1, 1)))
    names = robot.mechanism.coordinate_names
    damping = np.diag(model.damping[0])[[names.index("floor_x"), names.index("floor_y")]]
    np.testing.assert_allclose(damping, [40, 30], rtol=1e-12)


def test_a_swaying_base_carries_its_own_mass_and_the_arm() -> None:
    """Balanced arm: along x and y 50 + 40 kg on a spring; motor and arm turn apart from that."""
    robot = weightless(centre_of_mass=(0.0, 0.0, 0.0))
    alone = squares(robot)
    values = {"stiffness_x": 4e6, "stiffness_y": 9e6, "mass": 50.0}
    swaying = SwayingFoundation.apply(robot, row(SwayingFoundation, **values), "base", "floor")
    expected = np.sort(np.r_[alone, 4e6 / 90, 9e6 / 90])
    np.testing.assert_allclose(squares(swaying), expected, rtol=1e-9, atol=1e-6 * expected[1])


def test_sway_and_rocking_stand_on_one_another() -> None:
    """Arm of 40 kg at height 0.5 m, motor free: along x sway of 90 kg and rocking share the first moments."""
    robot = weightless(centre_of_mass=(0.0, 0.0, 0.0), translation=(0.0, 0.0, 0.5))
    rocking = RockingFoundation.apply(robot, row(RockingFoundation, **ROCKING), None, "floor")
    values = {"stiffness_x": 4e6, "stiffness_y": 9e6, "mass": 0.0}
    both = SwayingFoundation.apply(rocking, row(SwayingFoundation, **values), None, "pedestal")
    assert both.chain.names == ("pedestal_x", "pedestal_y", "floor_x", "floor_y", "axis_1")
    about_base, first = 50 * (0.4**2 + 0.2**2), 50 * 0.2 + 40 * 0.5
    # y-z plane: sway s along y, rocking r about x, arm with it: 3.5 kg m^2 about its own centre
    mass = np.array([[90, -first], [-first, about_base + 3.5 + 40 * 0.25]])
    across = eigh(np.diag([9e6, 3e5]), mass, eigvals_only=True)
    found = squares(both)
    for value in across:
        assert np.abs(found / value - 1).min() < 1e-9


def test_a_very_stiff_foundation_leaves_the_robot_as_it_was() -> None:
    """Stiffness 1e12 against 4e5 of the gears: 4e-7, times ten for resonances on the grid."""
    robot = Robot.load("six_axis")
    stiff = RockingFoundation.apply(
        robot, row(RockingFoundation, stiffness_x=1e12, stiffness_y=1e12), None, "floor"
    )
    soft = RockingFoundation.apply(robot, row(RockingFoundation), None, "floor")
    angle, frequency = np.array([[0.2, 0.3, -0.4, 0.5, 0.6, -0.7]]), np.linspace(4, 80, 39)
    plain, same, other = (r.response(angle, frequency) for r in (robot, stiff, soft))
    scale = np.abs(plain).max(axis=(2, 3), keepdims=True)
    assert (np.abs(same - plain) / scale).max() < 1e-5
    assert (np.abs(other - plain) / scale).max() > 1e-2


def test_gravity_leans_the_robot_and_the_motors_hold_it() -> None:
    """The arm, 40 kg at x = 0.05 m, turns the base by m g x / k = 1e-4 rad about y; the motor holds the arm alone."""
    robot = Robot.load("one_axis")
    leaning = RockingFoundation.apply(robot, row(RockingFoundation, stiffness_y=2e5, mass=0.0), None, "floor")
    torque = [float(r.gravity_torque(np.zeros((1, 1)))[0, 0]) for r in (robot, leaning)]
    # the lean moves the centre of mass by 0.5 m * 1e-4 rad: a share of 1e-3 of its lever
    assert torque[1] == pytest.approx(torque[0], rel=3e-3)
    assert torque[1] != pytest.approx(torque[0], rel=1e-4)


def test_a_foundation_is_put_under_the_base_only_and_needs_its_own_name() -> None:
    robot = weightless()
    with pytest.raises(ConfigurationError, match="carries the whole robot, not 'axis_1'; write on: base"):
        RockingFoundation.apply(robot, row(RockingFoundation), "axis_1", "floor")
    once = RockingFoundation.apply(robot, row(RockingFoundation), None, "floor")
    with pytest.raises(ConfigurationError, match="effects.floor: there is a joint 'floor_x' already"):
        SwayingFoundation.apply(once, row(SwayingFoundation), None, "floor")
